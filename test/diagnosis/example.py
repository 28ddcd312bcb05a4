# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Makes the recordings of sil/recordings/friction: a vehicle whose damper also rubs, which its model file does not know.

example.py [DIR]
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import numpy as np
from hidden import cases, plants, roads
from hidden.bench import Bench, Drive
from hidden.effects import FORMS
from hidden.energy import Noise
from hidden.solver import knots

STATED = {"m_b": 400.0, "m_w": 45.0, "c": 22e3, "d": 1500.0, "c_t": 210e3}
TRUE = {"m_b": 403.0, "m_w": 44.8, "c": 22.1e3, "d": 1492.0, "c_t": 210.9e3}  # within 1 %
TRAIN, HOLDOUT, RATE = 8.0, 4.0, 500.0  # s, s, Hz
FRICTION = 0.04  # of the greatest damper force


def make(folder: Path) -> list[Path]:
    """model.toml and the recordings, training then hold-out."""
    names = {role: known[0] for role, known in plants.NAMES.items()}
    plant = plants.Plant("quarter", TRUE, STATED, dict.fromkeys(STATED, 0.01), names)
    drives = []
    for seed, name, duration in ((1, "train.csv", TRAIN), (2, "holdout.csv", HOLDOUT)):
        time = knots(duration)
        road = roads.iso8608(np.random.default_rng(seed), "C", 20.0)(time) * roads.fade_in(time, 1.0)
        drives.append(Drive(name, "road of class C at 20 m/s", road, 0.0))
    noise = {"a_body": Noise(0.02), "a_wheel": Noise(0.1), "deflection": Noise(1e-4)}
    bench = Bench(plant, RATE, noise, 0.0, tuple(drives), False, (1,))
    form = next(f for f in FORMS if (f.kind, f.name) == ("coulomb_friction", "arctangent"))
    change = form.make(np.random.default_rng(3), bench.place("damper"))(FRICTION)
    print(f"hidden: {change.parameters}")
    return cases.Case(1, 0, "example", bench, (cases.Effect(form, "damper", FRICTION, change),)).write(folder)


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "sil" / "recordings" / "friction")
