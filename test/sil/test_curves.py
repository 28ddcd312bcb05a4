# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Laws of the catalogue's forms along a motion, against the textbook's formulas."""

from __future__ import annotations

import numpy as np
import pytest

from penode_sil.diagnosis import catalogue
from penode_sil.diagnosis.catalogue import dampers, friction, powers, tyres
from penode_sil.diagnosis.catalogue.form import Form, Motion, Moved, Part, Sizes
from penode_sil.diagnosis.catalogue.loads import put_on

T = np.linspace(0.0, 4.0, 4001)
NEAR = 1e-6  # square of a thousandth
SWING = Moved(np.sin(3.0 * T), 3.0 * np.cos(3.0 * T), T)


@pytest.mark.parametrize("exponent", (1.5, 3.0, 4.2))
def test_a_power_of_the_deflection(exponent):
    """Rounded near 0: by at most NEAR^(exponent/2) within a thousandth of the reach, and beyond that by NEAR (exponent - 1)/2."""
    found = powers.odd("s", (2.0, "m"), exponent).along(SWING)
    x = SWING.s / 2.0
    assert found == pytest.approx(np.sign(x) * np.abs(x) ** exponent, abs=max(NEAR ** (exponent / 2.0), NEAR * (exponent - 1.0) / 2.0))


SIZED = Sizes({(0, "force"): 12.0, (0, "rise"): 0.5, (0, "stribeck"): 0.03}, {}, moving=True)


@pytest.mark.parametrize("note", friction.FALLS)
def test_a_friction_falls_from_its_breakaway(note):
    """It has twice its level at rest, as steep as its transition, and all but 1/e of that lost at the rate that is reported."""
    v, rate = np.linspace(-20.0, 20.0, 400_001), np.sqrt(np.e - 1.0) if note == friction.SLOWLY else 1.0
    motion = Motion.of([Moved(v, v, np.arange(len(v)) * 1e-3)])
    part = friction.falling(motion, 1e-3 / motion.v_rms, 1.0 / motion.v_rms, friction.FALLS[note])
    force = part.along(motion.parts[0])
    assert force == pytest.approx(-force[::-1], abs=1e-9) and np.interp(5e-3, v, force) == pytest.approx(2.0, abs=2.1e-4)
    assert np.interp(rate, v, force) == pytest.approx(1.0 + np.exp(-1.0), abs=1e-6)
    sized = friction.sizes(Form("stribeck_friction", "damper", "force", 0, (part,), note), SIZED)
    assert sized == {"breakaway": ("N", 18.0), "coulomb": ("N", 12.0), "stribeck_rate": ("m/s", 0.03 * rate)}


def test_a_degressive_damper_with_a_corner_has_two_slopes():
    """What it takes away begins at the knee, on either side."""
    part = Part(dampers.CORNER, ("damping", "N*s/m"), {"knee": (0.1, "m/s")}, 1)
    v = np.array([-0.3, -0.1, 0.05, 0.1, 0.2])
    assert part.along(Moved(v, v, np.arange(5.0))) == pytest.approx([0.2, 0.0, 0.0, 0.0, -0.1], abs=1e-15)


def test_a_tyre_may_be_nonlinear_only_where_it_is_pressed_in():
    s = np.array([-0.02, -0.01, 0.0, 0.01])
    part = Part(tyres.PRESSED, ("quadratic", "N/m^2"))
    assert part.along(Moved(s, 0.0 * s, np.arange(4.0))) == pytest.approx([4e-4, 1e-4, 0.0, 0.0], abs=1e-18)


def test_the_quadratic_of_a_tyre_is_the_load_of_one_that_is_pressed_in():
    """s < 0 is pressed in: there the law pushes with a force below zero."""
    found = tyres.sizes(Form("tyre_nonlinear", "tyre", "force", 0), Sizes({(0, "quadratic"): -2e6}, {}, moving=True))
    assert found == {"quadratic": ("N/m^2", 2e6)}


def test_a_peak_is_one_at_its_largest_and_odd():
    v = np.linspace(-20.0, 20.0, 400_001)
    motion = Motion.of([Moved(v, v, np.arange(len(v)) * 1e-3)])
    force = friction.peak(motion, 1.0 / motion.v_rms).along(motion.parts[0])
    assert np.max(force) == pytest.approx(1.0, rel=1e-8) and force == pytest.approx(-force[::-1], abs=1e-12)
    assert force[-1] < 2.0 / v[-1] ** 2


def test_a_contact_that_is_lost_gradually():
    """Far on either side it is the law with a corner; where that has it, rounding times ln 2 is lost, and half of the stiffness."""
    part = Part(tyres.ROUNDED, ("stiffness", "N/m"), {"static": (0.2, "m"), "rounding": (0.05, "m")}, 1)
    s = np.array([-1.0, 0.2 - 1e-6, 0.2, 0.2 + 1e-6, 1.5])
    force = part.along(Moved(s, s, np.arange(5.0)))
    assert force[[0, 4]] == pytest.approx([0.0, -1.3], abs=0.051 * np.exp(-24.0))
    assert force[2] == pytest.approx(-0.05 * np.log(2.0)) and (force[3] - force[1]) / 2e-6 == pytest.approx(-0.5, rel=1e-5)


@pytest.mark.parametrize("share", (0.05, 0.4))
def test_a_load_that_is_put_on(share):
    """Nothing at first, half of it at its time, all of it at the end. RK4 of der(elapsed) = 1 is exact."""
    part = put_on(Motion.of([SWING]), share)
    begin, time = (part.shapes[k][0] for k in ("begin", "time"))
    assert part.along(SWING) == pytest.approx(0.5 + 0.5 * np.tanh((T - begin) / time), abs=1e-9)


@pytest.mark.parametrize("own, preload", (({"linear_spring.stiffness": 2e5}, 2000.0), ({}, 500.0)))
def test_the_preload_of_a_tyre_is_that_of_its_spring(own, preload):
    """One that keeps three quarters of its stiffness in the air has no less on the road; without a linear spring what is lost counts."""
    form = Form(tyres.KINDS[1], "tyre", "force", 0)
    values = {(0, "stiffness"): 5e4, (0, "static"): 0.01}
    assert tyres.sizes(form, Sizes(values, own, moving=True)) == {"preload": ("N", pytest.approx(preload))}


@pytest.mark.parametrize("gap, kind", [(5e-6, ""), (1e-5, "backlash")])
def test_a_play_far_below_the_deflection_of_its_contact_is_none(gap, kind):
    """At 0.1 m/s rms, a contact with a relaxation time of 2 ms deflects by 0.2 mm rms; 4 % of that are 8 um."""
    shapes = {"gap": (gap, "m"), "relaxation": (2e-3, "s")}
    part = Part("loose_damper", ("damping", "N*s/m"), shapes, 1, takes="linear_damper")
    form = Form("backlash", "spring", "force", 0, (part,), "of a damper")
    found = catalogue.fitted(form, [(2000.0, part)], Motion((), 1e-3, 0.1, 2e-3, 0.2))
    assert found.kind == kind
