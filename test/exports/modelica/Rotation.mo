// SPDX-License-Identifier: MIT
// Copyright (c) 2026 the penode authors

package Rotation
  connector Shaft
    Real phi(unit = "rad");
    flow Real tau(unit = "N.m");
  end Shaft;

  model Inertia
    Shaft a;
    Shaft b;
    parameter Real J(unit = "kg.m2") = 1;
    Real phi(unit = "rad", start = 0);
    Real w(unit = "rad/s", start = 0);
  equation
    phi = a.phi;
    phi = b.phi;
    w = der(phi);
    J*der(w) = a.tau + b.tau;
  end Inertia;

  model Torsion
    Shaft a;
    Shaft b;
    parameter Real c(unit = "N.m/rad") = 1;
    parameter Real d(unit = "N.m.s/rad") = 1;
    Real twist;
  equation
    twist = b.phi - a.phi;
    b.tau = c*twist + d*der(twist);
    a.tau = -b.tau;
  end Torsion;

  model Torque
    Shaft shaft;
    input Real tau(unit = "N.m");
  equation
    shaft.tau = -tau;
  end Torque;

  model Drive "a motor and a load on a soft shaft"
    input Real torque(unit = "N.m");
    Inertia motor(J = 0.1, phi(start = 0.2));
    Inertia load(J = 0.5);
    Torsion shaft(c = 40, d = 0.1);
    Torque source(tau = torque);
  equation
    connect(source.shaft, motor.a);
    connect(motor.b, shaft.a);
    connect(shaft.b, load.a);
  end Drive;
end Rotation;
