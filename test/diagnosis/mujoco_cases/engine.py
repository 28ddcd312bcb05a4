# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
MuJoCo as an integrator of one plant: rows of a recording at SAMPLE, steps of a fixed size between them, Runge-Kutta of order 4.

MuJoCo lives in build/mujoco (`test/setup.sh mujoco`), apart from what penode needs; without it `installed()` is None.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

HOME = Path(__file__).resolve().parents[3] / "build" / "mujoco"
REMEDY = "no MuJoCo in build/mujoco: test/setup.sh mujoco (make campaign-mujoco does it)"
SAMPLE = 0.002  # s between the rows of a recording
STEP = 2e-4  # s, of the recordings: 50 us from one evaluation to the next
COARSE = 1e-3  # s, of fits
# Friction is a constraint of MuJoCo: below its level it brakes to rest within FRICTION_TIME / 2, whatever load acts, but for 1e-4 of it.
FRICTION_TIME = 0.002
FRICTION = f'solreffriction="{FRICTION_TIME:g} 1" solimpfriction="0.9999 0.9999 0.01"'
LEAST = 1e-9  # friction where there is none: its constraint has to be there
STOP_IMPEDANCE = 0.001  # share of the other forces that a stop takes away; the rest acts beside its spring and damper


def installed() -> ModuleType | None:
    """The module, None where it is not installed."""
    os.environ.setdefault("MUJOCO_GL", "disable")
    if (HOME / "mujoco").is_dir() and str(HOME) not in sys.path:
        sys.path.append(str(HOME))
    try:
        module = importlib.import_module("mujoco")
    except ImportError:
        return None
    module.set_mju_user_warning(lambda text: None)  # else it writes a log into the working directory; `run` looks at the counts
    return module


class Unstable(ArithmeticError):
    """A simulation that left the finite numbers, or the range that its plant is meant for."""


@dataclass(frozen=True)
class Friction:
    """A friction level that is set in every step: of a joint or tendon, from its position and the force that its load measure has."""

    of: str  # "joint:NAME" or "tendon:NAME"
    level: Callable[[float, float], float]  # position, load -> N or N*m


@dataclass
class Job:
    """One plant as MuJoCo takes it, without option and compiler."""

    world: str
    tendons: str = ""
    actuators: str = ""
    sensors: str = ""
    gravity: float = 0.0
    friction: Friction | None = None
    load: str = ""  # "actuator:NAME" or "tendon:NAME", what `friction` sees as load: an actuator's force, a tendon's spring
    late: float = 0.0  # s by which the command acts late, switched within steps by shares: for fits, MuJoCo's own delay goes by whole steps
    start: dict[str, float] = field(default_factory=dict)  # joint: position

    def text(self, step: float) -> str:
        """The MJCF file."""
        return (
            '<mujoco><compiler angle="radian" autolimits="true" boundmass="0"/>'
            f'<option gravity="0 0 {-self.gravity:g}" timestep="{step:.12g}" integrator="RK4"><flag contact="disable"/></option>'
            f"<worldbody>{self.world}</worldbody><tendon>{self.tendons}</tendon>"
            f"<actuator>{self.actuators}</actuator><sensor>{self.sensors}</sensor></mujoco>"
        )


@dataclass(frozen=True)
class Run:
    """Rows at SAMPLE: commands [n], sensors [n, sensors], positions and rates of all joints [n, joints]."""

    u: Array
    y: Array
    q: Array
    v: Array


Command = Callable[[int, Array, Array], float]  # row, positions, rates -> what the controller sends
Reach = Callable[[float], float]  # command of this row, memory of earlier ones -> input of the actuator


def _level_setter(model: Any, data: Any, job: Job) -> Callable[[], None]:
    """What sets the friction before a step."""
    if job.friction is None:
        return lambda: None
    kind, name = job.friction.of.split(":")
    joint = kind == "joint"
    index = model.joint(name).dofadr[0] if joint else model.tendon(name).id
    place = model.dof_frictionloss if joint else model.tendon_frictionloss
    x, v = (data.qpos, data.qvel) if joint else (data.ten_length, data.ten_velocity)
    level, ahead = job.friction.level, float(model.opt.timestep) / 2  # s: the level is that of the middle of the step
    load, at = job.load.split(":") if job.load else ("", "")
    number = model.actuator(at).id if load == "actuator" else model.tendon(at).id if load else 0

    def set_level() -> None:
        force = data.actuator_force[number] if load == "actuator" else _spring(model, data, number, ahead) if load else 0.0
        place[index] = max(level(float(x[index] + ahead * v[index]), float(force)), LEAST)

    return set_level


def _spring(model: Any, data: Any, t: int, ahead: float) -> float:
    """Force of a tendon's spring and damper, so many seconds ahead."""
    length = data.ten_length[t] + ahead * data.ten_velocity[t]
    return float(model.tendon_stiffness[t] * length + model.tendon_damping[t] * data.ten_velocity[t])


def _within(took: Array, inner: int, late: float, line: bool) -> Array | None:
    """Commands in the steps of rows [rows, inner], None where they are held: of a line at mid-step, of a late one the mean of a step."""
    if line:
        then = np.append(took[1:], took[-1])
        return np.asarray(took[:, None] + (then - took)[:, None] * (np.arange(inner) + 0.5) / inner)
    if late:
        whole, rest = divmod(late / SAMPLE, 1.0)
        before = np.concatenate([np.zeros(int(whole) + 1), took])
        share = np.clip(rest * inner - np.arange(inner), 0.0, 1.0)  # of each step, before the change
        return np.asarray(before[: len(took), None] * share + before[1 : len(took) + 1, None] * (1 - share))
    return None


def run(job: Job, rows: int, step: float, command: Command | Array | None, reach: Reach = float, line: bool = False) -> Run:
    """
    Simulate rows * SAMPLE seconds in steps of `step`.

    `command`: a controller, or what was sent [rows], or None for a plant without input; `reach` makes of it what the actuator takes.
    `line`: the command is a road, a line between its rows, and a second actuator gets its rate; else it is held, and a sensor at a row sees
    what is sent there. Raises Unstable.
    """
    mujoco = installed()
    assert mujoco is not None, REMEDY
    model = mujoco.MjModel.from_xml_string(job.text(step))
    data = mujoco.MjData(model)
    for name, x in job.start.items():
        data.joint(name).qpos[0] = x
    inner, given = round(SAMPLE / step), not callable(command)
    sent = np.array(command, float) if given and command is not None else np.zeros(rows)
    took = np.array([reach(u) for u in sent]) if given else np.zeros(rows)
    within = _within(took, inner, job.late, line)
    slope = np.append(np.diff(took), 0.0) / SAMPLE
    y, q, v = np.zeros((rows, model.nsensordata)), np.zeros((rows, model.nq)), np.zeros((rows, model.nv))
    set_level = _level_setter(model, data, job)
    for k in range(rows):
        if callable(command):
            sent[k] = command(k, data.qpos, data.qvel)
            took[k] = reach(sent[k])
        if model.nu:
            data.ctrl[0] = within[k, 0] if within is not None and not line else took[k]
        if model.nu > 1:
            data.ctrl[1] = slope[k]
        set_level()
        mujoco.mj_forward(model, data)
        y[k], q[k], v[k] = data.sensordata, data.qpos, data.qvel
        if within is None and job.friction is None:
            mujoco.mj_step(model, data, inner)
            continue
        for i in range(inner):
            if within is not None:
                data.ctrl[0] = within[k, i]
            set_level()
            mujoco.mj_step(model, data)
    warned = mujoco.mjtWarning
    if not np.isfinite(y).all() or any(
        data.warning[w].number for w in (warned.mjWARN_BADQACC, warned.mjWARN_BADQVEL, warned.mjWARN_BADQPOS)
    ):
        raise Unstable
    return Run(sent, y, q, v)


def passive(
    spring: Sequence[float], damper: Sequence[float], friction: float | None, stop: tuple[float, float, float] | None, inertia: float
) -> str:
    """
    Attributes of a joint or tendon.

    `spring`, `damper`: coefficients of x, x abs(x) (spring: x^2), x^3; `stop`: side, gap, stiffness; `inertia`: what the place feels.
    """
    out = f'stiffness="{_list(spring)}" damping="{_list(damper)}"'
    if friction is not None:
        out += f' frictionloss="{max(friction, LEAST):.15g}" {FRICTION}'
    if stop is not None:
        side, gap, stiffness = stop
        far = 1e3  # never reached
        low, high = (-far, gap) if side > 0 else (-gap, far)
        rate = 0.1 * np.sqrt(stiffness / inertia)  # 5 % of critical damping in contact
        d = STOP_IMPEDANCE
        out += f' range="{low:.15g} {high:.15g}" solreflimit="{-stiffness / inertia:.15g} {-rate:.15g}" solimplimit="{d:g} {d:g} 0.01"'
    return out


def _list(x: Sequence[float]) -> str:
    return " ".join(f"{a:.15g}" for a in x)
