# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One recording written in many forms: separators, decimals, encodings, headers, preambles, units, stamps, rasters.

The signals are sums of sines; nothing here uses the readers. `FORMS` are read without a doubt; `DOUBTFUL` are refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

STEP = 0.005  # [s]
COUNT = 401
UNITS = {"x_in": "m", "acc": "m/s^2", "turning": "rad/s", "tau": "N*m"}
G, TURN, DEGREE = 9.80665, 60.0 / (2.0 * math.pi), 180.0 / math.pi
SI = ["time [s]", "x_in [m]", "acc [m/s^2]", "turning [rad/s]", "tau [N*m]"]
BARE = ["time", "x_in", "acc", "turning", "tau"]
START = datetime(2023, 11, 30, 23, 59, 59, 250000)  # midnight lies within
FAST = 8.0  # [rad/s] the highest frequency in the signals


@dataclass(frozen=True)
class Form:
    """A file, the options that it needs, and how far [of the largest value] a reader may be off by rounding or raster."""

    data: bytes
    options: tuple[str, ...] = ()
    tolerance: float = 1e-8  # nine digits


def signals(time: np.ndarray) -> list[np.ndarray]:
    """x_in, acc, turning, tau in SI."""
    return [
        0.021 * np.sin(5.0 * time) + 0.004,
        6.3 * np.cos(FAST * time) - 1.7,
        2.9 * np.sin(3.0 * time + 0.4),
        41.0 * np.cos(4.0 * time + 1.0),
    ]


def table(
    header: Sequence[str] = SI,
    between: str = ",",
    decimal: str = ".",
    scale: Sequence[float] = (1.0,) * 5,
    digits: str = "%.9g",
    before: str = "",
    units: Sequence[str] = (),
    stamp: Callable[[float], str] | None = None,
    end: str = "\n",
    quoted: bool = False,
    more: Sequence[str] = (),
    step: float = STEP,
    encoding: str = "utf-8",
) -> bytes:
    """The recording as text; `scale` are units of the file per SI unit, `more` cells that end each row."""
    time = np.arange(round((COUNT - 1) * STEP / step) + 1) * step
    columns = [time, *signals(time)]
    rows = [list(header)] + ([list(units)] if units else [])
    for values in zip(*columns, strict=True):
        cells = [(digits % (value * factor)).replace(".", decimal) for value, factor in zip(values, scale, strict=True)]
        if stamp is not None:
            cells[0] = stamp(float(values[0]))
        rows.append([*cells, *more])
    mark = '"' if quoted else ""
    return (before + end.join(between.join(f"{mark}{cell}{mark}" for cell in row) for row in rows) + end).encode(encoding)


def _iso(time: float) -> str:
    return (START + timedelta(seconds=time)).isoformat(timespec="milliseconds")


def _german(time: float) -> str:
    return (START + timedelta(seconds=time)).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3]


def _named(*units: str) -> list[str]:
    return [f"{name} [{unit}]" for name, unit in zip(BARE, units, strict=True)]


def _two_clocks() -> bytes:
    time = np.arange(COUNT) * STEP
    rows = ["time [s],x_in [m],acc [m/s^2],time [s],turning [rad/s],tau [N*m]"]
    x, acc, _turning, _tau = signals(time)
    later = signals(time + 0.5 * STEP)
    rows += [
        f"{t:.9g},{a:.9g},{b:.9g},{t + 0.5 * STEP:.9g},{c:.9g},{d:.9g}" for t, a, b, c, d in zip(time, x, acc, *later[2:], strict=True)
    ]
    return "\n".join(rows).encode()


def _lined(step: float) -> float:
    """Straight lines between rows miss a sine by (frequency*step)^2/8 of its size; 2 for the part of it in the largest value."""
    return 2.0 * (FAST * step) ** 2 / 8.0


_PARENS = ["time (s)", "x_in (m)", "acc (m/s^2)", "turning (rad/s)", "tau (N*m)"]
_INCA = ["time [s]", "x_in\\XCP:1 [m]", "acc\\XCP:1 [m/s2]", "turning\\CAN:2 [rad/s]", "tau\\XCP:1 [Nm]"]
_OTHERS = ["time [s]", "Weg (Rad) 1 [mm]", "Accel. body", "n=w.x[3] [1/min]", "M_Antrieb"]
_CALLED = ("x_in=Weg (Rad) 1", "acc=Accel. body [g]", "turning=n=w.x[3]", "tau=M_Antrieb [Nm]")

FORMS: dict[str, Form] = {
    "plain": Form(table()),
    # separators and decimals
    "semicolons": Form(table(between=";")),
    "semicolons, decimal commas": Form(table(between=";", decimal=",")),
    "tabs": Form(table(between="\t")),
    "tabs, decimal commas": Form(table(between="\t", decimal=",")),
    "bars": Form(table(between="|")),
    "blank behind commas": Form(table(between=", ")),
    "aligned by blanks": Form(table(between="   ", digits="%17.9e")),
    "one blank": Form(table([name.replace(" ", "") for name in SI], between=" ")),
    "quoted": Form(table(quoted=True)),
    "quoted, decimal commas between commas": Form(table(quoted=True, decimal=",")),
    "separator at each end": Form(table(between=";", decimal=",", more=("",))),
    "separator at each end, header too": Form(table([*SI, ""], more=("",))),
    "exponents of Fortran": Form(table(digits="%.9E").replace(b"E+", b"D+").replace(b"E-", b"D-")),
    # encodings and line ends
    "UTF-8 with a mark": Form(table(encoding="utf-8-sig")),
    "UTF-16 with a mark": Form(table(encoding="utf-16")),
    "UTF-16 big-endian": Form(b"\xfe\xff" + table(between="\t", encoding="utf-16-be")),
    "UTF-16 without a mark": Form(table(between=";", encoding="utf-16-le")),
    "UTF-32": Form(table(encoding="utf-32")),
    "Latin-1": Form(table(_named("s", "µm", "m/s²", "°/s", "N·m"), ";", ",", (1, 1e6, 1, DEGREE, 1), encoding="latin-1")),
    "lines of Windows": Form(table(end="\r\n")),
    "lines of old Macs": Form(table(end="\r")),
    # what stands above
    "sep=": Form(table(between=";", decimal=",", before="sep=;\r\n", end="\r\n")),
    "sep= in quotes, UTF-16": Form(table(between="\t", before='"sep=\t"\n', encoding="utf-16")),
    "title and blank line": Form(table(before="Run 12, rig 3\nOperator: NN\n\n")),
    "comments": Form(table(before="# logger 1.2\n# rate 200 Hz\n")),
    "keys and values": Form(table(between=";", decimal=",", before="Rate;200\nDate;30.11.2023\nChannels;5\n\n")),
    "as wide as the table": Form(table(before="a,b,c,d,e\nx,1,y,2,z\n\n")),
    "header as a comment": Form(table(["# " + SI[0], *SI[1:]])),
    "several headers": Form(
        table(
            BARE,
            "\t",
            units=["s", "m", "m/s^2", "rad/s", "N*m"],
            before="Writer\t2\n***End_of_Header***\n\nSamples\t401\n***End_of_Header***\n",
        )
    ),
    "comment at the end": Form(table() + b"# end\n\n"),
    # headers
    "parentheses": Form(table(_PARENS)),
    "braces": Form(table([name.replace("(", "{").replace(")", "}") for name in _PARENS])),
    "slashes": Form(table(["time / s", "x_in / m", "acc / m/s^2", "turning / rad/s", "tau / N*m"], ";")),
    "in": Form(table(["time in s", "x_in in mm", "acc in m/s2", "turning in 1/min", "tau in Nm"], scale=(1, 1e3, 1, TURN, 1))),
    "units in names": Form(table(["t_ms", "x_in_mm", "acc_m_s2", "turning_rpm", "tau_Nm"], scale=(1e3, 1e3, 1, TURN, 1))),
    "units in row two": Form(table(BARE, units=["s", "m", "m/s^2", "rad/s", "N*m"])),
    "units in row two, in brackets": Form(
        table(BARE, ";", ",", (1, 1e3, 1 / G, DEGREE, 1e-3), units=["[s]", "[mm]", "[g]", "[deg/s]", "[kNm]"])
    ),
    "units and types below names": Form(table(BARE, units=["s", "m", "m/s^2", "rad/s", "N*m\nfloat,float,float,float,float"])),
    "units above names": Form(table(BARE, before="s,m,m/s^2,rad/s,N*m\n")),
    "line ends within names": Form(table([name.replace(" ", "\n") for name in SI], quoted=True)),
    "other letters": Form(table(["TIME [s]", "X_In [m]", "Acc [m/s^2]", "TURNING [rad/s]", "Tau [N*m]"])),
    "devices behind names": Form(table(_INCA)),
    "names of their own": Form(table(_OTHERS, scale=(1, 1e3, 1 / G, TURN, 1)), _CALLED),
    "no header": Form(
        table().split(b"\n", 1)[1], tuple(f"{name}=column {k} [{unit}]" for k, (name, unit) in enumerate({"time": "s", **UNITS}.items(), 1))
    ),
    # units
    "units of DBC and A2L": Form(table(_named("ms", "mm", "m/s2", "1/min", "Nm"), scale=(1e3, 1e3, 1, TURN, 1))),
    "units of sensors": Form(table(_named("us", "cm", "mg", "dps", "Ncm"), scale=(1e6, 1e2, 1e3 / G, DEGREE, 1e2))),
    "units in words": Form(table(_named("sec", "Meter", "m/s/s", "deg/sec", "Nmm"), scale=(1, 1, 1, DEGREE, 1e3))),
    "units in capitals": Form(table(_named("S", "MM", "M/S^2", "RPM", "KNM"), scale=(1, 1e3, 1, TURN, 1e-3))),
    "units with negative powers": Form(table(_named("s", "m", "m s^-2", "min⁻¹", "N.m"), scale=(1, 1, 1, TURN, 1))),
    # stamps
    "dates and times": Form(table(BARE[:1] + SI[1:], stamp=_iso)),
    "dates with points": Form(table(BARE[:1] + SI[1:], ";", ",", stamp=_german)),
    "times of day": Form(table(stamp=lambda time: _iso(time)[11:])),
    "dates beside times of day": Form(table(["Date;Time", *SI[1:]], ";", ",", stamp=lambda time: _german(time).replace(" ", ";"))),
    "seconds since 1970": Form(
        table(stamp=lambda time: f"{1.7e9 + time:.3f}"), tolerance=1e-5
    ),  # 2.4e-7 s of 1.7e9 s, times 8 rad/s, 6 values
    "rows without a clock": Form(table(["nr", *SI[1:]], stamp=lambda time: str(round(time / STEP))), ("time=@5ms",)),
    "a number for each row": Form(
        b"\n".join(b",".join((str(k - 1).encode() if k else b"", line)) for k, line in enumerate(table().strip().split(b"\n")))
    ),
    # columns that nobody needs, rasters
    "text": Form(table([*SI, "state", "note"], more=("RUN", "n. a."))),
    "names that are there twice": Form(table([*SI, "q [V]", "q [V]"], more=("1", "2"))),
    "a column with a time of its own": Form(_two_clocks(), tolerance=_lined(STEP)),
    "half as many rows": Form(table(step=2 * STEP), tolerance=_lined(2 * STEP)),
}

# what is refused, a word of the reason, and what mends it: options, or the file as it is exported anew
DOUBTFUL: dict[str, tuple[Form, str, Form]] = {
    "no units": (Form(table(BARE)), "has no unit", Form(table(BARE), tuple(f"{n}={n} [{u}]" for n, u in {"time": "s", **UNITS}.items()))),
    "commas for everything": (Form(table(decimal=",")), "commas part columns and decimals", Form(table(between=";", decimal=","))),
    "two that differ": (
        Form(table([*SI, "acc [m/s^2]"], more=("1",))),
        "is there twice",
        Form(table([*SI, "acc [m/s^2]"], more=("1",)), ("acc=acc#1",)),
    ),
    "1/s for an angular rate": (
        Form(table(_named("s", "m", "m/s^2", "1/s", "Nm"))),
        "may be rad/s or",
        Form(table(_named("s", "m", "m/s^2", "1/s", "Nm")), ("turning=turning [rad/s]",)),
    ),
}
