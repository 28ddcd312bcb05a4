"""
Named force laws of an element: force F over deflection s = z_a - z_b [m] and rate v = v_a - v_b [m/s], positive force
pulls the two ends together. An extension found from data is one more element with one of these laws.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Law:
    """`force` in terms of s, v and the arguments; `arguments` maps each to its unit."""

    force: str
    arguments: dict[str, str]


LAWS: dict[str, Law] = {
    "linear_spring": Law("stiffness*s", {"stiffness": "N/m"}),
    "linear_damper": Law("damping*v", {"damping": "N*s/m"}),
    "constant_force": Law("force", {"force": "N"}),
    "cubic_spring": Law("cubic*s^3", {"cubic": "N/m^3"}),
    # quadratic in the distance to the point of zero stiffness, as in the published case study
    "progressive_spring": Law("(root*(s + lead))^2 - (root*lead)^2", {"root": "N^0.5/m", "lead": "m"}),
    "bump_stop": Law("stiffness*max(s - gap, 0)", {"stiffness": "N/m", "gap": "m"}),
    "rebound_stop": Law("stiffness*min(s + gap, 0)", {"stiffness": "N/m", "gap": "m"}),
    "quadratic_damper": Law("coefficient*v*abs(v)", {"coefficient": "N*s^2/m^2"}),
    # extra damping on one side only: rebound is v > 0
    "rebound_damper": Law("damping*max(v, 0)", {"damping": "N*s/m"}),
    "compression_damper": Law("damping*min(v, 0)", {"damping": "N*s/m"}),
    "coulomb_friction": Law("force*tanh(v/transition)", {"force": "N", "transition": "m/s"}),
    # Modelica.Mechanics.Translational friction in its smooth form: breakaway peak at `breakaway_rate`, then Coulomb
    "stribeck_friction": Law(
        "2.3316439815971242*(breakaway - coulomb)*exp(-(v/stribeck)^2)*v/stribeck + coulomb*tanh(v/transition)",
        {"breakaway": "N", "coulomb": "N", "stribeck": "m/s", "transition": "m/s"},
    ),
}
