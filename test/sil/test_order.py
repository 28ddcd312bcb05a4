# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Clocks that change their zone, are set back, or whose rows are written in another order."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from penode_sil.errors import UserError
from penode_sil.recordings import GAP, read
from penode_sil.recordings.order import ordered
from penode_sil.recordings.raster import clock_of

BEGIN = datetime(2026, 10, 25, 0, 50, tzinfo=UTC)  # ten minutes before summer time ends in Berlin
STEP, COUNT = 2.5, 960  # 40 min
SUMMER = COUNT // 4  # rows of it
EXACT = np.arange(COUNT) * STEP


def table(tmp_path, stamp, name="r.csv"):
    """A recording whose row k has stamp(k) as its time."""
    path = tmp_path / name
    path.write_text("time,x [m]\n" + "".join(f"{stamp(k)},{k}\n" for k in range(COUNT)))
    (found,) = read(path)
    return found


def local(k: int, form: str = "{}") -> str:
    zone = timezone(timedelta(hours=2 if k < SUMMER else 1))
    return form.format((BEGIN + timedelta(seconds=k * STEP)).astimezone(zone).isoformat(timespec="milliseconds"))


def zulu(k: int) -> str:
    return (BEGIN + timedelta(seconds=k * STEP)).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@pytest.mark.parametrize(
    "stamp",
    [
        local,
        lambda k: local(k)[11:],  # times of day
        lambda k: local(k).replace("+01:00", "+01").replace("+02:00", "+0200"),
        lambda k: local(k, "{}[Europe/Berlin]"),
        lambda k: local(k) if k < 500 else zulu(k),
        lambda k: zulu(k).replace("Z", " UTC") if k % 2 else local(k).replace("T", " "),
        lambda k: (BEGIN + timedelta(seconds=k * STEP)).astimezone(timezone(timedelta(hours=-3.5))).isoformat(),
    ],
)
def test_offsets_from_utc_count(tmp_path, stamp):
    found, notes = table(tmp_path, stamp), []
    assert found.time() - found.time()[0] == pytest.approx(EXACT, abs=1e-6)
    assert clock_of(found, notes).time == pytest.approx(found.time()) and not notes


def test_a_stamp_without_an_offset_among_others_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"r\.csv:702: .* has no offset from UTC.*; write it behind all of them, or behind none"):
        table(tmp_path, lambda k: local(k) if k != 700 else local(k)[:23]).time()


@pytest.mark.parametrize("hours", [1.0, 0.5, 2.0])
def test_a_wall_clock_that_is_set_back_goes_on(tmp_path, hours):
    found, notes = table(tmp_path, lambda k: str(BEGIN + timedelta(seconds=k * STEP - 3600.0 * hours * (k >= SUMMER)))[:-6]), []
    assert clock_of(found, notes).time - found.time()[0] == pytest.approx(EXACT, abs=1e-6)
    assert notes == [
        f"{found.path}:{SUMMER + 2}: channel time goes back there: the clock was set back by {hours:g} h, as at the end of summer time; "
        "rows follow each other"
    ]


@pytest.mark.parametrize("back", [1.0, 7.4, 100.0, 1200.0, 3607.0, 1e4])
def test_a_clock_that_is_set_back_otherwise_is_refused_where_rows_would_mix(tmp_path, back):
    found = table(tmp_path, lambda k: f"{20000.0 + k * STEP - back * (k >= SUMMER):.3f} s".removesuffix(" s"))
    found.units["time"] = "s"
    mixed = 2.0 * STEP < back < SUMMER * STEP + COUNT * STEP
    if mixed:
        with pytest.raises(UserError, match=rf":{SUMMER + 2}: channel time goes back.*; split the recording where its clock restarts"):
            clock_of(found, [])
    else:  # one row beside another one, or a stretch before all others
        assert np.all(np.diff(clock_of(found, []).time) > 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_rows_in_another_order_are_sorted(seed):
    draw = np.random.default_rng(seed)
    late = EXACT + draw.uniform(0.0, 4.0 * STEP, COUNT)  # written when they arrive
    for time in (EXACT[np.argsort(late)], np.concatenate([EXACT[500:], EXACT[:500]]), np.r_[EXACT[:7], EXACT[8:11], EXACT[7], EXACT[11:]]):
        found = ordered(time, str, GAP)
        assert found.time == pytest.approx(EXACT) and time[found.rows] == pytest.approx(EXACT) and "sorted by time" in found.note


@pytest.mark.parametrize("jitter", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("laps", [2, 3, 16])
def test_a_clock_that_starts_anew_is_refused(jitter, laps):
    draw = np.random.default_rng(laps)
    lap = [np.cumsum(STEP * (1.0 + jitter * draw.uniform(-0.999, 1.0, 60))) for _ in range(laps)]
    with pytest.raises(UserError, match="clock restarts"):
        ordered(np.concatenate(lap), str, GAP)
