# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""report.html: one page that needs nothing else and tells what is wrong, why, how sure that is, and what knowing it
gains.

From the top: the answer in a sentence, how sure it is, what it costs, what to do next; per sensor and recording the residual over time, its
spectrum above the noise floor, its coherence with the input and a test for whiteness; the causes with parameters, intervals, confidence and
rivals; the restoring force of each element over deflection and rate, measured, nominal and extended; the gain on held-out data with the
generated C, samples outside of the trained range marked; the change of the model file and what it costs on a Cortex-M4F; findings in the
data; the error of the deployed step; the terms. Figures zoom, move and read out where scripts run; all of the page can be read without, on
paper, on a phone, in light and in dark. Figures are data (figure.py), the page is templates/report.html.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import jinja2

import penode_gen
from penode_gen.emission.model_c import compiled_templates
from penode_gen.model import Model
from penode_gen.resources import resource

from ...output import whole
from .. import catalogue
from ..advice import doubts
from ..reliability import line
from ..result import VERDICTS, Diagnosis, place, plain
from ..study.residual import Channel, Shown
from . import figure as fig
from .changes import difference, price
from .figure import pretty
from .forces import surface
from .panels import panel
from .words import between, command, common, duration, gains, headline, key_figures, lead, percent, relative, sentence, value

BUDGET = 60_000  # points of all lines over time together, so that the page stays small


def write(path: Path, model: Model, d: Diagnosis, extended: Path) -> None:
    """The page for a diagnosis that has `shown`; `extended`: the extended model file."""
    text = render(model, d, extended)
    with whole(path) as part:
        part.write_text(text, encoding="utf-8")


def render(model: Model, d: Diagnosis, extended: Path) -> str:
    """The same as text."""
    folder = jinja2.FileSystemLoader(resource("penode_sil.diagnosis", "templates"))
    environment = jinja2.Environment(
        loader=folder,
        bytecode_cache=compiled_templates(),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "plain": plain,
        "pretty": pretty,
        "percent": percent,
        "value": value,
        "sentence": sentence,
        "duration": duration,
    }
    shown: Shown = d.shown
    train, held = (ordered(channels) for channels in (shown.train, shown.holdout))
    points = max(BUDGET // (2 * max(len(train) + len(held), 1)), 400)
    return environment.get_template("report.html").render(
        model=model,
        d=d,
        version=penode_gen.VERSION,
        headline=headline(d),
        verdict=VERDICTS[d.verdict],
        lead=lead(d, train),
        tiles=key_figures(d),
        doubts=doubts(d),
        line=line,
        train=[panel(c, points) for c in train],
        held=[panel(c, points) for c in held],
        meaning=catalogue.MEANING,
        place=place,
        between=between,
        common=common,
        relative=relative,
        surfaces=[surface(s) for s in shown.surfaces],
        gains=gains(d),
        command=command(d),
        diff=difference(model.path, extended),
        price=price(model, extended),
        legend=fig.legend,
        WIDE=fig.WIDE,
        HIGH=fig.HIGH,
    )


def ordered(channels: Sequence[Channel]) -> list[Channel]:
    """The most wrong first."""
    return sorted(channels, key=lambda c: -c.level(c.before) / max(c.noise, 1e-300))
