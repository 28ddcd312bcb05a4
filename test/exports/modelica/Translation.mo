// SPDX-License-Identifier: MIT
// Copyright (c) 2026 the penode authors

package Translation "Masses, springs and dampers, with the connectors that libraries have"
  connector Flange
    Real s(unit = "m");
    flow Real f(unit = "N");
  end Flange;

  partial model Compliant
    Flange flange_a;
    Flange flange_b;
    Real s_rel(unit = "m");
    Real f(unit = "N");
  equation
    s_rel = flange_b.s - flange_a.s;
    flange_b.f = f;
    flange_a.f = -f;
  end Compliant;

  model Mass
    Flange flange_a;
    Flange flange_b;
    parameter Real m(unit = "kg") = 1 "mass";
    parameter Real L(unit = "m") = 0;
    Real s(unit = "m", start = 0);
    Real v(unit = "m/s", start = 0);
    Real a(unit = "m/s2");
  equation
    flange_a.s = s - L/2;
    flange_b.s = s + L/2;
    v = der(s);
    a = der(v);
    m*a = flange_a.f + flange_b.f;
  end Mass;

  model Spring
    extends Compliant;
    parameter Real c(unit = "N/m") = 1;
    parameter Real s_rel0 = 0 "its unit follows from the equation";
  equation
    f = c*(s_rel - s_rel0);
  end Spring;

  model Damper
    extends Compliant;
    parameter Real d(unit = "N.s/m") = 1;
    Real v_rel;
  equation
    v_rel = der(s_rel);
    f = d*v_rel;
  end Damper;

  model SpringDamper
    extends Compliant;
    parameter Real c(unit = "N/m") = 1;
    parameter Real d(unit = "N.s/m") = 1;
  equation
    f = c*s_rel + d*der(s_rel);
  end SpringDamper;

  model Position
    Flange flange;
    input Real s_ref(unit = "m");
  equation
    flange.s = s_ref;
  end Position;

  model Fixed
    Flange flange;
    parameter Real s0 = 0;
  equation
    flange.s = s0;
  end Fixed;

  model Swing "a mass on a spring and a damper"
    Mass body(m = 2, s(start = 0.01));
    Spring spring(c = 200);
    Damper damper(d = 3);
    Fixed ground;
  equation
    connect(ground.flange, spring.flange_a);
    connect(ground.flange, damper.flange_a);
    connect(spring.flange_b, body.flange_a);
    connect(damper.flange_b, body.flange_a);
  end Swing;

  model Pair "two masses without anything between them, a third behind a spring"
    Mass one(m = 1.5, L = 0.2, s(start = 0.3));
    Mass two(m = 0.5, L = 0.1);
    Mass three(m = 1, s(start = 0.5));
    SpringDamper left(c = 300, d = 2);
    SpringDamper right(c = 100, d = 1);
    Fixed ground;
  equation
    connect(ground.flange, left.flange_a);
    connect(left.flange_b, one.flange_a);
    connect(one.flange_b, two.flange_a);
    connect(two.flange_b, right.flange_a);
    connect(right.flange_b, three.flange_a);
  end Pair;

  model Quarter "a quarter vehicle over a road"
    input Real z_road(unit = "m");
    output Real z_b(unit = "m");
    output Real tyre_force(unit = "N");
    Mass body(m = 380);
    Mass wheel(m = 36);
    Spring spring(c = 21000);
    Damper damper(d = 1500);
    Spring tyre(c = 190000);
    Position road(s_ref = z_road);
  equation
    connect(road.flange, tyre.flange_a);
    connect(tyre.flange_b, wheel.flange_a);
    connect(wheel.flange_b, spring.flange_a);
    connect(wheel.flange_b, damper.flange_a);
    connect(spring.flange_b, body.flange_a);
    connect(damper.flange_b, body.flange_a);
    z_b = body.s;
    tyre_force = tyre.f;
  end Quarter;
end Translation;
