# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Units as people, DBC and A2L files write them, read by the dimension that the model asks for.

m/s2 is m/s^2; Nm is a torque where one is asked for; 1/min is a rotation where an angular rate is; g is gravity where an
acceleration is. The first reading that measures what is asked for counts; if two such readings differ, it is an error.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator
from functools import cache
from itertools import islice, product

from penode_gen import units as _units

from .units import UnitError, factor

SUPERSCRIPT = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺\u2212–", "0123456789-+--")
PLAIN = ("", "-", "--", "1", "none", "no unit", "unitless", "dimensionless", "[-]", "n/a", "/", "ohne", "keine", "1/1")
WORD = re.compile(r"°?[^\W\d_]+(?:_n\b)?|[%°]")
ANGLE = re.compile(r"rad|deg|°|turn|rev|rpm|rps|grad|gon", re.IGNORECASE)
# words that are written in other ways, in lower case; several meanings of one word are tried together
WORDS = {
    **dict.fromkeys("sec secs second seconds sek sekunde sekunden".split(), ("s",)),
    **dict.fromkeys("msec msecs millisec".split(), ("ms",)),
    **dict.fromkeys("usec µsec musec mus mcs".split(), ("us",)),
    **dict.fromkeys("hr hrs std".split(), ("h",)),
    **dict.fromkeys("mins minute minutes".split(), ("min",)),
    **dict.fromkeys("kph kmh kmph".split(), ("(km/h)",)),
    **dict.fromkeys("rev revs r u umdr upm rounds".split(), ("turn",)),
    **dict.fromkeys("dps degps".split(), ("(deg/s)",)),
    "mps": ("(m/s)",),
    **dict.fromkeys("rads radps".split(), ("(rad/s)",)),
    **dict.fromkeys("g gn gee gees".split(), ("g_n",)),
    **dict.fromkeys("pct percent prozent".split(), ("%",)),
    **dict.fromkeys("degrees degree".split(), ("deg",)),
    "mg": ("mg_n",),
    "ug": ("ug_n",),
    "upm": ("rpm",),
    "grad": ("deg", "grad"),
    "kp": ("kgf",),
    "lbs": ("lb", "lbf"),
    "lb": ("lbf",),
    "micron": ("um",),
}
# how words look whose case is lost: NM, KN, MM
CASES = "N kN m mm cm km s ms us kg g rad deg rpm Hz kHz V mV A mA W kW J kJ Pa kPa MPa bar K min h N*m kN*m".split()
LOST: dict[str, list[str]] = {}  # lower case -> spellings
for _case in CASES:
    LOST.setdefault(_case.replace("*", "").lower(), []).append(_case)
GLUED = ("kN", "MN", "mN", "N", "mm", "cm", "km", "m", "kg", "ms", "s", "rad", "deg", "min", "h", "V", "A", "W")


# degrees Celsius [1, 3], Fahrenheit [2, 4] or Kelvin
_NAMED = r"(?:°\s*|\bdeg(?:rees?|ree)?[ _]?|\bgrad\s+)(?:(c(?:elsius)?|centigrade)|(f(?:ahrenheit)?)|k(?:elvin)?)\b"
DEGREE = re.compile(rf"{_NAMED}|\b(?:(celsius)|(fahrenheit))\b", re.IGNORECASE)


def scale(given: str, asked: str) -> float:
    """How many SI units one `given` is, read as what `asked` measures; UnitError if nothing or more than one thing fits."""
    return conversion(given, asked)[0]


def conversion(given: str, asked: str) -> tuple[float, float]:
    """How many SI units one `given` is, and how many 0 of it is (0, but for °C and °F where a temperature is asked for); UnitError as for
    `scale`."""
    degree = _degree(given) if _known(asked) and _units.same_dimension(asked, "K") else None
    if degree is not None:
        return degree
    found = _scale(given, asked)
    if isinstance(found, str):
        raise UnitError(found)
    return found, 0.0


def _degree(given: str) -> tuple[float, float] | None:
    """K per degree of a temperature, and K at 0; None if it is none of Celsius or Fahrenheit."""
    text = unicodedata.normalize("NFKC", given.replace("º", "°")).strip().strip("[](){}").strip()
    match = DEGREE.fullmatch(text)
    letter = text.lower() if match is None else "c" if match[1] or match[3] else "f" if match[2] or match[4] else ""
    fahrenheit = 5.0 / 9.0
    return {"c": (1.0, 273.15), "f": (fahrenheit, 459.67 * fahrenheit)}.get(letter)


def _per_degree(text: str) -> str:
    """A unit with K for °C, and with degrees of Rankine, which are as large, for °F: W/°C is W/K."""

    def other(match: re.Match[str]) -> str:
        return "degR" if match[2] or match[4] else "K"

    return DEGREE.sub(other, unicodedata.normalize("NFKC", text.replace("º", "°")) if re.search("[℃℉º]", text) else text)


@cache
def _scale(given: str, asked: str) -> float | str:
    """The factor, or the error."""
    try:
        return _read(given, "1" if asked.strip() in ("", "-") else asked)
    except UnitError as exc:
        return str(exc)


def _read(given: str, asked: str) -> float:
    special = _rotation(_plain(given), asked)
    if special is not None:
        return special
    for readings in _levels(given):
        fits = {_units.factor(text): text for text in readings if _measures(text, asked)}
        if len({float(f"{value:.12g}") for value in fits}) > 1:
            raise UnitError(f"{given.strip()} may be {' or '.join(fits.values())}; say which")
        if fits:
            return next(iter(fits))
    if _known(asked) and _units.dimension(asked) == _units.NONE and ANGLE.search(asked) and is_unit(given):
        raise UnitError(f"{given.strip() or 'no unit'} is no angle; give rad or deg")
    known = (text for readings in _levels(given) for text in readings if _known(text))
    return factor(next(known, given.strip()), asked)  # says why it does not fit


def is_unit(text: str) -> bool:
    """Can a text be a unit at all? An empty one and placeholders like "-" can."""
    return len(text) <= 30 and any(_known(reading) for readings in islice(_levels(text), 5) for reading in readings)


def _plain(text: str) -> str:
    """One way to write operators and powers: m.s⁻² -> m*s^-2, m/s2 -> m/s^2, N m -> N*m, /min -> 1/min."""
    text = _per_degree(text.strip().strip("\"'").strip())
    if len(text) > 1 and (text[0] + text[-1]) in ("[]", "()", "{}", "<>"):
        inner = text[1:-1]
        text = inner if not set("[](){}<>") & set(inner) else text
    text = text.translate(SUPERSCRIPT).replace("μ", "µ").replace("µ", "u").strip()
    if text.lower() in PLAIN:
        return "1"
    text = text.replace("**", "^").replace("º", "°")
    text = re.sub(r"\s*[/÷]\s*|\s+per\s+|\s+pro\s+", "/", text)
    text = re.sub(r"\s*[*·×⋅∙•]\s*|(?<=[^\W\d_])[.-](?=[^\W\d_])|(?<=[^\W_])\.(?=[^\W\d_])|(?<=[\w)%°])\s+(?=[^\W\d_(%°])", "*", text)
    text = re.sub(r"(?<=[^\W\d_])\s*\^?\s*\(([-+]?\d)\)", r"^\1", text)
    text = re.sub(r"(?<=[^\W\d_])\^?\s*\+?(-?\d)", r"^\1", text)
    return "1" + text if text.startswith("/") else text


@cache
def _known(text: str) -> bool:
    try:
        _units.factor(text)
    except (UnitError, ArithmeticError):
        return False
    return True


def _measures(text: str, asked: str) -> bool:
    """Does a reading measure what is asked for? A plain number is no angle."""
    if not _known(text) or not _known(asked) or not _units.same_dimension(text, asked):
        return False
    angle = _units.dimension(asked) == _units.NONE and ANGLE.search(asked)
    return not (angle and not ANGLE.search(text))


def _rotation(given: str, asked: str) -> float | None:
    """The factor of a rate that counts turns, None if `given` or `asked` is no such rate; UnitError in doubt."""
    if not _known(asked) or not _units.same_dimension(asked, "1/s"):
        return None
    short = given.lower().replace("^", "").replace(" ", "")
    per = {"1/min": "min", "min-1": "min", "hz": "s", "khz": "ms"}.get(short)
    if ANGLE.search(asked):
        if per:
            return _units.factor(f"turn/{per}")
        if short in ("1/s", "s-1", "1/sec", "sec-1"):
            raise UnitError(f"{given} may be rad/s or turns per second; say rad/s or turn/s")
        return None
    turning = {"rpm": "min", "upm": "min", "u/min": "min", "rev/min": "min", "r/min": "min", "rps": "s", "rev/s": "s"}.get(short)
    return _units.factor(f"1/{turning}") if turning and asked.strip() != "1/s" else None


def _levels(given: str) -> Iterator[list[str]]:
    """Readings of a unit, level by level: as it stands, powers written out, other words, lost case, words glued together,
    and each of them with all that follows the first slash below it."""
    text = _plain(given)
    if not re.search(r"\bGrad|\bgrad", given):
        yield [given.strip() or "1"]
        yield [text]
    for alternatives in (_words, _cases, _parts):
        yield list(_replaced(text, alternatives))
    yield list(_replaced(text, lambda word: [*_words(word), *_cases(word), *_parts(word)]))
    yield [re.sub(r"^([cmk]?m)(?:ps\^?|s\^)2$|^mpss$", lambda m: f"{m[1] or 'm'}/s^2", text)]  # ms2, mps2
    above, slash, below = text.partition("/")
    if slash and re.search(r"[*/]", below) and "(" not in text:
        yield [f"{above}/({below.replace('/', '*')})"]
        yield [f"{above}/({text})" for text in _replaced(below.replace("/", "*"), _words)]


def _replaced(text: str, alternatives: Callable[[str], list[str]]) -> Iterator[str]:
    """The text with each of its words by all alternatives; not more than a few hundred."""
    words = list(WORD.finditer(text))
    if len(words) > 6 or len(text) > 60:
        return
    choices = [alternatives(m[0]) for m in words]
    for chosen in islice(product(*choices), 300):
        out, end = "", 0
        for match, word in zip(words, chosen, strict=True):
            out += text[end : match.start()] + word
            end = match.end()
        yield out + text[end:]


def _words(word: str) -> list[str]:
    """Other words for one; itself, if it has none or is known as well (but for Grad, which is no giga-radian)."""
    others = list(WORDS.get(word.lower(), ()))
    if word == "Grad":
        return ["deg"]
    return others + [word] * (word.lower() != "grad" and (not others or _known(word)))


def _cases(word: str) -> list[str]:
    named = [word.lower()] if len(word) > 3 and word.istitle() else []  # Newton, Meter
    return [word, *(case for case in (*LOST.get(word.lower(), ()), *named) if case != word)]


def _parts(word: str) -> list[str]:
    """Nm -> Nm, N*m: the word, and all products of known parts that it may be."""
    found = [word]

    def split(rest: str, parts: tuple[str, ...]) -> None:
        if not rest and len(parts) > 1:
            found.append("*".join(parts))
        for part in GLUED if len(parts) < 4 else ():
            if rest.startswith(part):
                split(rest[len(part) :], (*parts, part))

    if len(word) <= 8:
        split(word, ())
    return found
