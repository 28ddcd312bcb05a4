# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""report.html of a training: one file, pictures inside, from a Trained alone."""

from __future__ import annotations

import base64
import html
import io
from pathlib import Path

import numpy as np

from ..output import whole
from ..plots import COLOURS, STYLE, plt
from .result import Error, Force, Trained, beside_noise

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}</title>
<style>body{{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}}h1{{font-size:1.5rem}}\
h2{{font-size:1.1rem;margin-top:2rem}}
table{{border-collapse:collapse}}td,th{{padding:.2rem .8rem .2rem 0;text-align:right}}\
td:first-child,th:first-child{{text-align:left}}th{{border-bottom:1px solid #999;font-weight:600}}
img{{max-width:100%}}.warn{{border-left:4px solid #D55E00;padding-left:.8rem}}code{{word-break:break-all}}</style></head><body>
<h1>{title}</h1>
{body}
</body></html>
"""


def write(path: Path, t: Trained) -> None:
    """The page, whole or not at all."""
    verdict = "Keep the nominal model." if t.rejected else "The fit converged." if t.converged else "The fit did not converge."
    kind = "" if t.converged and not t.rejected else " class=warn"
    parts = [f"<p{kind}>{verdict} {t.seconds:.1f} s of processor time; {html.escape(beside_noise(t))}.</p>"]
    parts += [f"<p class=warn>{html.escape(n)}</p>" for n in t.notes]
    for force in t.forces:
        parts.append(f"<h2>{html.escape(force.name)}</h2>\n<p>{html.escape(_about(force))}</p>\n{_image(force)}")
    if t.unknown:
        parts.append(
            "<h2>What the recordings do not determine</h2>\n<ul>" + "".join(f"<li>{html.escape(u.text)}</li>" for u in t.unknown) + "</ul>"
        )
    if t.parameters:
        rows = "".join(
            f"<tr><td>{n}</td><td>{v:.6g} {u}</td><td>{s:.2g}</td><td>{b:.6g}</td></tr>" for n, (v, s, b, u) in t.parameters.items()
        )
        parts.append(f"<h2>Parameters</h2>\n<table><tr><th>name</th><th>value</th><th>1 sigma</th><th>before</th></tr>{rows}</table>")
    for title, errors in (("training recordings", t.training), ("held-out recordings", t.holdout)):
        parts += [f"<h2>RMS error on {title}</h2>\n{_table(errors)}"] if errors else []
    if t.holdout:
        parts.append(
            f"<p>{100 * t.outside:.2f} % of the held-out samples lie outside of the trained range; for the last column "
            f"{100 * t.masked:.1f} % are left out.</p>"
        )
    if t.figures:
        rows = "".join(
            f"<tr><td>{html.escape(f.signal)} [{html.escape(f.unit)}]</td><td>{html.escape(f.recording)}</td><td>{f.role}</td>"
            f"<td>{f.nominal:.4g}</td><td>{f.trained:.4g}</td></tr>"
            for f in t.figures
        )
        head = "<tr><th>signal</th><th>recording</th><th>role</th><th>nominal model</th><th>trained model</th></tr>"
        parts.append(f"<h2>RMS error of the written model</h2>\n<p><code>{html.escape(t.command)}</code></p>\n<table>{head}{rows}</table>")
    facts = {"seed": t.seed, **t.versions, **t.digests}
    parts.append(
        "<h2>Made from</h2>\n<table>"
        + "".join(f"<tr><td>{html.escape(str(k))}</td><td><code>{html.escape(str(v))}</code></td></tr>" for k, v in facts.items())
        + "</table>"
    )
    with whole(path) as part:
        part.write_text(_PAGE.format(title=html.escape(f"{t.model}: trained networks"), body="\n".join(parts)), encoding="utf-8")


def _about(f: Force) -> str:
    ranges = ", ".join(f"{a:.3g} to {b:.3g} {u}" for a, b, u in zip(f.low, f.high, f.units, strict=True))
    text = f"Trained as a {f.way}, over {ranges}. Beyond that range it is extrapolated, not measured."
    text += f" {f.pieces} straight pieces." if f.pieces else ""
    return text + "".join(f" {b}." for b in f.broken)


def _table(errors: tuple[Error, ...]) -> str:
    head = "".join(
        f"<th>{h}</th>"
        for h in (
            "signal",
            "before",
            "after",
            "in the generated C",
            "noise",
            "after over stated noise",
            "inside the trained range",
            "gained",
        )
    )
    rows = []
    for e in errors:
        room = e.before**2 - e.noise**2
        gained = f"{100 * (e.before**2 - e.after**2) / room:.1f} %" if room > 0.0 else ""
        cells = (e.before, e.after, e.deployed, e.noise, e.ratio, e.inside)
        rows.append(
            f"<tr><td>{html.escape(e.signal)} [{html.escape(e.unit)}]</td>"
            + "".join(f"<td>{'' if v is None else f'{v:.4g}'}</td>" for v in cells)
            + f"<td>{gained}</td></tr>"
        )
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def _image(f: Force) -> str:
    """Force with its bands, and below it where the recordings were."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            2, len(f.x), squeeze=False, sharex="col", height_ratios=(4, 1), figsize=(4.5 + 3.5 * len(f.x), 4.4), layout="constrained"
        )
        for k, (x, y, s) in enumerate(zip(f.x, f.y, f.sigma, strict=True)):
            top, low = axes[:, k]
            top.fill_between(x, y - 2 * s, y + 2 * s, color=COLOURS[5], alpha=0.3, linewidth=0, label="2 sigma")
            top.fill_between(x, y - s, y + s, color=COLOURS[5], alpha=0.5, linewidth=0, label="1 sigma")
            top.plot(x, y, color=COLOURS[0], label="trained")
            top.set_ylabel(f"{f.name} in {f.output}")
            top.legend(loc="upper left")
            share = f.counts[k] / max(float(np.sum(f.counts[k])), 1.0)
            low.bar(f.edges[k][:-1], 100.0 * share, np.diff(f.edges[k]), align="edge", color="#888888", log=True)
            low.set_ylabel("visited, %")
            low.set_xlabel(f"input {k + 1} in {f.units[k]}" + (", the others at 0" if len(f.x) > 1 else ""))
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", metadata={"Software": None})
        plt.close(figure)
    return f'<img alt="{html.escape(f.name)} with its band" src="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}">'
