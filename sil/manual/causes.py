# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The page of the causes, which `causes.py` prints: from the catalogue of the diagnosis and the campaign in test/diagnosis/CAMPAIGN.md."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import penode_gen
from penode_gen.model import GROUND, Model
from penode_sil.diagnosis import catalogue
from penode_sil.diagnosis.catalogue import actuators, channels, drives, form, networks, others
from penode_sil.diagnosis.plant.plant import Place, places
from penode_sil.diagnosis.result import plain

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGN = ROOT / "test/diagnosis/CAMPAIGN.md"
EXAMPLE = """
[model]
name = "example"
sample_time = "1 ms"
[parameters]
m = { value = 1, unit = "kg" }
c = { value = 1, unit = "N/m" }
d = { value = 1, unit = "N*s/m" }
[inputs]
road = { unit = "m" }
push = { unit = "N" }
[bodies]
upper = { mass = "m" }
lower = { mass = "m" }
third = { mass = "m" }
[elements]
drive = { between = ["upper", "ground"], law = "expression", force = "-push" }
spring = { between = ["upper", "lower"], law = "linear_spring", stiffness = "c" }
damper = { between = ["upper", "lower"], law = "linear_damper", damping = "d" }
mount = { between = ["lower", "ground"], law = "linear_spring", stiffness = "c" }
tyre = { between = ["lower", "road"], law = "linear_spring", stiffness = "c" }
rail = { between = ["third", "ground"], law = "linear_damper", damping = "d" }
loss = { between = ["third", "upper"], law = "linear_damper", damping = "d" }
coil = { between = ["third", "lower"], law = "linear_spring", stiffness = "c" }
[outputs]
z = { value = "z_upper", unit = "m" }
[sensors]
travel = { value = "z_upper", unit = "m", noise = 1e-3 }
"""
OWN_UNIT = "that of the signal"


@dataclass
class Known:
    """Entries of a kind: where it can be, and its parameters with their units."""

    where: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)

    def add(self, where: str, sizes: Mapping[str, tuple[str, float]]) -> None:
        if where not in self.where:
            self.where.append(where)
        self.units |= {name: unit for name, (unit, _) in sizes.items()}


class _Any(dict[tuple[int, str], float]):
    """1 for every number that a kind asks for."""

    def __missing__(self, key: tuple[int, str]) -> float:
        return 1.0


def example() -> Model:
    """A model with a place of each role, some without a spring or a damper."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "example.toml"
        file.write_text(EXAMPLE, encoding="utf-8")
        return penode_gen.load(file)


def said(place: Place) -> str:
    """What a page calls a place of that role."""
    if place.role == "tyre":
        return "between a body and a measured road (tyre)"
    if place.role == "body":
        return "on a body (against ground)"
    return "between a body and ground" if GROUND in place.ends else "between two bodies"


def known() -> dict[str, Known]:
    """Each kind of the catalogue, by asking it for its forms in an example."""
    model = example()
    found = {kind: Known() for kind in catalogue.MEANING}
    t = np.arange(1000, dtype=np.float64) * 1e-3
    s = 0.01 * np.sin(40.0 * t)
    motion = form.Motion.of([form.Moved(s, 0.4 * np.cos(40.0 * t), t, {"+ F_spring": 1000.0 * np.abs(s)})], 10.0)
    sizes = form.Sizes(_Any(), {}, True, 1.0, motion.parts[0])
    for file in catalogue.FILES:
        for index, place in enumerate(places(model)):
            for one in file.forms(model, index, place, motion):
                found[one.kind].add(said(place), file.sizes(one, sizes))
    trained = replace(places(model)[0], trained=(("network", "s", -0.005, 0.005, True),))
    for one in networks.forms(model, 0, trained, motion):
        found[one.kind].add("an element with a network", networks.sizes(one, sizes))
    for one in (*drives.inputs(model, 1), *drives.bent(model, 1, actuators.Drive([s], t[1], t[10], 0.16))):
        found[one.kind].add("an input", drives.sizes(one, sizes, OWN_UNIT))
    for one in drives.sensors(model, 1):
        found[one.kind].add("a sensor", drives.sizes(one, sizes, OWN_UNIT))
    for kind, one_known in found.items():
        if not one_known.where:
            signal = "an input" if kind.startswith("input_") else "a sensor" if kind.startswith("sensor_") else ""
            one_known.where.append((others.WHERE | channels.WHERE).get(kind, signal))
    found["input_hold"].units["period"] = "s"
    for kind, units in others.UNITS.items():
        found[kind].units |= units
    return found


def meanings() -> dict[str, dict[str, str]]:
    """Meaning of the parameters of each kind."""
    files = (*catalogue.FILES, drives, channels, others)
    return {kind: text for file in files for kind, text in getattr(file, "PARAMETERS", {}).items()}


def rates() -> dict[str, tuple[int, int]]:
    """For each kind that the kept campaign hid by itself: cases in which it was named rightly, and all cases."""
    block = re.split(r"^## ", CAMPAIGN.read_text(encoding="utf-8"), flags=re.MULTILINE)[1]
    table = block.split("\nkind ", 1)[1].split("\n\n", 1)[0]
    found = {}
    for line in table.splitlines()[1:]:
        kind, counts = line.split()[0], re.findall(r"(\d+)/(\d+)", line)
        found[kind] = (sum(int(right) for right, _ in counts), sum(int(all_) for _, all_ in counts))
    return found


def rivals(kind: str) -> Iterator[tuple[str, str]]:
    """Kinds that recordings may not tell from one, with what would."""
    for pair, how in sorted(catalogue.RIVALS.items(), key=lambda p: sorted(p[0])):
        if kind in pair:
            yield next(iter(pair - {kind})), how


def _section(kind: str, of: Known, means: Mapping[str, str], rate: tuple[int, int] | None) -> list[str]:
    lines = [f"## {kind}", "", catalogue.MEANING[kind], "", f"Where it can be: {'; '.join(of.where)}.", ""]
    names = list(dict.fromkeys([*of.units, *means]))
    if names:
        lines += ["| parameter | unit | meaning |", "|---|---|---|"]
        lines += [f"| `{name}` | {of.units.get(name, OWN_UNIT)} | {means.get(name, '')} |" for name in names] + [""]
    found = list(rivals(kind))
    if found:
        lines += ["| can look like | what tells them apart |", "|---|---|"]
        lines += [f"| [{plain(other)}](#{other}) | {how} |" for other, how in found] + [""]
    said_rate = (
        f"named rightly in {rate[0]} of {rate[1]} simulated cases in which it was hidden alone" if rate else "not in the kept campaign"
    )
    return [*lines, f"Measured: {said_rate}.", ""]


def page() -> str:
    text = CAMPAIGN.read_text(encoding="utf-8")
    draw = re.sub(r"^# Campaign of", "", text.splitlines()[0]).strip()
    of, means, rate = known(), meanings(), rates()
    lines = [
        "# The causes",
        "",
        f"`penode diagnose` can name {len(catalogue.MEANING)} kinds of cause. Between ends that turn, forces are torques, with",
        "the units of those. A positive force pulls the two ends of an element together; positive deflection and rate,",
        "the first end less the second, are called rebound.",
        f"Hit rates are from the campaign of {draw} (`test/diagnosis/CAMPAIGN.md`); a kind is counted where it was hidden by itself.",
        "",
        "| kind | meaning | named rightly |",
        "|---|---|---|",
    ]
    for kind, meaning in catalogue.MEANING.items():
        hit = f"{rate[kind][0]} of {rate[kind][1]}" if kind in rate else "-"
        lines.append(f"| [`{kind}`](#{kind}) | {meaning} | {hit} |")
    lines.append("")
    for kind in catalogue.MEANING:
        lines += _section(kind, of[kind], means.get(kind, {}), rate.get(kind))
    return "\n".join(lines)


if __name__ == "__main__":
    print(page())
