# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms of a network that is used outside of its range, by made-up motions. A whole diagnosis: test_published_diagnosis."""

from __future__ import annotations

import numpy as np
import pytest

from penode_sil.diagnosis.catalogue import networks, stem
from penode_sil.diagnosis.catalogue.form import Motion, Moved, Sizes
from penode_sil.diagnosis.plant.plant import Place

T = np.linspace(0.0, 1.0, 2001)


def found(low: float, high: float, stated: bool = True, sense: int = 1) -> list:
    """Forms where the deflection is a sine of 10 mm."""
    s = 0.01 * np.sin(40.0 * T)
    motion = Motion.of([Moved(s, 0.4 * np.cos(40.0 * T), T)], 10.0)
    place = Place(("body", "ground"), (("net", sense),), "force", (("net", "s", low, high, stated),))
    return [(f, motion.parts[0]) for f in networks.forms(None, 0, place, motion)]


@pytest.mark.parametrize("sense", [1, -1])
def test_force_begins_at_the_end_of_the_range(sense):
    """A network that acts the other way round has its ends exchanged."""
    low, high = (-0.02, 0.004) if sense > 0 else (-0.004, 0.02)
    forms = found(low, high, sense=sense)
    assert [f.note for f, _ in forms] == ["a line at the high end of s", "a square at the high end of s"]
    for (form, moved), power in zip(forms, (1, 2), strict=True):
        (part,) = form.parts
        beyond = np.maximum(moved.s - 0.004, 0.0)
        assert form.where == "net" and set(part.fixed) == {"edge", "way"}
        assert part.along(moved) == pytest.approx((beyond / np.max(beyond)) ** power)


def test_both_ends_are_tried_together_and_alone():
    forms = [f for f, _ in found(-0.006, 0.003)]
    assert [len(f.parts) for f in forms] == [2, 1, 1, 2, 1, 1]
    v = Sizes({(0, "force"): -3.0, (1, "force"): 2.0, (0, "edge"): 0.003, (1, "edge"): 0.006}, {}, True)
    assert networks.sizes(forms[0], v) == {"force_at_peak": ("N", 3.0), "edge": ("m", 0.006)}


def test_nothing_is_beyond_a_range_that_is_not_left():
    assert not found(-0.011, 0.011)


def test_an_end_that_is_not_stated_is_fitted():
    assert all(f.parts[0].fixed == ("way",) for f, _ in found(-0.02, 0.004, False))
    assert all(set(f.parts[0].fixed) == {"edge", "way"} for f, _ in found(-0.02, -0.001, False))  # of no size


def test_elements_have_no_name_of_the_generator():
    assert stem("network_extrapolation") == "beyond_range" and stem("bump_stop") == "bump_stop"
