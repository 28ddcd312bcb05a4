# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Broken model files: one line for each fault, with file, line and remedy; nothing but ModelError, whatever the file says."""

from __future__ import annotations

import itertools
import json
import re
import sys
from pathlib import Path

import models
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import penode_gen
from penode_gen import units
from penode_gen.algebra import expressions

GOOD = """[model]
name = "good"
description = "mass on a moving foot"
sample_time = "1 ms"
method = "rk4"
substeps = 2
input = "linear"
outside = "fade"
fade_width = 0.5

[parameters]
m = { value = 2, unit = "kg", tunable = true }
k = { value = 0.05, unit = "N/mm" }
tau = { value = 50, unit = "ms", tolerance = 0.1 }

[inputs]
F = { unit = "N", min = -5, max = 5, noise = 0.1 }
z = { unit = "m" }

[bodies]
mass = { mass = "m", position = "q", velocity = "w", start_position = "10 mm" }

[elements]
foot = { between = ["mass", "z"], law = "linear_spring", stiffness = "k" }
damp = { between = ["mass", "z"], law = "linear_damper", damping = "3 N*s/m" }
net = { between = ["mass", "ground"], law = "network", network = "net2", inputs = ["deflection", "rate"] }
push = { between = ["mass", "ground"], law = "expression", force = "F_lag - F" }

[states]
F_lag = { unit = "N", start = 0.5 }

[variables]
g = { unit = "N" }

[equations]
lag = "der(F_lag)*tau = g - F_lag"
loop = "2*g - F = 0.5*g + 0.3*F_foot"

[networks]
net2 = { inputs = ["m", "m/s"], output = "N" }

[outputs]
q = { value = "q", unit = "mm" }
a = { value = "der(w)", unit = "m/s^2" }

[sensors]
load = { value = "F_foot", unit = "N", noise = 0.1 }

[sets.default]
net2 = "net2.json"

[sets.heavy]
m = "4 kg"
"""


def at(text: str) -> dict[str, str]:
    """The first line to be reported holds this text; else it is the line of the edit."""
    return {"at": text}


# What stands in the good file, what stands there instead, and a text for each line that is reported, in which " .. " stands
# for any words; further pairs are further edits.
FAULTS = [
    # keys and sections
    ("method =", "metod =", "model.metod: unknown key; did you mean 'method'?"),
    ("noise = 0.1 }\nz", "nois = 0.1 }\nz", "inputs.F.nois: unknown key; did you mean 'noise'?"),
    ("[sensors]", "[sensor]", "sensor: unknown section; did you mean [sensors]?"),
    ("[sensors]", "[[sensors]]", "sensors: is not a table"),
    ("[elements]", "[[elements]]", "elements: is not a table"),
    ("[equations]", "[[equations]]", "equations: is not a table"),
    ("[sets.heavy]", "[[sets.heavy]]", "sets.heavy: is not a table"),
    ('foot = { between = ["mass", "z"], law = "linear_spring", stiffness = "k" }', "foot = 3", "elements.foot: is not a table"),
    ('z = { unit = "m" }', 'z = "m"', "inputs.z: is not a table"),
    ('name = "good"\n', "\n", "model: 'name' is missing", at("[model]")),
    ('sample_time = "1 ms"\n', "\n", "model: 'sample_time' is missing", at("[model]")),
    ('{ value = 2, unit = "kg",', '{ unit = "kg",', "parameters.m: 'value' is missing"),
    ('k = { value = 0.05, unit = "N/mm" }', "k = { value = 0.05 }", "parameters.k: 'unit' is missing"),
    ('z = { unit = "m" }', "z = {}", "inputs.z: 'unit' is missing"),
    ('mass = "m", position', "position", "bodies.mass: 'mass' is missing"),
    ('mass = "m", position', 'mass = "m", inertia = "1 kg*m^2", position', "bodies.mass: has both a mass and an inertia"),
    (', stiffness = "k"', "", "elements.foot: 'stiffness' is missing"),
    ('between = ["mass", "z"], law = "linear_damper"', 'law = "linear_damper"', "elements.damp: 'between' is missing"),
    ('law = "linear_damper", ', "", "elements.damp: 'law' is missing"),
    ('network = "net2", ', "", "elements.net: 'network' is missing"),
    (', force = "F_lag - F"', "", "elements.push: 'force' is missing"),
    (', output = "N"', "", "networks.net2: 'output' is missing"),
    ('inputs = ["m", "m/s"], ', "", "networks.net2: 'inputs' is missing"),
    ('value = "q", ', "", "outputs.q: 'value' is missing"),
    ('net2 = "net2.json"', "", "sets.default: 'net2' is missing", at("[sets.default]")),
    ("[sets.default]", "[sets.other]", "sets: there is no set 'default'", at("[model]")),
    # types
    ("substeps = 2", "substeps = true", "model.substeps: True has the wrong type; give a whole number"),
    ("substeps = 2", "substeps = 2.0", "model.substeps: 2.0 has the wrong type"),
    ("substeps = 2", "substeps = 0", "model.substeps: 0 is out of range"),
    ("substeps = 2", "substeps = 1001", "model.substeps: 1001 is out of range"),
    ("substeps = 2", 'on_damage = "panic"', "model.on_damage: 'panic' is unknown; choose one of report, hold, rollback"),
    ("substeps = 2", "on_damage = true", "model.on_damage: True has the wrong type; give a text"),
    ("substeps = 2", 'on_demage = "hold"', "model.on_demage: unknown key; did you mean 'on_damage'?"),
    ("substeps = 2", 'out_of_range = "ignore"', "model.out_of_range: 'ignore' is unknown; choose one of report, clamp, hold"),
    ("substeps = 2", 'out_of_range = ["clamp"]', "model.out_of_range: .. wrong type; give a text"),
    ("substeps = 2", 'out_of_rage = "clamp"', "model.out_of_rage: unknown key; did you mean 'out_of_range'?"),
    ("substeps = 2", "trial = -1", "model.trial: -1 is out of range"),
    ("substeps = 2", "trial = 10001", "model.trial: 10001 is out of range"),
    ("substeps = 2", "trial = 1.5", "model.trial: 1.5 has the wrong type; give a whole number"),
    ('sample_time = "1 ms"', "sample_time = 1e-3", "model.sample_time: 0.001 has the wrong type; give a text"),
    ("value = 2,", 'value = "2 kg",', "parameters.m.value: '2 kg' has the wrong type; give a number"),
    ("tunable = true", "tunable = 1", "parameters.m.tunable: 1 has the wrong type; give true or false"),
    ("tunable = true", "tunable = 2020-01-01", "has the wrong type"),
    ('between = ["mass", "z"], law = "linear_spring"', 'between = "mass", law = "linear_spring"', "elements.foot.between: .. a list"),
    ('law = "linear_spring"', 'law = ["linear_spring"]', "elements.foot.law: .. wrong type; give a text"),
    ('inputs = ["deflection", "rate"]', 'inputs = [["deflection"], "rate"]', "elements.net.inputs: .. neither deflection nor rate"),
    ('inputs = ["m", "m/s"]', "inputs = [1, 2]", "networks.net2.inputs: must list the unit of each input"),
    ('net2 = "net2.json"', "net2 = 3", "sets.default.net2: 3 has the wrong type; give a text or a table"),
    ('description = "mass on a moving foot"', "description = 0x" + "f" * 5000, "a huge number has the wrong type"),
    ('description = "mass on a moving foot"', 'description = "ends here */ int x;"', "model.description: cannot be a comment in C"),
    ('description = "mass on a moving foot"', 'description = "two\\nlines"', "cannot be a comment in C"),
    # names
    ('name = "good"', 'name = "Good"', "model.name: 'Good' cannot prefix C names"),
    ('name = "good"', 'name = "good\\n"', "cannot prefix C names"),
    ('name = "good"', 'name = "stdint"', "has a meaning of its own in C"),
    ('name = "good"', 'name = "uint32"', "has a meaning of its own in C"),
    ('g = { unit = "N" }', 'while = { unit = "N" }', "variables.while: .. meaning of its own"),
    (
        'g = { unit = "N" }',
        'new = { unit = "N" }',
        "variables.new: 'new' has a meaning of its own in C++, whose programs include the header",
    ),
    ('q = { value = "q"', 'class = { value = "q"', "outputs.class: .. meaning of its own in C++"),
    ('load = { value = "F_foot"', 'xor = { value = "F_foot"', "sensors.xor: .. meaning of its own in C++"),
    ('velocity = "w"', 'velocity = "this"', "'this' has a meaning of its own in C++"),
    ("F_lag = {", '"F lag" = {', "'F lag' cannot be a name"),
    ('load = { value = "F_foot"', 'pen_load = { value = "F_foot"', "sensors.pen_load: .. meaning of its own"),
    ('load = { value = "F_foot"', 'GOOD_SET_LENGTH = { value = "F_foot"', "sensors.GOOD_SET_LENGTH: .. meaning of its own"),
    ('load = { value = "F_foot"', 'H = { value = "F_foot"', "sensors.H: .. meaning of its own"),
    ('load = { value = "F_foot"', 'load_ = { value = "F_foot"', "sensors.load_: .. cannot be a name"),
    ('load = { value = "F_foot"', 'INT8_MAX = { value = "F_foot"', "sensors.INT8_MAX: .. meaning of its own"),
    ('load = { value = "F_foot"', 'größe = { value = "F_foot"', "is not valid TOML"),
    ('load = { value = "F_foot"', '"größe" = { value = "F_foot"', "'größe' cannot be a name"),
    ('load = { value = "F_foot"', "l" * 41 + ' = { value = "F_foot"', "cannot be a name"),
    ('position = "q"', 'position = "int"', "bodies.mass.position: .. meaning of its own"),
    ('position = "q"', 'position = "exp"', "bodies.mass.position: .. meaning of its own"),
    ("push = {", '"pu*/sh" = {', "'pu*/sh' cannot be a name"),
    ('lag = "der', '"l*/ag" = "der', "'l*/ag' cannot be a name"),
    ("[sets.heavy]", '[sets."a b"]', "'a b' cannot be a name"),
    ("[sets.heavy]", "[sets.Default]", "differs from the set 'default' by case only"),
    ("tau = {", "m = {", "is not valid TOML (Cannot overwrite a value)"),
    ('g = { unit = "N" }', 'F = { unit = "N" }', "variables.F: 'F' is taken by the input of that name"),
    ('g = { unit = "N" }', 'F_foot = { unit = "N" }', "'F_foot' is taken by the variable of that name", at("foot =")),
    ('velocity = "w"', 'velocity = "q"', "bodies.mass.velocity: 'q' is taken by the position of that name"),
    ("F_lag = {", "z = {", "'z' is taken by the input of that name"),
    (
        "[elements]",
        '[bodies.F]\nmass = "1 kg"\nposition = "q2"\nvelocity = "w2"\n[elements]',
        "'F' is taken by the body of that name",
        at("F = {"),
    ),
    ("tau = {", 'K = { value = 1, unit = "1" }\ntau = {', "parameters.K: its C constant GOOD_K is already taken by that of 'k'; rename it"),
    ("tau = {", 'k_inverse = { value = 1, unit = "1" }\ntau = {', "parameters.k_inverse: its C constant GOOD_K_INVERSE"),
    ("tau = {", 'set_length = { value = 1, unit = "1" }\ntau = {', "GOOD_SET_LENGTH is already taken"),
    ("tau = {", 'scrub = { value = 1, unit = "1" }\ntau = {', "GOOD_SCRUB is already taken"),
    ("tau = {", 'pieces = { value = 1, unit = "1" }\ntau = {', "GOOD_PIECES is already taken"),
    ("tau = {", 'damp_damping = { value = 1, unit = "1" }\ntau = {', "'damp_damping', which there is already", at("damp =")),
    ('load = { value = "F_foot"', 'q = { value = "F_foot"', "sensors.q: 'q' is already the name of another quantity"),
    ('load = { value = "F_foot"', 'z = { value = "2*z"', "sensors.z: 'z' is already the name of another quantity"),
    # units
    ('unit = "N/mm"', 'unit = "N/mn"', "parameters.k: unknown unit 'N/mn'; write it like"),
    ('unit = "N/mm"', 'unit = "Ohm"', "parameters.k: unknown unit 'Ohm'; write 'ohm'"),
    ('unit = "N/mm"', 'unit = "Nm/RPM"', "parameters.k: unknown unit 'Nm/RPM'; write 'N*m/rpm'"),
    ('unit = "N/mm"', 'unit = "1/kNm"', "parameters.k: unknown unit '1/kNm'; write '1/(kN*m)'"),
    ('unit = "N/mm"', 'unit = "J/°C"', "parameters.k: unknown unit 'J/°C'; write 'J/K'"),
    ('damping = "3 N*s/m"', 'damping = "3 Nm"', "elements.damp.damping: unknown unit 'Nm'; write 'N*m'"),
    ('unit = "N/mm"', 'unit = "N/mm^9^9^9^9"', "unknown unit"),
    ('unit = "N/mm"', 'unit = "N/mm; import os"', "unknown unit"),
    ('unit = "N/mm"', 'unit = "3 N/mm"', "unknown unit"),
    ('unit = "N/mm"', 'unit = "N*s/mm"', "elements.foot.stiffness: 'k' is in N*s/mm, needed is N/m", at("foot =")),
    (
        'unit = "kg"',
        'unit = "g*m"',
        "bodies.mass.mass: 'm' is in g*m, needed is kg",
        at("mass ="),
        "sets.heavy.m: '4 kg' is not measured in g*m",
    ),
    ('damping = "3 N*s/m"', 'damping = "3 N/m"', "elements.damp.damping: '3 N/m' is not measured in N*s/m"),
    ('damping = "3 N*s/m"', 'damping = "3"', "'3' is not measured in N*s/m"),
    ('damping = "3 N*s/m"', 'damping = "three N*s/m"', "'three N*s/m' is not a number with a unit"),
    ('damping = "3 N*s/m"', 'damping = "nan N*s/m"', "is not a number with a unit"),
    ('sample_time = "1 ms"', 'sample_time = "1 mm"', "model.sample_time: '1 mm' is not measured in s"),
    ('start_position = "10 mm"', 'start_position = "10 mm/s"', "bodies.mass.start_position: '10 mm/s' is not measured in m"),
    (
        'z = { unit = "m" }',
        'z = { unit = "kg" }',
        "elements.foot.between: input 'z' is in kg, an end needs a position",
        at("foot ="),
        "elements.damp.between: input 'z' is in kg",
    ),
    (
        'F_lag = { unit = "N"',
        'F_lag = { unit = "Pa"',
        "elements.push: .. combines m^-1*kg*s^-2 with m*kg*s^-2",
        at("push ="),
        "equations.lag: .. combines",
    ),
    (
        'tau = { value = 50, unit = "ms"',
        'tau = { value = 50, unit = "mm"',
        "equations.lag: the two sides have different units, m^2*kg*s^-3 and m*kg*s^-2",
        at("lag ="),
    ),
    ('inputs = ["m", "m/s"]', 'inputs = ["m", "N"]', "elements.net.inputs: the network takes N, but rate is in m/s", at("net =")),
    ('inputs = ["m", "m/s"]', 'inputs = ["mm", "m/s"]', "networks.net2: a network in mm .. declare m"),
    (
        'inputs = ["m", "m/s"], output = "N"',
        'inputs = ["m", "m/s"], output = "m"',
        "network 'net2' gives m, an element needs a force",
        at("net ="),
    ),
    ('value = "q", unit = "mm"', 'value = "q", unit = "mm/s"', "outputs.q: the two sides have different units, m*s^-1 and m"),
    ('value = "F_foot", unit = "N"', 'value = "q + 1", unit = "m"', "sensors.load: 'q + 1' combines"),
    ('value = "F_foot", unit = "N"', 'value = "exp(F_foot)", unit = "1"', "the argument has the unit m*kg*s^-2"),
    ('value = "F_foot", unit = "N"', 'value = "where(F > q, F, F_foot)", unit = "N"', "combines"),
    ('F_lag = { unit = "N"', 'F_lag = { unit = "degC"', "states.F_lag: unit 'degC' has an offset; use kelvin .. write"),
    # numbers
    ("value = 2,", "value = 0,", "bodies.mass: mass 'm' is not above zero", at("mass =")),
    ("value = 2,", "value = -2,", "bodies.mass: mass 'm' is not above zero", at("mass =")),
    ('mass = "m"', 'mass = "-2 kg"', "bodies.mass: mass '-2 kg' is not above zero", ('m = "4 kg"', "")),
    ('m = "4 kg"', 'm = "0 kg"', "sets.heavy.m: mass '0 kg' is not above zero"),
    ('m = "4 kg"', 'm = "4 m"', "sets.heavy.m: '4 m' is not measured in kg"),
    ('m = "4 kg"', 'm = "1e39 kg"', "sets.heavy.m: '1e39 kg' is not a number that a float can hold"),
    ("value = 0.05,", "value = nan,", "parameters.k.value: nan is not a number that a float can hold"),
    ("value = 0.05,", "value = inf,", "inf is not a number that a float can hold"),
    ("value = 0.05,", "value = 1e36,", "1e+36 is not a number that a float can hold"),  # 1e39 N/m
    ("value = 0.05,", "value = 1e-42,", "1e-42 is not a number that a float can hold"),
    ("value = 0.05,", f"value = {10**400},", "is not a number that a float can hold"),
    ("value = 0.05,", f"value = 1{'0' * 5000},", "is not valid TOML (a number", at('m = "4 kg')),
    ("value = 50,", "value = 0,", "divides by 'tau', which is zero", at("lag =")),
    ("tolerance = 0.1", "tolerance = -0.1", "tau.tolerance: tolerance -0.1 is below zero"),
    ("tolerance = 0.1", 'tolerance = "unkown"', "tau.tolerance: 'unkown' is not a tolerance; give a share .. or \"unknown\""),
    ("tolerance = 0.1", "tolerance = 0.1, exact = true", "tau: is exact and has a tolerance of 0.1"),
    ("start = 0.5", "start = 1e39", "states.F_lag.start: 1e+39 is not a number that a float can hold"),
    ('start_position = "10 mm"', 'start_position = "1e999 m"', "'1e999 m' is not a number that a float can hold"),
    ("min = -5", "min = 5", "inputs.F: min is not below max"),
    ("min = -5", "min = nan", "inputs.F.min: nan is not a number"),
    ("noise = 0.1 }\nz", "noise = -1 }\nz", "inputs.F.noise: -1 is below zero"),
    ('sample_time = "1 ms"', 'sample_time = "0 s"', "model.sample_time: 0 s is out of range"),
    ('sample_time = "1 ms"', 'sample_time = "-1 ms"', "model.sample_time: -1 ms is out of range"),
    ('sample_time = "1 ms"', 'sample_time = "3 years"', "model.sample_time: 3 years is out of range"),
    ('sample_time = "1 ms"', 'sample_time = "1e-30 s"', "model.sample_time: 1e-30 s is out of range"),
    ("fade_width = 0.5", "fade_width = 0", "model.fade_width: is out of range"),
    ("fade_width = 0.5", "fade_width = nan", "model.fade_width: is out of range"),
    ('method = "rk4"', 'method = "rk5"', "model.method: 'rk5' is unknown; choose one of euler, heun"),
    ('input = "linear"', 'input = "quintic"', "model.input: 'quintic' is unknown"),
    ('outside = "fade"', 'outside = "explode"', "model.outside: 'explode' is unknown"),
    # elements and networks
    ('law = "linear_damper"', 'law = "linear_dampr"', "elements.damp.law: law 'linear_dampr' is unknown; did you mean 'linear_damper'?"),
    ('stiffness = "k"', 'stiffnes = "k"', "unknown key; did you mean 'stiffness'?", "'stiffness' is missing"),
    ('stiffness = "k"', 'stiffness = "kk"', "'kk' is not a parameter; did you mean 'k'?"),
    (
        '["mass", "z"], law = "linear_spring"',
        '["mess", "z"], law = "linear_spring"',
        "end 'mess' is no body, point, input or ground; did you mean 'mass'?",
    ),
    ('["mass", "z"], law = "linear_spring"', '["mass", "mass"], law = "linear_spring"', "does not name two different ends"),
    ('["mass", "z"], law = "linear_spring"', '["mass"], law = "linear_spring"', "does not name two different ends"),
    ('network = "net2"', 'network = "net3"', "network 'net3' is not declared; did you mean 'net2'?"),
    ('inputs = ["deflection", "rate"]', 'inputs = ["deflection"]', "elements.net.inputs: 1 inputs for a network of 2"),
    ('inputs = ["deflection", "rate"]', 'inputs = ["position", "rate"]', "'position' is neither deflection nor rate"),
    ('net2 = "net2.json"', 'net2 = "net3.json"', "sets.default.net2: .. net3.json: No such file or directory"),
    ('net2 = "net2.json"', 'net2 = "net\\u00002.json"', "sets.default.net2: .. embedded null byte"),
    ('net2 = "net2.json"', 'net2 = "net2.h5"', "unknown suffix '.h5'"),
    ('net2 = "net2.json"', 'net2 = "broken.json"', "not JSON that can be read"),
    ('net2 = "net2.json"', 'net2 = "broken.onnx"', "sets.default.net2: .. broken.onnx"),
    ('net2 = "net2.json"', 'net2 = "one.json"', "one.json has 1 input(s) and 1 output(s), declared are 2 and 1"),
    ('net2 = "net2.json"', 'net2 = "large.json"', "large.json has a number that a float cannot hold"),
    ('net2 = "net2.json"', 'net2 = { file = "net2.json", min = [0] , max = [1] }', "needs 2 minima and maxima, has 1 and 1"),
    ('net2 = "net2.json"', 'net2 = { file = "net2.json", min = ["a", "b"] }', "sets.default.net2.min: is not a list of numbers"),
    ('net2 = "net2.json"', 'net2 = { file = "net2.json", min = [0, nan] }', "sets.default.net2.min: is not a list of numbers"),
    ('net2 = "net2.json"', 'net2 = { file = "net2.json", min = [1, 1], max = [1.00000001, 2] }', "narrower than a float can tell"),
    ('net2 = "net2.json"', 'net2 = { fil = "net2.json" }', "unknown key; did you mean 'file'?", "'file' is missing"),
    ('m = "4 kg"', 'net2 = "wide.json"', "sets.heavy.net2: has another architecture than in the set 'default'"),
    ('m = "4 kg"', 'net3 = "wide.json"', "sets.heavy.net3: unknown key; did you mean 'net2'?"),
    ('m = "4 kg"', 'k = "4 N/m"', "sets.heavy.k: unknown key"),
    # equations
    ('lag = "der(F_lag)*tau = g - F_lag"', 'lag = "der(F_lag)*tau - g + F_lag"', "equations.lag: is not one equation"),
    ('lag = "der(F_lag)*tau = g - F_lag"', 'lag = "der(F_lag)*tau = g = F_lag"', "equations.lag: is not one equation"),
    ('lag = "der(F_lag)*tau = g - F_lag"', 'lag = "der(F_lag)*tau == g - F_lag"', "equations.lag: is not one equation"),
    ('lag = "der(F_lag)*tau = g - F_lag"', "lag = 3", "equations.lag: is not one equation"),
    ("g - F_lag", "g - F_leg", "equations.lag: 'g - F_leg' uses 'F_leg'"),
    ("g - F_lag", "g - F_lag)", "cannot be read as an expression (unmatched ')')"),
    ("g - F_lag", "cosh(g) - F_lag", "calls 'cosh'; known are abs"),
    ("g - F_lag", "max(g) - F_lag", "max with 1 argument(s); it takes 2"),
    ("g - F_lag", "net2(q) - F_lag", "net2 with 1 argument(s); it takes 2"),
    ("g - F_lag", "g - F_lag^0.5", "has the power '0.5'; whole powers up to 8"),
    ("g - F_lag", "g - F_lag^q", "has the power 'q'"),
    ("g - F_lag", "g - 9^9^9^9*F_lag", "whole powers up to 8"),
    ("g - F_lag", "g - 1e99*F_lag", "number that a float cannot hold"),
    ("g - F_lag", "g - F_lag/0", "divides by zero"),
    ("g - F_lag", "__import__('os').system('true')", "is not part of an expression"),
    ("g - F_lag", "__import__('os')", "calls '__import__'; known are"),
    ("g - F_lag", "g.real", "contains 'g.real', which is not part of an expression"),
    ("g - F_lag", "(lambda: g)()", "is not part of an expression"),
    ("g - F_lag", "'g'", "contains ''g'', which is not part of an expression"),
    ("g - F_lag", "[g for g in (1, 2)]", "is not part of an expression"),
    ("g - F_lag", "where(0 < g < 1, g, F)", "has a 'where' that is not where(a < b, x, y)"),
    ("g - F_lag", "g if g else F", "is not part of an expression"),
    ("g - F_lag", "g - True", "contains 'True'"),
    ("g - F_lag", "1j*g", "contains '1j'"),
    ("g - F_lag", "(" * 300 + "g" + ")" * 300, "too many nested parentheses"),
    ("g - F_lag", "g" + "+g" * 950, "nested too deeply"),
    ("g - F_lag", "g" + "+g" * 9000, "more than 2000"),
    ("g - F_lag", "der(g) - F_lag", "uses der(g), but 'g' is neither a state nor an input"),
    ("g - F_lag", "der(m) - F_lag", "uses der(m), but 'm' is neither a state nor an input"),
    ("g - F_lag", "der(q + q) - F_lag", "has a 'der' that is not der(name)"),
    ('value = "der(w)"', 'value = "der(k)"', "outputs.a: 'der(k)' uses der(k)"),
    ('value = "der(w)"', 'value = "net2(q, w)"', "outputs.a: calls a network", ('unit = "m/s^2"', 'unit = "N"')),
    ('value = "der(w)"', 'value = "w^0.5"', "outputs.a: 'w^0.5' has the power"),
    ('input = "linear"', 'input = "held"', "model.input: the model uses the rate of an input, which is not defined for a held input"),
    ("2*g - F = 0.5*g", "2*g - F = g*g/F", "'loop' form an algebraic loop that is not linear in g"),
    ("2*g - F = 0.5*g", "2*g - F = abs(g)", "'loop' form an algebraic loop that is not linear in g"),
    ("2*g - F = 0.5*g", "2*g - F = where(g > F, 1, 2)*F", "not linear in g"),
    (
        'g = { unit = "N" }',
        'g = { unit = "N" }\nh = { unit = "N" }',
        "equations 'more', 'loop' have no unique solution for h, g; check",
        at("more ="),
        ('loop = "2*g - F = 0.5*g', 'more = "2*g + 2*h = F"\nloop = "h - F = -g'),
    ),
    (
        'g = { unit = "N" }',
        'g = { unit = "N" }\nh = { unit = "N" }',
        "variables.h: no equation determines h; add one to [equations]",
        at("h ="),
    ),
    ("loop =", 'more = "g = F"\nloop =', "equations.loop: nothing is left that this equation could determine", at("loop =")),
    ("F_lag - F", "F_lag - s", "elements.push: .. combines"),
    (
        "F_lag - F",
        "where(v < 0, F_lag, F)",
        "elements.push: 'v' is the rate of this element, and a name of the model",
        ('velocity = "w"', 'velocity = "v"'),
        ("der(w)", "der(v)"),
    ),
    # TOML
    ('name = "good"', "name = good", "is not valid TOML (Invalid value); correct the syntax there"),
    ('name = "good"', 'name = "good', "is not valid TOML"),
    ("[sets.heavy]", "[sets.heavy", "is not valid TOML"),
    ('net2 = "net2.json"', f"net2 = {'[' * 3000}", "is not valid TOML", at('m = "4 kg')),
]


def network_json(path: Path, sizes: list[int], bias: float = 0.0) -> None:
    """A network that gives its bias."""
    layers = [{"activation": "relu", "weights": [[0.0] * m] * n, "bias": [0.0] * n} for m, n in itertools.pairwise(sizes)]
    layers[-1]["bias"] = [bias] * sizes[-1]
    path.write_text(json.dumps({"layers": layers, "trained_range": {"min": [-1.0] * sizes[0], "max": [1.0] * sizes[0]}}))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("model_file")
    models.network_file(found / "net2.json", [2, 3, 1], ["tanh", "identity"], 1)
    network_json(found / "wide.json", [2, 4, 1])
    network_json(found / "one.json", [1, 4, 1])
    network_json(found / "large.json", [2, 3, 1], 1e39)
    (found / "broken.json").write_text('{"layers": [')
    (found / "broken.onnx").write_bytes(b"\x08\x01 this is no protocol buffer \xff\xff")
    return found


def problems(path: Path) -> list[str]:
    """What is wrong with a model file."""
    with pytest.raises(penode_gen.ModelError) as caught:
        penode_gen.load(path)
    assert str(caught.value) == "\n".join(caught.value.problems)
    return caught.value.problems


def test_the_good_file_is_good(folder):
    (folder / "good.toml").write_text(GOOD)
    model = penode_gen.load(folder / "good.toml")
    assert model.parameters["k"].value == 50.0 and model.parameters["tau"].value == 0.05  # N/mm and ms in SI
    assert model.start == (0.01, 0.0, 0.5) and model.sample_time == 1e-3
    assert model.sets["heavy"].parameters == {"m": 4.0} and set(model.sets["heavy"].networks) == {"net2"}


def applied(case: tuple) -> tuple[str, int, list[str]]:
    """Text, line of the first report and patterns of a case of FAULTS."""
    old, new, *rest = case
    text = GOOD
    for a, b in [(old, new), *(r for r in rest if isinstance(r, tuple))]:
        assert text.count(a) == 1, a
        text = text.replace(a, b)
    anchor = next((text.index("\n" + r["at"]) + 1 if text.index(r["at"]) else 0 for r in rest if isinstance(r, dict)), GOOD.index(old))
    return text, text.count("\n", 0, anchor) + 1, [".*".join(map(re.escape, r.split(" .. "))) for r in rest if isinstance(r, str)]


@pytest.mark.parametrize("case", FAULTS, ids=lambda c: re.sub(r"\W+", " ", f"{c[1][:40]} {c[2][:30]}"))
def test_fault(folder, case):
    text, line, patterns = applied(case)
    path = folder / "bad.toml"
    path.write_text(text, encoding="utf-8")
    found = problems(path)
    assert re.match(rf"{re.escape(str(path))}:{line}: ", found[0])
    assert all(any(re.search(pattern, problem) for problem in found) for pattern in patterns)
    assert len(found) == len(patterns)
    assert all(p.isprintable() and "; " in p and len(p) < 500 for p in found)  # one line each, with a remedy


def test_all_faults_at_once(folder):
    """Ten faults in ten places, each reported once, in any order."""
    edits = [
        ("method =", "metod ="),
        ("substeps = 2", "substeps = 0"),
        ('unit = "N/mm"', 'unit = "N/mn"'),
        ("min = -5", "min = 6"),
        ('start_position = "10 mm"', 'start_position = "10 s"'),
        ('"linear_damper"', '"linear_dumper"'),
        ("start = 0.5", "start = inf"),
        ('unit = "m/s^2"', 'unit = "m/s^^2"'),
        ('net2 = "net2.json"', 'net2 = "gone.json"'),
        ("2*g - F =", "2*g - F/0 ="),
    ]
    text = GOOD
    for old, new in edits:
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "bad.toml").write_text(text)
    found = problems(folder / "bad.toml")
    lines = sorted(int(p.removeprefix(f"{folder / 'bad.toml'}:").partition(":")[0]) for p in found)
    assert lines == sorted(GOOD[: GOOD.index(old)].count("\n") + 1 for old, _ in edits)


def test_no_outputs(folder):
    text = re.sub(
        r"\[outputs\][^[]*\n(?=\[)", "", models.BARE.format(outside="clamp", inputs="u = { unit = '1' }", units="['1']", names="u")
    )
    (folder / "net.json").write_text((folder / "one.json").read_text())
    (folder / "bad.toml").write_text(text)
    assert problems(folder / "bad.toml") == [
        f'{folder}/bad.toml:1: outputs: the model has no outputs; add [outputs], for example position = {{ value = "x", unit = "m" }}'
    ]


def test_no_states(folder):
    """A model of outputs alone is fine, and one of nothing is not."""
    (folder / "net.json").write_text((folder / "one.json").read_text())
    (folder / "bare.toml").write_text(models.BARE.format(outside="clamp", inputs="u = { unit = '1' }", units="['1']", names="u"))
    assert penode_gen.load(folder / "bare.toml").states == ()
    (folder / "bad.toml").write_text("# nothing\n")
    assert problems(folder / "bad.toml") == [f"{folder}/bad.toml:1: is empty; write a model with [model], [inputs] and [outputs]"]


def test_files_that_are_none(folder):
    (folder / "latin.toml").write_bytes(GOOD.replace("moving", "m\xf6ving").encode("latin-1"))
    (folder / "loop.toml").symlink_to("loop.toml")
    for name, words in (
        ("gone.toml", "gone.toml: cannot be read (No such file or directory); give the path of a model file"),
        ("", ": cannot be read (Is a directory); give the path"),
        ("loop.toml", "loop.toml: cannot be read ("),  # as a file that may not be read; who runs the tests may perhaps read all
        ("good.toml/x", "cannot be read (Not a directory)"),
        ("good\0.toml", "cannot be read (embedded null byte)"),
        ("latin.toml", "latin.toml:3: is not UTF-8 text"),
    ):
        found = problems(folder / name)
        assert len(found) == 1 and words in found[0] and found[0].isprintable()


def test_extends(folder):
    """An extended file changes entries of its base; files of networks stand beside the file that names them."""
    (folder / "sub").mkdir()
    (folder / "good.toml").write_text(GOOD)
    extended = folder / "sub" / "extended.toml"

    def write(body: str, head: str = "") -> Path:
        extended.write_text(f'[model]\nextends = "../good.toml"\n{head}\n{body}')
        return extended

    base = penode_gen.load(folder / "good.toml")
    model = penode_gen.load(write('[parameters]\nk = { value = 70, unit = "N/m" }', 'name = "better"'))
    assert (model.name, model.parameters["k"].value, model.sample_time) == ("better", 70.0, 1e-3)
    assert model.sets.keys() == base.sets.keys() and model.digest != base.digest
    assert base.digest == penode_gen.load(folder / "good.toml").digest
    model = penode_gen.load(write('[parameters]\ndamp_damping = { value = 4, unit = "N*s/m" }'))  # a quantity in an element, "3 N*s/m"
    assert model.parameters["damp_damping"].value == 4.0
    other = problems(write('[parameters]\ndamp_damping = { value = 4, unit = "N" }'))
    assert "good.toml:25: elements.damp.damping: this quantity would become the parameter 'damp_damping', which there is" in other[0]

    assert "extended.toml:5: parameters.k.valu" in problems(write('[parameters]\nk = { valu = 70, unit = "N/m" }'))[0]
    (folder / "good.toml").write_text(GOOD.replace("start = 0.5", "strat = 0.5"))
    found = problems(write('[parameters]\nk = { valu = 70, unit = "N/m" }'))
    assert "extended.toml:5: parameters.k.valu" in found[0] and "good.toml:30: states.F_lag.strat" in found[-1]
    (folder / "good.toml").write_text(GOOD.replace("F_lag - F", "F_lag - q"))
    assert "good.toml:27: elements.push: " in problems(write(""))[0]
    (folder / "good.toml").write_text(GOOD.replace('name = "good"', "name = good"))
    assert "good.toml:2: is not valid TOML" in problems(write(""))[0]
    for name, base in (("good", "other"), ("other", "third"), ("third", "fourth"), ("fourth", "fifth")):
        (folder / f"{name}.toml").write_text(f'[model]\nextends = "{base}.toml"\n')
    found = problems(write(""))
    assert len(found) == 1 and "third.toml:2: model.extends: " in found[0] and "at most three in a row" in found[0]
    (folder / "good.toml").unlink()
    found = problems(write(""))
    assert len(found) == 1 and "extended.toml:2: model.extends: " in found[0] and "good.toml: cannot be read (No such file" in found[0]
    (folder / "good.toml").write_text(GOOD)


LATE = GOOD.replace("start = 0.5 }", 'start = 0.5 }\nq_late = { unit = "m" }').replace(
    "loop =", 'late = "der(q_late)*tau = q - q_late"\nloop ='
)


@pytest.mark.parametrize(
    "sensor, right",
    [
        ('q = { value = "q_late", unit = "mm" }', True),  # what measures q may follow it by a state of its own
        ('q = { value = "2*q_late", unit = "mm" }', True),
        ('q_late = { value = "q", unit = "mm" }', False),  # q does not follow q_late
        ('F_lag = { value = "q_late", unit = "mm" }', False),
    ],
)
def test_a_sensor_called_as_a_state_measures_it(folder, sensor, right):
    text = LATE.replace('q = { value = "q", unit = "mm" }\n', "").replace("[sensors]\n", f"[sensors]\n{sensor}\n")
    (folder / "late.toml").write_text(text)
    if right:
        assert penode_gen.load(folder / "late.toml").sensors[0].name == "q"
        return
    with pytest.raises(penode_gen.ModelError, match="is already the name of another quantity"):
        penode_gen.load(folder / "late.toml")


def test_lines_are_found_in_any_layout(folder):
    """Keys in lists over several lines, strings that look like headers, quoted keys, dotted keys, sub-tables, CRLF."""
    text = (
        GOOD.replace('"mass on a moving foot"', '"""\\\n[parameters]\\\n"""')
        .replace(
            'm = { value = 2, unit = "kg", tunable = true }', '[parameters.m]\nvalue = 2\nunit = "kg" # [x]\ntunable = true\n[parameters]'
        )
        .replace('tau = { value = 50, unit = "ms", tolerance = 0.1 }', 'tau.value = 50\n"tau".unit = "ms"\ntau."tolerance" = -2')
    )
    text = text.replace('["m", "m/s"]', '[\n  "m",\n  "mm/s", # ]\n]')
    text = text.replace("[parameters]\n[parameters.m]", "[parameters.m]").replace("[parameters]\nk =", "[parameters]\nk =")
    for newline in ("\n", "\r\n"):
        path = folder / "layout.toml"
        path.write_bytes(text.replace("\n", newline).encode())
        found = [p.removeprefix(f"{path}:") for p in problems(path)]
        rows = text.split("\n")
        expected = [rows.index('tau."tolerance" = -2') + 1, next(i for i, r in enumerate(rows, 1) if r.startswith("net2 = { inputs"))]
        assert [int(p.partition(":")[0]) for p in found] == expected, found


def test_command_prints_errors_as_lines(folder, monkeypatch, capsys):
    """Exit code 2, a line for each problem on stderr, nothing on stdout, nothing written."""
    from penode_sil import cli

    (folder / "bad.toml").write_text(GOOD.replace("min = -5", "min = 6").replace("start = 0.5", "start = inf"))
    monkeypatch.setattr(sys, "argv", ["penode", "generate", str(folder / "bad.toml"), "-o", str(folder / "out")])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    output = capsys.readouterr()
    assert caught.value.code == 2 and output.out == "" and not (folder / "out").exists()
    assert [line.startswith(f"penode: {folder}/bad.toml:") for line in output.err.splitlines()] == [True, True]


# -- whatever a file says: a model or a ModelError --------------------------------------------------------------------

FUZZ = settings(derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))
PIECES = {  # stretches of the good file that an edit takes away, and what may come in their place
    "text": (
        r'(?<=")[^"\n]*(?=")',
        [
            "",
            "nan",
            "-1",
            "0 kg",
            "1e400 m",
            "9" * 30,
            "é",
            "der(q)",
            "der(z)",
            "where(q < z, q, z)",
            "net2(q, w)",
            "exp(1)",
            "*/",
            "x",
            "s",
            "v",
            "1/s",
            "degC",
            "\\u0000",
            "net2(net2(q, w), w)",
            "a = b",
            "g = F",
            "../x.onnx",
            ".",
        ],
    ),
    "number": (
        r"(?<= )-?\d[\d.]*(?=[ ,\n])",
        ["0", "-1", "nan", "inf", "1e400", "9" * 30, "true", "1e-50", "[]", "{}", "2020-01-01", '"1"', "1_0", "0xF"],
    ),
    "name": (
        r"(?m)^[\w]+(?= =)|(?<=, )\w+(?= =)|(?<=\{ )\w+(?= =)",
        ["x", "s", "v", "p", "t1", "int", "H", "extends", '"a b"', "a.b", "status", "F_lag_in"],
    ),
    "line": (r"(?m)^.+$", ["", "x = 1", "[x]", "[[model]]", "[model]", "[sets.x]", "{", "é = 1"]),
    "token": (r"[\w./*^-]+|\S|\n", ['"', "=", "{", "]", "\\", "\0", "\x7f", "#", "\ud800"]),
}


@st.composite
def edited(draw) -> str:
    """The good file with one to three stretches replaced, by others of their kind or by odd ones."""
    text = GOOD
    for kind in draw(st.lists(st.sampled_from(["text", "text", "number", "name", "line", "token"]), min_size=1, max_size=3)):
        pattern, odd = PIECES[kind]
        found = list(re.finditer(pattern, text))
        if found:
            old = draw(st.sampled_from(found))
            new = draw(st.one_of(st.sampled_from(odd), st.sampled_from([m[0] for m in found])))
            text = text[: old.start()] + new + text[old.end() :]
    return text


@settings(FUZZ, max_examples=200)
@given(edited())
def test_edited_files(folder, text):
    path = folder / "fuzz.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        model = penode_gen.load(path)
    except penode_gen.ModelError as error:
        assert error.problems and all(p.isprintable() and "; " in p for p in error.problems)
    else:
        penode_gen.render(model)


UNARY = [name for name, (count, _) in expressions.FUNCTIONS.items() if count == 1]
EXPRESSIONS = st.recursive(
    st.sampled_from(
        ["q", "w", "F", "z", "k", "m", "F_lag", "F_foot", "g", "0", "1", "2.5", "-3", "1e-3", "(T*der(F))", "(T*der(w))", "(T*der(q))"]
    ),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/"]), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        st.tuples(inner, st.sampled_from(["2", "3", "-1", "-2", "8"])).map(lambda t: f"({t[0]})^{t[1]}"),
        st.tuples(st.sampled_from([*UNARY, "one"]), inner).map(lambda t: f"{t[0]}({t[1]})"),
        st.tuples(st.sampled_from(["min", "max", "net2"]), inner, inner).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
        st.tuples(inner, st.sampled_from(["<", "<=", ">", ">="]), inner, inner, inner).map(
            lambda t: f"where({t[0]} {t[1]} {t[2]}, {t[3]}, {t[4]})"
        ),
    ),
    max_leaves=7,
)


@settings(FUZZ, max_examples=60)
@given(*[EXPRESSIONS] * 4, st.sampled_from(["rk4", "ros1", "ros2"]))
def test_any_expression(folder, a, b, c, d, method):
    """Equations, an output and a sensor of random expressions become C, or are refused."""
    text = f"""
[model]
name = "fuzz"
sample_time = "1 ms"
method = "{method}"
[parameters]
k = {{ value = 2, unit = "1" }}
m = {{ value = 3, unit = "1", tunable = true }}
T = {{ value = 1, unit = "s" }}
[inputs]
F = {{ unit = "1" }}
z = {{ unit = "1" }}
[states]
q = {{ unit = "1" }}
w = {{ unit = "1" }}
F_lag = {{ unit = "1" }}
[variables]
g = {{ unit = "1" }}
h = {{ unit = "1" }}
F_foot = {{ unit = "1" }}
[networks]
one = {{ inputs = ["1"], output = "1" }}
net2 = {{ inputs = ["1", "1"], output = "1" }}
[equations]
e1 = "der(q)*T = w"
e2 = "der(w)*T + g = {a}"
e3 = "der(F_lag)*T = {b}"
e4 = "g = {c}"
e5 = "h + g = F + q"
e6 = "F_foot = F - q"
[outputs]
y = {{ value = "{d}", unit = "1" }}
[sets.default]
one = "one.json"
net2 = "net2.json"
"""
    path = folder / "expressions.toml"
    path.write_text(text)
    try:
        model = penode_gen.load(path)
    except penode_gen.ModelError as error:
        assert error.problems and all(p.isprintable() and "; " in p for p in error.problems)
    else:
        for text in penode_gen.render(model).values():
            assert not re.search(r"\b(nan|zoo|oo|inf|DiracDelta|Derivative|Subs)\b", text)


@settings(FUZZ, max_examples=1000)
@given(st.text(alphabet="msN kg/*^·²³1230.-()%°µ_e", max_size=14))
def test_any_unit(text):
    try:
        assert isinstance(units.factor(text), float) and units.si(text)
        units.quantity(f"1 {text}")
    except units.UnitError as error:
        assert str(error)


@settings(FUZZ, max_examples=1000)
@given(st.text(alphabet="qwz0129.eE+-*/^(),<>= ij'\"\\#:;{}[]lambdxpn_\n\0", max_size=24))
def test_any_text_as_an_expression(text):
    try:
        expressions.parse(text, {"q", "w", "z"}, {"n": 1}, {"q"})
    except expressions.ExpressionError as error:
        assert str(error)


def test_units_are_kept_with_their_installation(tmp_path, monkeypatch):
    """Not in the user's cache, whose entries name the files of one installation, which may be gone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert units._known().Quantity(1.0, "inch").to("mm").magnitude == pytest.approx(25.4)
    assert not any(tmp_path.iterdir())
