# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Inputs that differ from the excitation of the plant, and sensors that differ from its motion."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from ..result import Cause, Value
from ..study.fit import Series
from . import values as of_values
from .actuators import ACTUATORS, Drive
from .form import Form, Sizes

Array = NDArray[np.float64]
INPUTS = (*ACTUATORS, "input_hold")
SENSORS = ("sensor_scale", "sensor_delay")
OFFSET = "input_offset"
FORCES = ("N", "N*m")
KINDS = (*INPUTS, *SENSORS)
MEANING = {
    "input_gain": "The input that drives the plant is larger, or smaller, than its recording by a factor.",
    "input_offset": "A constant acts on top of the recorded input.",
    "input_delay": "The input acts later than recorded.",
    "input_drift": "The input acts later and later, or earlier and earlier, than recorded: its clock is not that of the sensors.",
    "input_lag": "The input acts with a lag: an actuator that the model does not have.",
    "input_hold": "The input acts in steps: its controller is slower than the recorder and holds the value in between.",
    "input_dead_zone": "Inputs below a width have no effect; of larger ones the part beyond it drives the plant.",
    "input_saturation": "The actuator gives no more than a limit, whatever the recorded input asks for.",
    "input_slew_limit": "The actuator follows the recorded input at a limited rate.",
    "sensor_scale": "The sensor reads too much, or too little, by a factor.",
    "sensor_delay": "The sensor reads with a delay, or with a lag.",
}
RIVALS = {
    ("sensor_scale", "wrong_parameter"): "record acceleration and deflection of other parts too, or weigh a body",
    ("input_delay", "sensor_delay"): "measure with a second sensor of another make: if the input is late, both are",
    ("input_drift", "input_delay"): "compare the start and the end of a recording: a delay stays, a drift grows",
    ("input_gain", "sensor_scale"): "measure the force of the actuator, or show the sensor a known size",
    (
        "input_dead_zone",
        "coulomb_friction",
    ): "let it coast, or drive it through zero while it moves: friction brakes it there, a dead zone does not",
    ("input_saturation", "input_gain"): "small inputs as well as large ones",
    ("input_slew_limit", "input_lag"): "steps of two sizes: a lag takes the same time for both",
    ("sensor_delay", "sensor_scale"): "excitation up to higher frequencies: a delay turns the phase, a scale does not",
    (
        "input_gain",
        "wrong_parameter",
    ): "weigh a body, or measure the force of the actuator: motion alone shows only ratios of force to mass",
}

PARAMETERS = {
    "input_gain": {"gain": "acting over recorded input"},
    "input_offset": {"offset": "acting minus recorded input"},
    "input_delay": {"delay": "from the recording to the effect"},
    "input_drift": {"drift": "delay that each second of a recording adds; above zero where the clock of the input runs slow"},
    "input_lag": {"lag": "time constant of a first-order lag"},
    "input_hold": {"period": "time between two steps of the input"},
    "input_dead_zone": {"width": "magnitude below which the input has no effect"},
    "input_saturation": {"limit": "largest magnitude of the acting input"},
    "input_slew_limit": {"rate": "largest rate of the acting input"},
    "sensor_scale": {"scale": "reading over true value"},
    "sensor_delay": {"delay": "from the motion to the reading; of a sensor that lags, its time constant"},
}
ALIKE = {"input_delay": "sensor_delay", "sensor_delay": "input_delay", "input_gain": "sensor_scale", "sensor_scale": "input_gain"}
ALIKE |= {"input_lag": "sensor_delay", "input_sign": "sensor_sign", "sensor_sign": "input_sign"}


def alike(model: Model, kind: str, where: str) -> tuple[str, str] | None:
    """The kind and place that does the same as what is wrong with the only input, or the only sensor, of a model that does not change: a
    delay of one is a delay of the other; so is a gain where nothing is bent."""
    if kind not in ALIKE or len(model.inputs) != 1 or len(model.sensors) != 1:
        return None
    return ALIKE[kind], (model.sensors if kind.startswith("input_") else model.inputs)[0].name


def inputs(model: Model, count: int) -> Iterable[Form]:
    """Forms of the first `count` inputs whose effect is proportional to their value: others are compared at several values, see `bent`.
    That of a hold is for `holding`, which has to look for its period."""
    for j, i in enumerate(model.inputs[:count]):
        for kind, actuator in ACTUATORS.items():
            if actuator.small:
                yield Form(kind, i.name, kind, j)


def bent(model: Model, index: int, drive: Drive) -> Iterable[Form]:
    """Forms of an input at all values that are tried; of a position that elements act on none that cuts off, as no actuator can."""
    own = model.inputs[index].name
    position = any(own in e.ends for e in model.elements)
    for kind, actuator in ACTUATORS.items():
        for value in actuator.tried(drive) if actuator.tried and (actuator.small or not position) else ():
            yield Form(kind, own, kind, index, limit=value)


def hold(model: Model, index: int, added: Series) -> Form:
    """The form of an input that is held, by what that adds to it."""
    return Form("input_hold", model.inputs[index].name, "input_added", index, series=added)


def is_constant(form: Form) -> bool:
    """Does it add the same to an input at all times?"""
    return form.how in ACTUATORS and ACTUATORS[form.how].constant


def is_late(form: Form) -> bool:
    """Does an input come later by a fixed time?"""
    return form.how in ACTUATORS and ACTUATORS[form.how].late


def sensors(model: Model, count: int) -> Iterable[Form]:
    """Forms of the first `count` sensors: effects that no force in any place has."""
    for j, s in enumerate(model.sensors[:count]):
        yield Form("sensor_scale", s.name, "scale", j)
        if count > 1 or model.inputs:  # there is something to be late against
            yield Form("sensor_delay", s.name, "late", j)
            yield Form("sensor_delay", s.name, "lag", j, note="as a lag")


def plain(model: Model, sensor: str, time: Array, z: Array) -> dict[str, Array]:
    """By kind of sensor fault in an extended model: the signal [n] of the sensor without that fault at `time` [n], z
    [n] being what it shows."""
    bias, gain, delay = (model.parameters.get(f"{key}_{sensor}") for key in ("bias", "gain", "delay"))
    found = {"sensor_bias": z - bias.value} if bias else {}
    found |= {"sensor_scale": z / gain.value} if gain and not bias else {}
    return found | ({"sensor_delay": np.interp(time + delay.value, time, z)} if delay else {})


def sizes(form: Form, v: Sizes, unit: str) -> dict[str, tuple[str, float]]:
    """What a report gives of a form; `unit` of its input or sensor."""
    if form.how in ACTUATORS:
        actuator = ACTUATORS[form.how]
        return {actuator.size[0]: (of_input(actuator.size[1], unit), actuator.shown(v.alone))}
    match form.how:
        case "input_added":
            return {"period": ("s", form.series.period)} if form.series else {}
        case "clip":
            return {"limit": (unit, v.alone)}
        case "scale":
            return {"scale": ("1", v.alone)}
    return {"delay": ("s", v.alone)}


def of_input(unit: str, own: str) -> str:
    """A unit of ACTUATORS for an input in `own` units."""
    return own + unit if unit in ("", "/s") else unit


def common_gain(model: Model, fitted: Mapping[str, Value], limits: Mapping[str, float]) -> Cause | None:
    """The gain of the only input, a force, that does what the parameters in `fitted` do together: all masses among them, and two or more
    beyond their relative `limits`, but by one factor, beside which none is. Sensors of motion show forces over masses only."""
    forces = [i for i in model.inputs if units.si(i.unit) in FORCES]
    seen = [s.name for s in model.sensors if units.si(s.unit) in FORCES]
    own = {n: v for n, v in fitted.items() if any(u in v.unit for u in ("N", "kg"))}
    nominal = {n: model.parameters[n].value for n in own}
    off = [n for n, v in own.items() if of_values.is_off(*v.ci95, nominal[n], limits[n])]
    if len(model.inputs) != 1 or not forces or seen or len(off) <= 1 or not {b.mass for b in model.bodies} <= own.keys():
        return None
    low, high = (np.array([own[n].ci95[k] / nominal[n] for n in off]) for k in (0, 1))
    weights = 1.0 / np.maximum(high - low, 1e-300) ** 2
    factor = float(np.sum(weights * 0.5 * (low + high)) / np.sum(weights))
    if factor <= 0.0 or any(of_values.is_off(*v.ci95, factor * nominal[n], limits[n]) for n, v in own.items()):
        return None
    gain = Value(1.0 / factor, "1", (1.0 / float(np.max(high)), 1.0 / float(np.min(low))))  # what a model leaves out moves each another way
    return Cause("input_gain", forces[0].name, {"gain": gain}, 1.0, tuple(of_values.named(n) for n in off[:3]))
