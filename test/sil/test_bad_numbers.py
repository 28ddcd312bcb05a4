# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""NaN and Inf anywhere: a flag is raised, state and outputs are held, the next good sample goes on. Refused sets."""

from __future__ import annotations

import zlib

import numpy as np
import pytest

import penode_gen
from penode_gen.sets.packing import offsets
from penode_sil.instance import Head, Set
from penode_sil.status import BIT, names
from penode_sil.targets import Sil

BAD = [np.nan, np.inf, -np.inf]
ROAD = 0.002 * np.sin(np.arange(400) * 0.05)  # small enough to stay inside every trust envelope


@pytest.fixture(scope="module", params=[np.float32, np.float64], ids=["float", "double"])
def sil(request, nqvm):
    return Sil(nqvm, request.param)


def staged(sil, set_name="default"):
    """An instance that runs from a bank, some samples old, so that there is a state and weights can be poked."""
    instance = sil.instance(set_name)
    for k in range(50):
        instance.step([ROAD[k]])
    exchange(instance, "altered_friction")
    for k in range(50, 60):
        instance.step([ROAD[k]])
    assert instance.running().id == penode_gen.set_head(sil.model, "altered_friction", sil.dtype)[2]
    return instance


def exchange(instance, set_name):
    model, dtype = instance.sil.model, instance.dtype
    assert instance.begin(penode_gen.set_head(model, set_name, dtype)) == 0
    assert instance.write(0, penode_gen.set_values(model, set_name, dtype)) == 0
    assert instance.commit() == 0


def active_bank(instance):
    """The bank that holds the running values."""
    values = penode_gen.set_values(instance.sil.model, "altered_friction", instance.dtype)
    return next(bank for bank in instance.banks if np.array_equal(bank, values))


def places_of_state(instance):
    """Views of the instance's memory that hold the state: found by its bytes, whatever the layout of the struct."""
    needle, memory = instance.get_state().tobytes(), instance.memory.tobytes()
    starts, at = [], memory.find(needle)
    while at >= 0:
        starts.append(at)
        at = memory.find(needle, at + 1)
    return [instance.memory[start : start + len(needle)].view(instance.dtype) for start in starts]


def same_as_before(instance, k, twin):
    """After trouble at sample k: the same steps on an instance that had none give the same bits."""
    for n in range(k, k + 20):
        (x, y, status), (x_twin, y_twin, _) = instance.step([ROAD[n]]), twin.step([ROAD[n]])
        assert status == 0
        assert np.array_equal(x, x_twin) and np.array_equal(y, y_twin)


@pytest.mark.parametrize("bad", BAD)
def test_bad_input_is_flagged_and_held(sil, bad):
    instance, twin = staged(sil), staged(sil)
    x, y = instance.get_state(), instance.step([ROAD[60]])[1]
    twin.step([ROAD[60]])
    x = instance.get_state()
    for _ in range(3):
        x_after, y_after, status = instance.step([bad])
        # NaN is outside of any envelope, too; Inf is beyond the declared range
        assert set(names(status)) - {"outside"} == {"input_nonfinite"} | ({"input_range"} if np.isinf(bad) else set())
        assert np.array_equal(x_after, x) and np.array_equal(y_after, y)
    assert instance.status().count("input_nonfinite") == 3
    same_as_before(instance, 61, twin)


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("which", range(4))
def test_bad_state_in_memory_is_flagged_and_repaired(sil, bad, which):
    """The instance holds the state more than once. One copy is stepped from: damage there is flagged, held, repaired from
    the spare one. Damage to any other leaves no trace."""
    flagged, place = 0, 0
    while True:
        instance, twin = staged(sil), staged(sil)
        _, y, _ = instance.step([ROAD[60]])
        twin.step([ROAD[60]])
        x, copies = instance.get_state(), places_of_state(instance)
        if place == len(copies):
            break
        copies[place][which] = bad
        x_after, y_after, status = instance.step([ROAD[61]])
        if status & BIT["state_nonfinite"]:
            flagged += 1
            assert np.array_equal(x_after, x) and np.array_equal(y_after, y)
            x_next, _, status = instance.step([ROAD[62]])
            assert status == 0 and np.all(np.isfinite(x_next))
        else:
            x_twin, y_twin, _ = twin.step([ROAD[61]])
            assert status == 0 and np.array_equal(x_after, x_twin) and np.array_equal(y_after, y_twin)
            same_as_before(instance, 62, twin)
        place += 1
    assert place >= 2 and flagged == 1


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("which", range(4))
def test_bad_state_is_refused_by_set_state(sil, bad, which):
    instance = staged(sil)
    x = instance.get_state()
    wrong = x.copy()
    wrong[which] = bad
    assert names(instance.set_state(wrong)) == ["state_nonfinite"]
    assert np.array_equal(instance.get_state(), x)
    assert instance.step([ROAD[60]])[2] == 0


@pytest.mark.parametrize("bad", BAD)
def test_bad_weight_is_flagged_and_held(sil, bad):
    """Many weights in turn. A sample with a bad one is worth exactly a held one, on a twin that holds.

    Only the bounds of trust envelopes are compared with and not computed with: then the step must advance to finite states.
    """
    instance, twin = staged(sil), staged(sil)
    bank, starts = active_bank(instance), offsets(sil.model).values()
    places = range(0, bank.size, 7)  # 7 has no factor in common with the 16 of the layers
    y = instance.step([ROAD[60]])[1]
    twin.step([ROAD[60]])
    for k, which in enumerate(places, start=61):
        good, x = bank[which], instance.get_state()
        bank[which] = bad
        x_after, y_after, status = instance.step([ROAD[k]])
        bank[which] = good
        if not any(which - start in (0, 1) for start in starts):
            assert status & BIT["step_nonfinite"]
            assert np.array_equal(x_after, x) and np.array_equal(y_after, y)
            twin.hold(True)
            twin.step([ROAD[k]])
            twin.hold(False)
        else:
            assert np.all(np.isfinite(x_after)) and np.all(np.isfinite(y_after))
            twin.step([ROAD[k]])
            twin.set_state(x_after)
        x_next, y, status = instance.step([ROAD[k]])  # recovery on the next good sample
        x_twin, y_twin, _ = twin.step([ROAD[k]])
        assert status == 0
        assert np.array_equal(x_next, x_twin) and np.array_equal(y, y_twin)


@pytest.mark.parametrize("bad", BAD)
def test_bad_bound_is_found_by_the_scrub(sil, bad):
    """A round of steps, in any place that it starts from, meets each number once; none of them is held for it."""
    instance = staged(sil)
    bank = active_bank(instance)
    for which in (start + k for start in offsets(sil.model).values() for k in (0, 1)):
        good, bank[which] = bank[which], bad
        reported = [instance.step([0.0])[2] for _ in range(bank.size)]
        bank[which] = good
        assert sum(bool(status & BIT["weight_nonfinite"]) for status in reported) == 1
        assert not any(set(names(status)) - {"outside", "weight_nonfinite"} for status in reported)
    assert instance.status().count("weight_nonfinite") == 2 * len(offsets(sil.model))


def refused(instance, call, flag):
    """The call gives this flag, and neither the running set nor the trajectory changes."""
    head = bytes(instance.running())
    assert names(call()) == [flag]
    assert bytes(instance.running()) == head


def test_refused_sets_have_a_reason_and_change_nothing(sil):
    model, dtype = sil.model, sil.dtype
    instance, twin = sil.instance(), sil.instance()
    values, head = (penode_gen.set_values(model, "altered_friction", dtype), penode_gen.set_head(model, "altered_friction", dtype))
    layout, length, number, checksum = head

    refused(instance, lambda: instance.write(0, values), "set_closed")  # before begin
    refused(instance, instance.commit, "set_closed")
    refused(instance, instance.rollback, "set_no_previous")
    refused(instance, lambda: instance.begin((layout ^ 1, length, number, checksum)), "set_layout")
    refused(instance, lambda: instance.begin((layout, length - 1, number, checksum)), "set_layout")

    assert instance.begin(head) == 0
    refused(instance, lambda: instance.write(1, values[1:]), "set_range")  # a gap
    refused(instance, lambda: instance.write(0, np.append(values, 0.0)), "set_range")  # one too many
    assert instance.write(0, values[:-1]) == 0
    refused(instance, instance.commit, "set_short")
    for wrong, flag in ((values[-1] + dtype(1.0), "set_checksum"), (dtype(np.nan), "set_checksum")):
        assert instance.write(length - 1, [wrong]) == 0
        refused(instance, instance.commit, flag)
    assert instance.abort() == 0

    poisoned = values.copy()
    poisoned[length // 2] = np.inf

    assert instance.begin((layout, length, 77, zlib.crc32(poisoned.tobytes()))) == 0  # the checksum is right
    assert instance.write(0, poisoned) == 0
    refused(instance, instance.commit, "set_nonfinite")
    assert instance.abort() == 0

    for k in range(100):
        assert np.array_equal(instance.step([ROAD[k]])[1], twin.step([ROAD[k]])[1])

    exchange(instance, "altered_friction")
    refused(instance, lambda: instance.write(0, values), "set_closed")  # after commit
    refused(instance, lambda: instance.begin(head), "set_busy")
    refused(instance, lambda: instance.select("default"), "set_busy")
    refused(instance, instance.rollback, "set_busy")
    assert names(instance.step([ROAD[100]])[2]) == ["adopted"]

    made = Set(Head(layout, length, 5, checksum ^ 1), values.ctypes.data)
    refused(instance, lambda: instance.select(made), "set_checksum")
    wrong_type = Set(Head(layout ^ 1, length, 5, checksum), values.ctypes.data)
    refused(instance, lambda: instance.select(wrong_type), "set_layout")


def test_without_banks_sets_can_only_be_selected(sil):
    instance = sil.instance(banks=False)
    refused(instance, lambda: instance.begin(penode_gen.set_head(sil.model, "altered_friction", sil.dtype)), "set_badarg")
    assert instance.select("altered_friction") == 0
    assert names(instance.step([0.0])[2]) == ["adopted"]
