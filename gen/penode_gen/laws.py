"""
Named force laws of an element: force F over deflection s = z_a - z_b [m] and rate v = v_a - v_b [m/s], positive force
pulls the two ends together. An extension found from data is one more element with one of these laws. Between ends that turn, s is an
angle [rad], F a torque [N*m], and all units follow.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field


@dataclass(frozen=True)
class LawState:
    """A state that a law brings along, 0 at the start: its unit, and its rate in terms of s, v, arguments and states."""

    unit: str
    rate: str


@dataclass(frozen=True)
class Law:
    """`force` in terms of s, v, the arguments and the law's own states; `arguments` maps each to its unit."""

    force: str
    arguments: dict[str, str]
    states: dict[str, LawState] = field(default_factory=dict)


_TURNED = {"m": "rad", "N": "N*m", "kg": "kg*m^2"}


def for_angles(unit: str) -> str:
    """A unit of a law in m, N and kg, where it acts between ends that turn: N/m -> N*m/rad, kg -> kg*m^2."""

    def turned(found: re.Match[str]) -> str:
        new = _TURNED.get(found[1], found[1])
        return f"({new}){found[2]}" if found[2] and "*" in new else new + found[2]

    return re.sub(r"([A-Za-z]+)((?:\^[-0-9.]+)?)", turned, unit)


LAWS: dict[str, Law] = {
    "linear_spring": Law("stiffness*s", {"stiffness": "N/m"}),
    "linear_damper": Law("damping*v", {"damping": "N*s/m"}),
    "constant_force": Law("force", {"force": "N"}),
    # a load that is put on: half of it at `begin`, most of it within `time` on either side
    "growing_force": Law(
        "force*(1 + tanh((elapsed - begin)/time))/2", {"force": "N", "begin": "s", "time": "s"}, {"elapsed": LawState("s", "1")}
    ),
    "cubic_spring": Law("cubic*s^3", {"cubic": "N/m^3"}),
    # quadratic in the distance to the point of zero stiffness, as in the published case study
    "progressive_spring": Law("(root*(s + lead))^2 - (root*lead)^2", {"root": "N^0.5/m", "lead": "m"}),
    "quadratic_spring": Law("quadratic*s^2", {"quadratic": "N/m^2"}),
    # extra stiffness of the stretched side
    "asymmetric_spring": Law("stiffness*max(s, 0)", {"stiffness": "N/m"}),
    # by the sign of s, whatever the order of the ends: with the upper end first, bump_stop acts in rebound
    "bump_stop": Law("stiffness*max(s - gap, 0)", {"stiffness": "N/m", "gap": "m"}),
    "rebound_stop": Law("stiffness*min(s + gap, 0)", {"stiffness": "N/m", "gap": "m"}),
    # takes a parallel spring of that stiffness away: within the play altogether, beyond it a constant force is missing
    "backlash": Law("stiffness*(max(s - gap, 0) + min(s + gap, 0) - s)", {"stiffness": "N/m", "gap": "m"}),
    # takes a parallel spring away where it would pull: a tyre stretched by more than its static load pressed it in
    "liftoff": Law("-stiffness*max(s - static, 0)", {"stiffness": "N/m", "static": "m"}),
    "quadratic_damper": Law("coefficient*v*abs(v)", {"coefficient": "N*s^2/m^2"}),
    # extra damping on one side only: rebound is v > 0
    "rebound_damper": Law("damping*max(v, 0)", {"damping": "N*s/m"}),
    "compression_damper": Law("damping*min(v, 0)", {"damping": "N*s/m"}),
    # takes a parallel damper away at rates far above the knee
    "degressive_damper": Law("-damping*v*abs(v)/(knee + abs(v))", {"damping": "N*s/m", "knee": "m/s"}),
    # come with time, or with the work done: damping below zero is a damper that fades
    "fading_damper": Law("damping*faded*v", {"damping": "N*s/m", "time": "s"}, {"faded": LawState("1", "(1 - faded)/time")}),
    # warmed by the work that it does, cooled by the air
    "heating_damper": Law(
        "damping*warm*v",
        {"damping": "N*s/m", "work": "m^2/s", "cooling": "s"},
        {"warm": LawState("1", "(1 - warm)*v^2/work - warm/cooling")},
    ),
    "coulomb_friction": Law("force*tanh(v/transition)", {"force": "N", "transition": "m/s"}),
    # Modelica.Mechanics.Translational friction in its smooth form: breakaway peak at `breakaway_rate`, then Coulomb
    "stribeck_friction": Law(
        "2.3316439815971242*(breakaway - coulomb)*exp(-(v/stribeck)^2)*v/stribeck + coulomb*tanh(v/transition)",
        {"breakaway": "N", "coulomb": "N", "stribeck": "m/s", "transition": "m/s"},
    ),
    # hysteresis of Bouc and Wen with exponent 2: stiff (force/presliding) after each reversal, at last the constant force
    "bouc_wen": Law(
        "force*slip", {"force": "N", "presliding": "m"}, {"slip": LawState("1", "(v - (v*slip^2 + abs(v)*slip*abs(slip))/2)/presliding")}
    ),
    # the same with other loops: bend 0 .. 1.4 for exponents 1 .. 2.5; share that depends on the sign of the rate, 1 for Dahl
    "bouc_wen_loop": Law(
        "force*slip",
        {"force": "N", "presliding": "m", "bend": "1", "share": "1"},
        {"slip": LawState("1", "(v - (share*abs(v)*slip + (1 - share)*v*abs(slip))*(1 - bend + bend*abs(slip)))/presliding")},
    ),
    # hysteresis of Dahl: ever softer after a reversal
    "dahl_friction": Law("force*slip", {"force": "N", "presliding": "m"}, {"slip": LawState("1", "(v - abs(v)*slip)/presliding")}),
    # dry friction of bristles whose level falls with the rate (Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE TAC 40, 1995, eq. 1-6,
    # without the damping of the bristles)
    "lugre_friction": Law(
        "force*slip",
        {"force": "N", "presliding": "m", "rise": "1", "stribeck": "m/s"},
        {"slip": LawState("1", "(v - abs(v)*slip/(1 + rise*exp(-(v/stribeck)^2)))/presliding")},
    ),
    # the part of a dry friction that is there at low rates only, with the memory of Dahl's
    "falling_friction": Law(
        "force*slip/(1 + (v/stribeck)^2)",
        {"force": "N", "presliding": "m", "stribeck": "m/s"},
        {"slip": LawState("1", "(v - abs(v)*slip)/presliding")},
    ),
    # hysteresis behind a play: without force for about 1.4 times the presliding after a reversal
    "slack_friction": Law(
        "force*slip^5", {"force": "N", "presliding": "m"}, {"slip": LawState("1", "(v - (v*slip^2 + abs(v)*slip*abs(slip))/2)/presliding")}
    ),
    # takes from a parallel damper what it loses behind a play and a spring of damping/relaxation in series
    "loose_damper": Law(
        "damping*((max(eye - gap, 0) + min(eye + gap, 0))/relaxation - v)",
        {"damping": "N*s/m", "gap": "m", "relaxation": "s"},
        {"eye": LawState("m", "v - (max(eye - gap, 0) + min(eye + gap, 0))/relaxation")},
    ),
    # takes from a parallel damper what it loses behind gas, which a rate of `rate` presses by `pocket`
    "aerated_damper": Law(
        "damping*(rate*(pressed/pocket)^3 - v)",
        {"damping": "N*s/m", "pocket": "m", "rate": "m/s"},
        {"pressed": LawState("m", "v - rate*(pressed/pocket)^3")},
    ),
    # spring and damper in series, relaxation = damping/stiffness
    "maxwell_bushing": Law("pull", {"stiffness": "N/m", "relaxation": "s"}, {"pull": LawState("N", "stiffness*v - pull/relaxation")}),
    # what a bushing of rubber pulls more than its linear one when it is stretched far
    "hardening_bushing": Law(
        "cubic*stretch^3", {"cubic": "N/m^3", "relaxation": "s"}, {"stretch": LawState("m", "v - stretch/relaxation")}
    ),
    # a mass that hangs on the first end by spring and damper; the second end is ground
    "absorber": Law(
        "stiffness*(s - position) + cubic*(s - position)^3 + damping*(v - rate)",
        {"mass": "kg", "stiffness": "N/m", "cubic": "N/m^3", "damping": "N*s/m"},
        {
            "position": LawState("m", "rate"),
            "rate": LawState("m/s", "(stiffness*(s - position) + cubic*(s - position)^3 + damping*(v - rate))/mass"),
        },
    ),
    # the same by its frequency and damping ratio: no mass is none
    "tuned_mass": Law(
        "mass*(omega^2*(s - position) + 2*loss*omega*(v - rate))",
        {"mass": "kg", "omega": "1/s", "loss": "1"},
        {"position": LawState("m", "rate"), "rate": LawState("m/s", "omega^2*(s - position) + 2*loss*omega*(v - rate)")},
    ),
}
