# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Scores a diagnosis.json against the truth about its recordings, and adds many scores up to tables."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import permutations
from math import ceil, sqrt

from claims import claims, judged_by, right as rightly, unlikely

OUTSIDE = "outside_taxonomy"
MOST_ALTERNATIVES = 4  # who lists more has not decided
EXACT = 1.0  # chi-square that an exact equivalent may leave of an effect
# stratum -> share of right answers that is asked for, and the least share of any kind in it
DEMANDED = {
    "single_common": (0.97, 0.85),
    "single_foreign": (0.90, 0.70),
    "pair": (0.85, 0.0),
    "triple": (0.60, 0.0),
    "hard": (0.90, 0.0),
    "null": (1.0, 0.0),
    "null_hard": (0.99, 0.0),
    "outside": (0.90, 0.0),
}


def _named(item: object) -> tuple[str, str]:
    """Kind and place of a cause or an alternative, which may be a bare kind."""
    return (str(item.get("kind")), str(item.get("where", ""))) if isinstance(item, Mapping) else (str(item), "")


def matches(cause: Mapping, answer: Mapping) -> bool:
    """Whether a cause is this answer: kind, place, and for a wrong parameter which one."""
    kind, where = _named(cause)
    if kind != answer["kind"] or (answer["where"] and where not in answer["where"]):
        return False
    return "parameter" not in answer or list(cause.get("parameters") or ()) == [answer["parameter"]]


def explains(cause: Mapping, effect: Mapping, told: bool = True) -> bool:
    """The cause is the effect or one of its rivals; with `told`, it lists the true kind and every exact equivalent."""
    if not (matches(cause, effect) or any(matches(cause, rival) for rival in effect["rivals"])):
        return False
    others = cause.get("alternatives") or ()
    named = {_named(cause)[0], *(_named(o)[0] for o in others if len(others) <= MOST_ALTERNATIVES)}
    return not told or {effect["kind"], *(r["kind"] for r in effect["rivals"] if r["left"] < EXACT)} <= named


def pairing(causes: Sequence[Mapping], effects: Sequence[Mapping], bound: float, told: bool = True) -> dict[int, int] | None:
    """Cause -> effect if every cause explains another effect and only effects below the bound are left; else None."""
    for order in permutations(range(len(effects)), len(causes)):
        left = [e for i, e in enumerate(effects) if i not in order]
        if all(explains(c, effects[i], told) for c, i in zip(causes, order, strict=True)) and all(e["energy"] < bound for e in left):
            return dict(enumerate(order))
    return None


def outcome(truth: Mapping, causes: Sequence[Mapping], verdict: str | None) -> str:
    """What a diagnosis is worth, in a word or two; "right" if it is."""
    effects, bound = truth["effects"], truth["bound"]
    kinds, faint = [_named(c)[0] for c in causes], all(e["energy"] < bound for e in effects)
    if not effects:
        claims = causes or verdict in ("explained", "partly_explained", "unexplained")
        return "false alarm" if claims else "right" if verdict == "no_discrepancy" else "open"
    if not causes and faint and verdict in ("not_identifiable", "no_discrepancy"):
        return "right"
    if effects[0]["kind"] == OUTSIDE:
        honest = kinds == [OUTSIDE] or (not causes and verdict == "unexplained")
        return "right" if honest else "wrong name" if causes else "missed"
    if not causes or kinds == [OUTSIDE]:
        return "missed"
    if pairing(causes, effects, bound) is not None:
        return "right"
    if pairing(causes, effects, bound, told=False) is not None:
        return "equivalent not told"
    if all(any(explains(c, e) for c in causes) for e in effects if e["energy"] >= bound):
        return "extra name"
    return "part missed" if all(any(explains(c, e) for e in effects) for c in causes) else "wrong name"


def _rightly(causes: Sequence[Mapping], truth: Mapping) -> list[bool]:
    return rightly(causes, truth["effects"], lambda c, e: explains(c, e, told=False))


def score(
    truth: Mapping,
    diagnosis: Mapping | None,
    seconds: float,
    why: str = "",
    measured: Mapping[str, float] | None = None,
    nominal: Mapping[str, float] | None = None,
) -> dict:
    """One row of the table. `diagnosis` None: the command gave none, `why` says so (crash, timeout).

    `measured`: RMSE of the extended model on the hold-out, by who does not believe the diagnosis; `nominal`: parameters of the model file.
    """
    row = {
        "case": f"{truth['seed']}:{truth['index']}",
        "stratum": truth["stratum"],
        "seconds": round(seconds, 2),
        "compiling": round((diagnosis or {}).get("compile_seconds", 0.0), 2),
        "kinds": [e["kind"] for e in truth["effects"]],
        "forms": [e["form"] for e in truth["effects"]],
        "energies": [e["energy"] for e in truth["effects"]],
        "answer": [],
        "named": [],
        "unlikely": {},
        "verdict": None,
        "right": False,
        "why": why,
        "outcome": why.split(":")[0] or "no answer",
        "errors": [],
        "covered": [],
        "gain": {},
    }
    if diagnosis is None:
        return row
    causes, verdict = diagnosis.get("causes") or [], diagnosis.get("verdict")
    what = outcome(truth, causes, verdict)
    row |= {"answer": [" at ".join(_named(c)) for c in causes], "verdict": verdict, "right": what == "right", "outcome": what}
    row |= judged_by(diagnosis)
    named = [c for c in causes if isinstance(c, Mapping) and c.get("kind") != OUTSIDE]
    row["named"] = claims(named, _rightly(named, truth), nominal or {})
    row["unlikely"] = unlikely(diagnosis, lambda causes: _rightly(causes, truth), nominal or {})
    pairs = pairing(causes, truth["effects"], truth["bound"]) if what == "right" else None
    for i, k in (pairs or {}).items():
        effect, said = truth["effects"][k], causes[i].get("parameters") or {}
        if not effect["common"] or not matches(causes[i], effect):
            continue
        for name, value in effect["parameters"].items():
            got = said.get(name)
            if isinstance(got, Mapping) and got.get("value") is not None and value:
                row["errors"].append([f"{effect['kind']}.{name}", abs(got["value"] - value) / abs(value), effect["ratio"]])
                if got.get("ci95"):
                    row["covered"].append([f"{effect['kind']}.{name}", bool(got["ci95"][0] <= value <= got["ci95"][1])])
    for signal, gain in (diagnosis.get("gain") or {}).items():
        if signal in truth["noise_floor"] and isinstance(gain, Mapping) and gain.get("after_rmse") is not None:
            after = (measured or {}).get(signal, float(gain["after_rmse"]))
            row["gain"][signal] = [x / truth["noise_floor"][signal] for x in (float(gain["before_rmse"]), after)]
    row["inside"] = truth["holdout_inside"]
    return row


def wilson(right: int, n: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    if n == 0:
        return 0.0, 1.0
    p, middle = right / n, 1 + z * z / n
    half = z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, (p + z * z / (2 * n) - half) / middle), min(1.0, (p + z * z / (2 * n) + half) / middle)


def allowed_failures(rates: Sequence[float], risk: float) -> int:
    """Least k such that a program which is right in case i with probability rates[i] has more than k cases wrong less often than `risk`.

    Cases are independent: the distribution of the number of failures is the convolution of theirs, binomial where the rates are equal.
    """
    chance = [1.0]  # of k failures
    for rate in rates:
        chance = [rate * a + (1 - rate) * b for a, b in zip([*chance, 0.0], [0.0, *chance], strict=True)]
    return next(k for k in range(len(chance)) if sum(chance[k + 1 :]) < risk)


def quantile(values: Iterable[float], q: float) -> float | None:
    """Smallest value with at least a share q at or below it; None of nothing."""
    ordered = sorted(values)
    return ordered[max(ceil(q * len(ordered) - 1e-9) - 1, 0)] if ordered else None


def _share(rows: Sequence[Mapping]) -> dict:
    right = sum(r["right"] for r in rows)
    return {"n": len(rows), "right": right, "share": right / len(rows), "wilson95": wilson(right, len(rows))}


def summary(rows: Sequence[Mapping]) -> dict:
    """All tables of a campaign."""
    strata = {s: [r for r in rows if r["stratum"] == s] for s in DEMANDED}
    out: dict = {"strata": {}, "kinds": {}, "confusion": {}, "outcomes": {}}
    for name, own in strata.items():
        if own:
            out["strata"][name] = {**_share(own), "demanded": DEMANDED[name][0], "outcomes": dict(Counter(r["outcome"] for r in own))}
    for r in rows:
        if len(r["kinds"]) <= 1:
            hidden, answer = r["kinds"] or ["nothing"], [a.split(" at ")[0] for a in r["answer"]]
            said = answer[0] if len(answer) == 1 else "several" if answer else str(r["verdict"] or r["outcome"])
            out["confusion"].setdefault(hidden[0], Counter())[said] += 1
    for name in ("single_common", "single_foreign", "hard"):
        for kind in sorted({r["kinds"][0] for r in strata[name]}):
            own = [r for r in strata[name] if r["kinds"][0] == kind]
            instead = Counter(" + ".join(r["answer"]) or str(r["verdict"] or r["outcome"]) for r in own if not r["right"])
            out["kinds"].setdefault(kind, {})[name] = {**_share(own), "instead": dict(instead)}
    errors = [e for r in rows for e in r["errors"]]
    loud = [e for e in errors if e[2] >= 1]
    covered = [c for r in rows for c in r["covered"]]
    named = [r for r in rows if r["right"] and r["answer"] and OUTSIDE not in r["kinds"]]
    inside = [max(g[1] for g in r["gain"].values()) for r in named if r["gain"] and r.get("inside")]
    hidden = [max(r["gain"].values(), key=lambda g: g[1]) for r in rows if r["kinds"] and r["gain"] and r.get("inside")]
    worse = [r["case"] for r in rows if r["stratum"] == "outside" and r["answer"] and any(g[1] > 1.05 * g[0] for g in r["gain"].values())]
    seconds = [r.get("alone", round(r["seconds"] - r.get("compiling", 0.0), 2)) for r in rows]
    out["outcomes"] = dict(Counter(r["outcome"] for r in rows))
    out["no_answer"] = sum(r["verdict"] is None for r in rows)
    for name, own in (("parameters", errors), ("parameters_above_noise", loud)):
        out[name] = {
            "n": len(own),
            "median_error": quantile((e for _, e, _ in own), 0.5),
            "error_95": quantile((e for _, e, _ in own), 0.95),
            "worst": sorted(own, key=lambda e: -e[1])[:10],
        }
    out["coverage"] = {
        "n": len(covered),
        "share": sum(c for _, c in covered) / len(covered) if covered else None,
        "wilson95": wilson(sum(c for _, c in covered), len(covered)),
    }
    out["gain"] = {
        "n": len(inside),
        "within_5_percent_of_floor": sum(g <= 1.05 for g in inside) / len(inside) if inside else None,
        "ratio_95": quantile(inside, 0.95),
        "outside_made_worse": worse,
        "all": {  # cases with an effect, rightly named or not, each by its worst signal
            "n": len(hidden),
            "before": quantile((before for before, _ in hidden), 0.5),
            "after": quantile((after for _, after in hidden), 0.5),
            "share_of_achievable": quantile(((b - a) / (b - 1) for b, a in hidden if b > 1.05), 0.5),
            "made_worse": sum(after > 1.05 * before for before, after in hidden),
        },
    }
    out["time"] = {"median": quantile(seconds, 0.5), "q90": quantile(seconds, 0.9), "longest": max(seconds, default=None)}
    out["time"]["compiling"] = quantile((r.get("compiling", 0.0) for r in rows), 0.5)
    return out


def gate(rows: Sequence[Mapping], risk: float = 1e-3) -> dict[str, str]:
    """Groups -> what is wrong in each, empty if nothing: more failures than a program at the demanded rates has by chance.

    Groups are the strata and, as few cases say little of one stratum, all cases together, but those of so few cases that all of them may
    be wrong by chance; each takes an equal part of the risk, so that a right program fails any of them with at most `risk`. The null strata
    ask for no false alarm in 100; one in 500 is taken as right here.
    """
    groups = {s: own for s in DEMANDED if (own := [r for r in rows if r["stratum"] == s])} | {"all": list(rows)}
    rates = {name: [0.998 if r["stratum"] == "null" else DEMANDED[r["stratum"]][0] for r in own] for name, own in groups.items()}
    told = [name for name, own in rates.items() if name == "all" or allowed_failures(own, risk) < len(own)]
    found = {}
    for name in told:
        own = groups[name]
        wrong, most = sum(not r["right"] for r in own), allowed_failures(rates[name], risk / len(told))
        found[name] = f"{name}: {wrong} of {len(own)} wrong, at most {most} can be chance" if wrong > most else ""
    return found


def _percent(x: float | None, digits: int = 1) -> str:
    return "-" if x is None else f"{100 * x:.{digits}f} %"


def text(out: Mapping) -> str:
    """The tables for a terminal."""
    lines = [f"{'stratum':<16}{'right':>10}{'share':>9}  {'95 % interval':<18}{'asked':>7}  otherwise"]
    for name, s in out["strata"].items():
        low, high = s["wilson95"]
        other = ", ".join(f"{n} {what}" for what, n in s["outcomes"].items() if what != "right")
        lines.append(
            f"{name:<16}{s['right']:>4} of {s['n']:<3}{_percent(s['share']):>8}  {_percent(low)} .. "
            f"{_percent(high):<9}{_percent(s['demanded'], 0):>7}  {other}"
        )
    lines += ["", f"{'kind':<20}{'common':>9}{'foreign':>10}{'hard':>9}  answered instead"]
    for kind, own in out["kinds"].items():

        def cell(name, own=own):
            return f"{own[name]['right']}/{own[name]['n']}" if name in own else "-"

        instead = sum((Counter(s["instead"]) for s in own.values()), Counter())
        lines.append(
            f"{kind:<20}{cell('single_common'):>9}{cell('single_foreign'):>10}{cell('hard'):>9}  "
            + ", ".join(f"{n}x {what}" for what, n in instead.items())
        )
    p, a, c, g, t = (out[k] for k in ("parameters", "parameters_above_noise", "coverage", "gain", "time"))
    lines += [
        "",
        f"parameters of effects above the noise ({a['n']}): median error {_percent(a['median_error'], 2)} (asked 1 %), "
        f"95 % within {_percent(a['error_95'], 2)} (asked 6 %)",
        f"parameters of all effects ({p['n']}): median error {_percent(p['median_error'], 2)}, 95 % within {_percent(p['error_95'], 2)}",
        (
            f"95 % intervals ({c['n']}): cover {_percent(c['share'])} of the truths (asked 90 .. 98 %), "
            f"{_percent(c['wilson95'][0])} .. {_percent(c['wilson95'][1])}"
        ),
        (
            f"hold-out inside the trained range ({g['n']}): "
            f"{_percent(g['within_5_percent_of_floor'])} within 5 % of the noise floor (asked 95 %)"
        ),
        f"time a case: median {t['median']} s, 90 % within {t['q90']} s (asked 10 s), longest {t['longest']} s (asked 40 s); "
        f"compilers, in a first call, beside that: median {t['compiling']} s",
    ]
    return "\n".join(lines)


def confusion(out: Mapping) -> str:
    """Hidden kind x answer as a table, of cases with at most one effect; columns are numbered by the rows, then come other answers."""
    hidden = sorted(out["confusion"])
    answers = [*hidden, *sorted({a for own in out["confusion"].values() for a in own} - set(hidden))]
    lines = [f"{'hidden, number of answer:':<30}" + "".join(f"{i:>4}" for i in range(1, len(answers) + 1))]
    for i, kind in enumerate(answers, 1):
        own = out["confusion"].get(kind, {})
        lines.append((f"{i:>4} {kind:<25}" + "".join(f"{own.get(a, '.'):>4}" for a in answers if own)).rstrip())
    return "\n".join(lines)


def compare(tables: Mapping[str, Mapping]) -> str:
    """Several commands on the same cases side by side, as a Markdown table."""

    def number(x):
        return "-" if x is None else f"{x:.3g}"

    first = next(iter(tables.values()))
    lines = ["| | " + " | ".join(tables) + " |", "|---|" + "---|" * len(tables)]

    def row(what: str, cell: Callable[[Mapping], str]) -> None:
        lines.append(f"| {what} | " + " | ".join(cell(t) for t in tables.values()) + " |")

    def share(stratum: str) -> Callable[[Mapping], str]:
        return lambda t: f"{t['strata'][stratum]['right']} of {t['strata'][stratum]['n']}, {_percent(t['strata'][stratum]['share'], 0)}"

    for stratum, own in first["strata"].items():
        row(f"{stratum}: right (asked {_percent(own['demanded'], 0)})", share(stratum))
    nulls = [s for s in ("null", "null_hard") if s in first["strata"]]
    row("false alarms on null cases", lambda t: str(sum(t["strata"][s]["outcomes"].get("false alarm", 0) for s in nulls)))
    row("no answer", lambda t: str(t["no_answer"]))
    for which, of in (("parameters_above_noise", "above the noise"), ("parameters", "of any size")):
        row(
            f"parameter error, effects {of}: median; 95 % within",
            lambda t, which=which: f"{_percent(t[which]['median_error'])}; {_percent(t[which]['error_95'])}",
        )
    row("95 % intervals cover", lambda t: _percent(t["coverage"]["share"]))
    row("hold-out RMSE / noise floor before, median", lambda t: number(t["gain"]["all"]["before"]))
    row("hold-out RMSE / noise floor after, median", lambda t: number(t["gain"]["all"]["after"]))
    row("share of the achievable gain, median", lambda t: _percent(t["gain"]["all"]["share_of_achievable"], 0))
    row("hold-out made worse", lambda t: f"{t['gain']['all']['made_worse']} of {t['gain']['all']['n']}")
    row("time a case, median; 90 % within; longest [s]", lambda t: "; ".join(number(t["time"][k]) for k in ("median", "q90", "longest")))
    return "\n".join(lines)
