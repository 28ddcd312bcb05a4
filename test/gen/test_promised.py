# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A promise of the model file, kept by the running code: a set that breaks it is refused, with flag, network and place."""

import ctypes
import os
import re
import zlib
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_sil.status import BIT
from penode_sil.targets import Set, Sil

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "nqvm.toml"
FACTOR = 597  # of the spring network's output: nqvm_layout.json, spring_net.factor_2
SPRING = 0  # number of the spring network among those that are prepared
MAX_SLOPE = 0x8


class Breach(ctypes.Structure):
    """pen_breach_t"""

    _fields_ = [("network", ctypes.c_uint32), ("kind", ctypes.c_uint32), ("at", ctypes.c_float)]


def model(folder, pieces, slope="130000 N/m"):
    path = folder / "promised.toml"
    path.write_text(
        f'[model]\nextends = "{os.path.relpath(NQVM, folder)}"\nname = "promised"\npieces = {pieces}\n'
        f'[networks]\nspring_net = {{ inputs = ["m"], output = "N", max_slope = "{slope}" }}\n'
    )
    return penode_gen.load(path)


def steeper(sil, factor):
    """The default set with a steeper spring, and the values that it borrows."""
    values = penode_gen.set_values(sil.model, "default").copy()
    values[FACTOR] *= np.float32(factor)
    chosen = Set()
    chosen.head.layout, chosen.head.length = penode_gen.set_head(sil.model, "default")[:2]
    chosen.head.id, chosen.head.checksum = 9, zlib.crc32(values.astype("<f4").tobytes())
    chosen.value = values.ctypes.data
    return chosen, values


def force(sil, s):
    """Force of the default set's spring network, in float64."""
    return sil.model.sets["default"].networks["spring_net"].evaluate(np.array([float(s)]))[0]


def steepest(sil):
    """The steepest slope of the default set's spring network, by differences."""
    s = np.linspace(-1.0, 1.0, 10_001)
    return np.abs(np.diff([force(sil, v) for v in s]) / np.diff(s)).max()


@pytest.mark.parametrize("pieces", [0, 96], ids=["layers", "folded"])
def test_a_set_that_breaks_a_promise_is_refused_with_the_place(pieces, tmp_path):
    sil = Sil(model(tmp_path, pieces))
    instance = sil.instance()
    select, breach = sil.function("tune_select"), Breach()
    limit = 130000.0
    factor = 1.05 * limit / steepest(sil)
    bad, _kept = steeper(sil, factor)
    good, _kept_too = steeper(sil, 0.9 * limit / steepest(sil))
    before = [instance.step([0.01])[2] for _ in range(3)]
    assert select(instance._self, ctypes.byref(bad)) == BIT["set_promise"]
    assert sil.function("tune_breach")(instance._self, ctypes.byref(breach)) == 0
    assert (breach.network, breach.kind) == (SPRING, MAX_SLOPE)
    slope = (force(sil, breach.at * 1.0005) - force(sil, breach.at)) / (breach.at * 0.0005) * factor
    assert abs(slope) > limit  # just beyond the place that was given, away from zero
    assert instance.step([0.01])[2] == before[-1] == 0  # goes on with the set that it had
    assert instance.status().flags & BIT["set_promise"]
    assert select(instance._self, ctypes.byref(good)) == 0
    assert instance.step([0.01])[2] & BIT["adopted"]


def test_networks_that_keep_their_promises_do_not_hide_the_breach_of_another(tmp_path):
    """Two networks with promises; the first breaks its own. A good set afterwards does not clear it either."""
    path = tmp_path / "both.toml"
    path.write_text(
        f'[model]\nextends = "{os.path.relpath(NQVM, tmp_path)}"\nname = "both"\n[networks]\n'
        'spring_net = { inputs = ["m"], output = "N", max_slope = "130000 N/m" }\n'
        'damper_net = { inputs = ["m/s"], output = "N", max_slope = "1e6 N*s/m" }\n'
    )
    sil = Sil(penode_gen.load(path))
    instance, breach = sil.instance(), Breach()
    bad, _kept = steeper(sil, 10.0)
    good, _kept_too = steeper(sil, 1.0)
    for chosen, status in ((bad, BIT["set_promise"]), (good, 0)):
        assert sil.function("tune_select")(instance._self, ctypes.byref(chosen)) == status
        assert sil.function("tune_breach")(instance._self, ctypes.byref(breach)) == 0
        assert (breach.network, breach.kind) == (SPRING, MAX_SLOPE)


def test_init_refuses_it_as_well(tmp_path):
    sil = Sil(model(tmp_path, 0))
    instance = sil.instance()
    bad, _kept = steeper(sil, 10.0)
    assert sil.function("init")(instance._self, ctypes.byref(bad), None) == BIT["set_promise"]
    assert sil.function("step")(instance._self, None, None) == BIT["badarg"]  # not initialised


def test_a_model_that_does_not_look_is_found(tmp_path):
    """The seeded fault: promises are not handed to the runtime."""
    chosen = model(tmp_path, 96)
    penode_gen.generate(chosen, tmp_path / "c")
    source, times = re.subn(r"&promised_promise_spring_net \}", "NULL }", (tmp_path / "c" / "promised.c").read_text())
    assert times == 1
    (tmp_path / "c" / "promised.c").write_text(source)
    sil = Sil(chosen, source=tmp_path / "c", compiler=("gcc", "-O2", "-Wno-unused"))
    bad, _kept = steeper(sil, 10.0)
    assert sil.function("tune_select")(sil.instance()._self, ctypes.byref(bad)) == 0
