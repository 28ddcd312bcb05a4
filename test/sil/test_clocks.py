# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which rows of a channel are its samples, and when they were taken: whatever else a table holds in between."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from penode_sil.recordings.clocks import own_samples
from penode_sil.recordings.stamps import evened, sampled_evenly

N, STEP = 2000, 2e-3
TIME = np.arange(N) * STEP
END = N * STEP


def moving(time: np.ndarray, seed: int = 1, noise: float = 0.05) -> np.ndarray:
    """A signal of 0.3 to 25 Hz with white noise."""
    draw = np.random.default_rng(seed)
    waves = (np.sin(2.0 * np.pi * f * time + draw.uniform(0.0, 6.28)) for f in np.geomspace(0.3, 25.0, 40))
    return sum(waves) + noise * draw.normal(size=time.size)


def printed(values: np.ndarray, digits: int = 9) -> np.ndarray:
    return np.array([float(f"{v:.{digits}g}") for v in values])


def slow(every: float, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Instants `every` rows apart, and samples there."""
    time = np.arange(shift, END, every * STEP)
    return time, moving(time)


@pytest.mark.parametrize("quantum", [0.0, 0.2])
@pytest.mark.parametrize("every", [1.5, 2, 3, 4.37, 7, 33.3])
def test_a_held_channel_shows_its_samples(every, quantum):
    """Whole and other ratios; of a coarse sensor, too, which repeats values by itself."""
    instants, samples = slow(every)
    samples = np.round(samples / quantum) * quantum if quantum else samples
    found = own_samples(TIME, printed(samples[np.searchsorted(instants, TIME + 1e-9, side="right") - 1]))
    assert found.how == "held" and found.every == pytest.approx(every, rel=1e-4)
    here = np.rint(found.time / (every * STEP)).astype(int)[1:-1]
    assert np.all(np.diff(here) == 1) and here.size >= instants.size - 4
    # an instant lies after the row before that which shows it first: by instants at q places between rows, to 1/q of a row
    assert np.max(np.abs(found.time[1:-1] - instants[here])) < STEP / Fraction(str(every)).denominator
    assert found.values[1:-1] == pytest.approx(samples[here], rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(
    "every, shift, digits", [(2, 0.0, 17), (3, 0.0, 9), (5, 0.0, 17), (3, 7e-4, 9), (3.5, 0.0, 5), (4.37, 7e-4, 9), (33.3, 7e-4, 9)]
)
def test_a_channel_joined_by_lines_shows_its_samples(every, shift, digits):
    """Corners in rows and between them, which are where lines meet."""
    instants, samples = slow(every, shift)
    found = own_samples(TIME, printed(np.interp(TIME, instants, samples), digits))
    assert found.how == "lines" and found.every == pytest.approx(every, rel=1e-4)
    here = np.rint((found.time - shift) / (every * STEP)).astype(int)
    inner = slice(1, -1)
    assert here.size > 0.97 * (N / every) - 3
    assert np.max(np.abs(found.time - instants[here])[inner]) < 1e-3 * STEP
    # two lines of two rows each, rounded by half a digit, are off by five times that where they meet; slopes of up to
    # 2000 1/s over a time known to 1e-8 of 4 s add 1e-4
    assert np.max(np.abs(found.values - samples[here])[inner]) < 1.5e-4 + 5.0 * 10.0 ** (1 - digits)


def test_lines_of_a_coarse_sensor_are_seen():
    instants, samples = slow(5)
    found = own_samples(TIME, np.round(np.interp(TIME, instants, samples) / 0.02) * 0.02)
    assert found.how == "lines" and found.time == pytest.approx(instants, abs=1e-6)
    assert np.max(np.abs(found.values - samples)) <= 0.01 + 1e-9


def still(values):
    values = values.copy()
    values[300:1500] = values[300]
    return values


SOUND = {
    "noisy": moving(TIME),
    "noisy, four digits": printed(moving(TIME), 4),
    "noisy, coarse": np.round(moving(TIME) / 0.5) * 0.5,
    "without noise": moving(TIME, noise=0.0),
    "without noise, five digits": printed(moving(TIME, noise=0.0), 5),
    "fine sine": np.sin(2.0 * np.pi * TIME),
    "slow sine, six digits": printed(np.sin(0.2 * np.pi * TIME), 6),
    "slow sine, coarse": np.round(np.sin(2.0 * np.pi * TIME), 3),
    "sine of five rows": np.sin(0.4 * np.pi * np.arange(N)),
    "sine of eight rows": printed(np.sin(0.25 * np.pi * np.arange(N))),
    "ramp": 3.0 * TIME,
    "ramp, coarse": np.floor(100.0 * TIME) / 100.0,
    "triangle": np.abs(2.0 * TIME % 2.0 - 1.0),
    "square": (5.0 * TIME % 1.0 > 0.5).astype(float),
    "cut off": np.clip(moving(TIME), -2.0, 2.0),
    "stands still": still(moving(TIME)),
    "constant": np.full(N, 3.0),
    "a tenth lost, evenly": np.where(np.arange(N) % 10 == 0, np.nan, moving(TIME)),
    "a third lost": np.where(np.random.default_rng(5).random(N) < 0.33, np.nan, moving(TIME)),
    "lost in bursts": np.where(np.sin(2.0 * np.pi * 0.9 * TIME) > 0.8, np.nan, moving(TIME)),
    "nothing": np.full(N, np.nan),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_channel_is_left_alone(name):
    assert own_samples(TIME, SOUND[name]) is None


@pytest.mark.parametrize("seed", range(8))
def test_lines_and_repeats_at_random_make_no_clock(seed):
    """Each row repeats the one before, or lies between its neighbours, by chance."""
    draw = np.random.default_rng(seed)
    share = draw.uniform(0.05, 0.9)
    rows = np.maximum.accumulate(np.where(draw.random(N) < share, 0, np.arange(N)))
    assert own_samples(TIME, moving(TIME, seed)[rows]) is None
    corner = np.unique(np.r_[0, rows, N - 1])
    assert own_samples(TIME, np.interp(TIME, TIME[corner], moving(TIME, seed)[corner])) is None


@pytest.mark.parametrize("lost", [0.05, 0.3])
def test_samples_that_are_lost_hide_no_clock(lost):
    _instants, samples = slow(7)
    held = np.where(np.random.default_rng(2).random(N) < lost, np.nan, samples[np.arange(N) // 7])
    found = own_samples(TIME, held)
    assert found.how == "held" and found.every == pytest.approx(7.0, rel=1e-3)


def test_a_union_of_clocks_comes_apart():
    """Two clocks of 2 and 10 ms on one time base: cells empty, held, and joined by lines."""
    fast, late = TIME, TIME[::5] + 7e-4
    base = np.sort(np.r_[fast, late])
    own, other = np.full(base.size, np.nan), np.full(base.size, np.nan)
    own[np.isin(base, fast)], other[np.isin(base, late)] = moving(fast), moving(late)
    for cells, clock in ((own, fast), (other, late)):
        known = np.isfinite(cells)
        held = cells[known][np.maximum(np.searchsorted(clock, base, side="right") - 1, 0)]
        for how, values in (("sparse", cells), ("held", held), ("lines", np.interp(base, clock, cells[known]))):
            found = own_samples(base, values)
            assert found is not None and found.how == how, (how, clock is fast)
            assert found.time[2:-2] == pytest.approx(clock[np.searchsorted(clock, found.time[2:-2] - 1e-6)], abs=1e-9)
            assert found.interval == pytest.approx(clock[1] - clock[0], rel=1e-6)


def test_an_input_joined_by_lines_stays_so():
    instants, samples = slow(5)
    assert own_samples(TIME, np.interp(TIME, instants, samples), driving=True) is None
    assert own_samples(TIME, samples[np.arange(N) // 5], driving=True).how == "held"


def single(time: np.ndarray) -> np.ndarray:
    return time.astype(np.float32).astype(float)


@pytest.mark.parametrize(
    "exact, stamps, step",
    [
        (TIME + 1234.0, lambda t: printed(t, 6), 1e-2),
        (TIME + 998.0, lambda t: printed(t, 6), 1e-2),  # 1 ms below 1000 s
        (TIME + 1e5, single, 2.0**-7),
        (TIME + 1e5, lambda t: printed(single(t), 9), 2.0**-7),
        (TIME + 1e5, lambda t: single(t) - 1e5, 2.0**-7),
        (1.25 * TIME, lambda t: np.round(t, 3), 1e-3),
        (1.25 * TIME, lambda t: np.floor(1e3 * t + 1e-6) / 1e3, 1e-3),
        (2.0 * TIME, lambda t: np.floor(t * 64.0) / 64.0, 2.0**-6),
    ],
)
def test_coarse_stamps_are_spread_evenly(exact, stamps, step):
    found = evened(stamps(exact))
    assert found.step == pytest.approx(step, rel=1e-6)
    assert found.jitter <= (5e-4 if step == 2.0**-7 else 0.0)  # nine digits at 1e5 s round once more, by half a millisecond
    steps, true = np.diff(found.time), np.diff(exact)
    # a line through n rounded stamps has its slope to sqrt(12) / n^1.5 of their RMS error, a third of a step; a gap is whole rows
    slack = 4.0 * step * exact.size**-1.5 + 1e-9
    assert np.max(np.abs(steps - true)) < slack * np.max(true / true.min())
    assert found.off <= 0.55 * step
    assert "spread evenly" in found.note


def test_stamps_that_are_fine_or_of_no_clock_stay():
    draw = np.random.default_rng(3)
    jitter = TIME + draw.uniform(-3e-4, 3e-4, N)
    for stamps in (
        TIME,
        np.round(1.024 * TIME, 5),
        jitter,
        np.round(np.cumsum(draw.exponential(STEP, N)), 2),
        np.sort(np.r_[TIME, TIME[700]]),
    ):
        assert evened(stamps) is None


def test_jitter_beyond_rounding_is_stated():
    """Stamps of 1 ms at rows of 2.37 ms, which are early and late by up to 0.3 ms."""
    found = evened(np.round(1.185 * TIME + 3e-4 * np.sin(0.7 * np.arange(N)), 3))
    # both extremes meet within 2000 rows to a tenth of a step
    assert found.jitter == pytest.approx(3e-4, abs=1e-4) and "ms more than rounding" in found.note


@pytest.mark.parametrize("lost", [[700], [300, 301, 302, 1500], [200, 900, 1700]])
def test_rows_that_are_lost_among_coarse_stamps_are_missed(lost):
    exact = np.delete(TIME, lost)
    found = evened(printed(exact + 1234.0, 6))
    # where in its step of five rows one is lost, nobody can tell; two steps beside it count
    far = np.min(np.abs(exact[:, None] - TIME[lost]), axis=1) > 2e-2
    off = found.time - exact - 1234.0
    together = max(np.sum(np.abs(np.array(lost) - k) < 5) for k in lost)  # rows beside them are off by no more than these
    assert np.ptp(off[far]) < 0.5 * STEP and np.max(np.abs(off - np.median(off))) < (together + 0.1) * STEP


@pytest.mark.parametrize("late", [0.0, 7e-4])
def test_the_clock_may_start_anew_behind_a_long_gap(late):
    """4 s in which nothing was recorded; then rows beside the instants of before."""
    exact = np.concatenate([TIME[:700], TIME[700:] + 4.0 + late])
    found = evened(printed(exact + 1234.0, 6))
    off = found.time - exact - 1234.0
    # stamps of five rows look alike: by them, a row is known to one of five instants, 2 ms apart, and its clock to half of that
    assert np.ptp(off[:700]) < 0.05 * STEP and np.ptp(off[700:]) < 0.05 * STEP and np.max(np.abs(off)) < 0.55 * STEP


def test_values_tell_late_stamps_from_late_samples():
    """Stamps that scatter by a fifth of a row: the samples were taken at these, or by the clock."""
    stamps = TIME + np.random.default_rng(4).uniform(-4e-4, 4e-4, N)
    assert sampled_evenly(stamps, TIME, [moving(TIME)])
    assert not sampled_evenly(stamps, TIME, [moving(stamps)])
    assert not sampled_evenly(stamps, TIME, [np.random.default_rng(5).normal(size=N)])


@pytest.mark.parametrize("rows", range(6))
def test_few_rows_show_no_clock(rows):
    """With fewer than five rows none has two on either side; found by a damaged file."""
    assert not sampled_evenly(TIME[:rows] + 1e-4 * np.arange(rows) ** 2, TIME[:rows], [np.arange(rows, dtype=float)])
