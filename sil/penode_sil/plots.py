# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Pictures of runs. Colours are Okabe and Ito's, told apart by every kind of colour vision."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from numpy.typing import NDArray

from .output import whole

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # the backend must be chosen first
from matplotlib.axes import Axes

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

__all__ = ["COLOURS", "STYLE", "Line", "draw", "plt"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
STYLE: dict[RcKeyType, object] = {
    "figure.dpi": 150,
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
}


@dataclass(frozen=True, eq=False)
class Line:
    """One instance's signal over time, and the times [s] at which it changed its set, with what to call that."""

    name: str
    values: NDArray[np.float64]
    changes: tuple[tuple[float, str], ...] = ()


def _scale(peak: float, unit: str) -> tuple[float, str]:
    """Millimetres where metres would be small numbers."""
    return (1e3, "mm") if unit == "m" and 0.0 < peak < 0.2 else (1.0, unit)


def _small_scale(lines: list[Line], unit: str) -> tuple[float, str]:
    """Scale and unit of the differences to the first line."""
    return _scale(max(float(np.max(np.abs(line.values - lines[0].values))) for line in lines[1:]), unit)


ZOOM = (0.5, 3.5)  # [s] before and after the first change of a set that the right column shows


def _mark(panel: Axes, lines: list[Line], text: bool) -> None:
    """Dashed lines where sets change, with what they change to."""
    low, high = panel.get_xlim()
    for when, what in sorted({change for line in lines for change in line.changes}):
        if low <= when <= high:
            panel.axvline(when, color="#444444", linewidth=0.9, linestyle=(0, (4, 3)), zorder=4)
            if text:
                panel.annotate(
                    f" {what}",
                    (when, 0.02),
                    xycoords=("data", "axes fraction"),
                    fontsize=9,
                    color="#444444",
                    bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0},
                )


def draw(path: Path, title: str, subtitle: str, time: NDArray[np.float64], signal: str, unit: str, lines: list[Line]) -> None:
    """One signal of all instances over time; below it, if there are several, what each differs from the first.

    Where a run is long and sets change, a second column shows the time around the first change.
    """
    scale, label = _scale(max(float(np.max(np.abs(line.values))) for line in lines), unit)
    changes = [when for line in lines for when, _ in line.changes]
    several, zoomed = len(lines) > 1, bool(changes) and time[-1] > 3 * sum(ZOOM)
    windows = [(time[0], time[-1])] + ([(max(time[0], min(changes) - ZOOM[0]), min(changes) + ZOOM[1])] if zoomed else [])
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            2 if several else 1,
            len(windows),
            sharex="col",
            sharey="row",
            squeeze=False,
            layout="constrained",
            figsize=(10.5 if zoomed else 8.0, 5.6 if several else 3.6),
            height_ratios=(3, 2) if several else (1,),
            width_ratios=(3, 2) if zoomed else (1,),
        )
        for column, (low, high) in enumerate(windows):
            shown = (time >= low) & (time <= high)
            for n, line in enumerate(lines):
                look = {"color": COLOURS[n % len(COLOURS)], "label": line.name, "linewidth": 1.8 if several and n == 0 else 1.1}
                axes[0, column].plot(time[shown], scale * line.values[shown], **look)
                if n > 0:
                    axes[1, column].plot(time[shown], _small_scale(lines, unit)[0] * (line.values - lines[0].values)[shown], **look)
            axes[-1, column].set_xlim(low, high)
            axes[-1, column].set_xlabel("time in s")
            for row, panel in enumerate(axes[:, column]):
                _mark(panel, lines, row == 0 and column == len(windows) - 1)
        axes[0, 0].set_ylabel(f"{signal} in {label}")
        axes[0, 0].set_title(subtitle, fontsize=9, color="#444444")
        axes[0, -1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(lines), borderaxespad=0.2)
        if several:
            who = lines[1].name if len(lines) == 2 else "each"
            axes[1, 0].set_ylabel(f"{who} \u2212 {lines[0].name}\nin {_small_scale(lines, unit)[1]}")
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
        figure.align_ylabels()
        try:
            with whole(path) as part:
                figure.savefig(part, metadata={"Software": None} if path.suffix == ".png" else None)
        finally:
            plt.close(figure)
