# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Campaign: a generated filter against the independent one of independent.c, for an hour of samples, in double and in float."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import gate
import independent
import numpy as np

import penode_gen

HERE = Path(__file__).parent
LIMITS = {np.float64: 1e-9, np.float32: independent.FLOAT}  # of a standard deviation


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=int, default=3600)
    parser.add_argument("--as", dest="name", default="ekf hour campaign")
    options = parser.parse_args()
    good, figures = True, {"seconds": options.seconds}
    for name in ("layered", "folded"):
        model = penode_gen.load(HERE / "models" / f"{name}.toml")
        for dtype, limit in LIMITS.items():
            with tempfile.TemporaryDirectory() as place:
                found = independent.difference(model, dtype, 1000 * options.seconds, Path(place))
            told = f"{found.state:.2g}, covariance {found.covariance:.2g}; after kinks {found.at_kinks:.2g}, {found.share:.2%}"
            told += f"; more than {independent.FLOAT:g} off in {found.beyond:.4%}"
            wrong = bool(max(found.state, found.covariance, found.at_kinks) > limit)
            good &= gate.report(f"{options.name}: {name}, {dtype.__name__}: {told}", [f"above {limit}"] * wrong)
            figures |= {f"{name} {dtype.__name__}": f"{found.state:.1e}"}
            if dtype is np.float32:
                figures |= {f"{name} at kinks": f"{found.at_kinks:.1e}", f"{name} share": f"{found.share:.2%}"}
                figures |= {f"{name} beyond": f"{found.beyond:.4%}"}
    gate.keep(options.name, figures)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
