# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The trial of a set on the last samples, before it is adopted."""

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
FACTOR = 597  # of the spring network's output: the header of the sets names it


def model(folder, trial=50, pieces=0, bound="0.01"):
    bounded = f", trial_bound = {bound}" if bound else ""
    path = folder / "tried.toml"
    path.write_text(
        f'[model]\nextends = "{os.path.relpath(NQVM, folder)}"\nname = "tried"\ntrial = {trial}\npieces = {pieces}\n'
        f'[outputs]\nz_b = {{ value = "z_b", unit = "m"{bounded} }}\n'
    )
    return penode_gen.load(path)


def road(k):
    return 0.02 * np.sin(0.03 * k)


def drive(instance, begin, n):
    return [instance.step([road(k)])[2] for k in range(begin, begin + n)]


def changed(sil, **factors):
    """The default set with some values multiplied, as a set with a good checksum; it borrows the returned values."""
    values = penode_gen.set_values(sil.model, "default").copy()
    for place, factor in factors.items():
        values[int(place[1:])] *= np.float32(factor)
    layout, length, _, _ = penode_gen.set_head(sil.model, "default")
    own = Set()
    own.head.layout, own.head.length, own.head.id = layout, length, 7
    own.head.checksum = zlib.crc32(values.astype("<f4").tobytes())
    own.value = values.ctypes.data
    return own, values


@pytest.fixture(scope="module", params=[0, 96], ids=["layers", "folded"])
def sil(request, tmp_path_factory):
    return Sil(model(tmp_path_factory.mktemp("trial"), pieces=request.param))


def select(instance, chosen):
    return instance.sil.function("tune_select")(instance._self, ctypes.byref(chosen))


def running(instance):
    head = Set().head
    assert instance.sil.function("tune_running")(instance._self, ctypes.byref(head)) == 0
    return head.id


def test_a_set_that_overflows_is_refused_and_the_running_one_goes_on(sil):
    """The spring's output times 1e36: finite weights, a good checksum, and Inf within a few samples."""
    instance, twin = sil.instance(), sil.instance()
    drive(instance, 0, 60), drive(twin, 0, 60)
    bad, _kept = changed(sil, **{f"_{FACTOR}": 1e30})
    assert select(instance, bad) == BIT["set_trial"]
    assert instance.status().flags & BIT["set_trial"]
    assert drive(instance, 60, 50) == drive(twin, 60, 50)
    assert np.array_equal(instance.get_state(), twin.get_state())
    assert running(instance) == sil.model.sets["default"].id


def test_a_good_set_is_adopted(sil):
    instance = sil.instance()
    drive(instance, 0, 60)
    assert select(instance, sil.flash_set("altered_friction")) == 0
    assert drive(instance, 60, 1)[0] & BIT["adopted"]


def test_a_set_that_leads_too_far_from_the_running_one_is_refused(tmp_path):
    """The same two sets, apart by some distance after 50 samples: refused below it, adopted above it."""
    apart = []
    for factor in (1.0, 8.0):  # the reference: instances without a trial, at the first sample that it uses
        sil = Sil(model(tmp_path, trial=0))
        path = sil.instance()
        drive(path, 0, 11)
        own, _ = changed(sil, **{f"_{FACTOR}": factor})
        assert select(path, own) == 0
        apart.append([path.step([road(k)])[1][0] for k in range(11, 60)])
    distance = float(np.max(np.abs(np.subtract(*apart))))
    assert distance > 1e-5
    for bound, expected in ((0.9 * distance, BIT["set_trial"]), (1.1 * distance, 0)):
        instance = Sil(model(tmp_path, bound=f"{bound:.9g}")).instance()
        drive(instance, 0, 60)
        own, _kept = changed(instance.sil, **{f"_{FACTOR}": 8.0})
        assert select(instance, own) == expected


def test_without_samples_there_is_nothing_to_try_on(sil):
    instance = sil.instance()
    bad, _kept = changed(sil, **{f"_{FACTOR}": 1e30})
    assert select(instance, bad) == 0


def test_a_model_without_states_is_tried_on_each_sample(tmp_path):
    """And its C has no unused parameter."""
    path = tmp_path / "gain.toml"
    path.write_text(
        '[model]\nname = "gain"\nsample_time = "1 ms"\ntrial = 4\n[parameters]\nk = { value = 50, unit = "N/m", tunable = true }\n'
        '[inputs]\nz = { unit = "m" }\n[outputs]\nf = { value = "k*z", unit = "N", trial_bound = 40 }\n'
        '[sets.default]\n[sets.stiff]\nk = "100 N/m"\n'
    )
    sil = Sil(penode_gen.load(path), compiler=("gcc", "-O2", "-Wall", "-Wextra", "-Werror"))
    for z, expected in ((0.7, 0), (0.9, BIT["set_trial"])):  # 35 and 45 N apart
        instance = sil.instance()
        assert instance.step([z])[2] == 0 and instance.select("stiff") == expected


def test_only_samples_without_a_gap_count(sil):
    """A held sample ends the row of samples: what the set does to older ones does not count."""
    instance = sil.instance()
    drive(instance, 0, 60)
    bad, _kept = changed(sil, **{f"_{FACTOR}": 1e30})
    assert instance.step([np.nan])[2] & BIT["input_nonfinite"]
    assert select(instance, bad) == 0


def test_rollback_is_not_tried(sil):
    """It leads to a set that has run, and may be all that is left to do."""
    instance = sil.instance()
    bad, _kept = changed(sil, **{f"_{FACTOR}": 1e30})
    assert select(instance, bad) == 0
    instance.step([0.0])
    instance.step([0.0])
    assert select(instance, sil.flash_set("default")) == 0
    instance.step([0.0])
    drive(instance, 0, 60)
    assert sil.function("tune_rollback")(instance._self) == 0


def test_without_trial_there_is_no_code_for_it(tmp_path):
    texts = penode_gen.render(model(tmp_path, trial=0))
    assert not any("trial" in text.lower() for text in texts.values())


FAULTS = {
    "does not compare": (r"!\(apart <= bound\[n\]\)", "(apart > (pen_real_t)1e30)"),
    "does not look for NaN": (r"(tried_try_step\(ready->value, from, to, new\) == PEN_OK)", r"(\1 || true)"),
    "tries the running set twice": (r"ready->value, from", "self->head.tuning.slot[inactive ^ 1U].value, from"),
    "one sample only": (r"k < \(span.last - span.first\)", "k < 1U"),
    "not asked": (r"\(status == PEN_OK\) && try", "false && try"),
}


def answers(folder, fault):
    """What a set that overflows gets where outputs have no bounds, and one that leads elsewhere where they have."""
    found = []
    for bound, factor in (("", 1e30), ("1e-5", 8.0)):
        chosen, code = model(folder, bound=bound), folder / f"c{bound}"
        penode_gen.generate(chosen, code)
        source, times = re.subn(*fault, (code / "tried.c").read_text()) if fault else ((code / "tried.c").read_text(), 1)
        assert times, "this fault can no longer be put in"
        (code / "tried.c").write_text(source)
        sil = Sil(chosen, source=code)
        instance = sil.instance()
        drive(instance, 0, 60)
        bad, _kept = changed(sil, **{f"_{FACTOR}": factor})
        found.append(select(instance, bad))
    return found


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_found(fault, tmp_path):
    assert answers(tmp_path, FAULTS[fault]) != [BIT["set_trial"]] * 2


def test_the_same_without_a_fault(tmp_path):
    assert answers(tmp_path, None) == [BIT["set_trial"]] * 2
