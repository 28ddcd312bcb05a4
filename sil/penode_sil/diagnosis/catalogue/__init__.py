# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The causes that a diagnosis knows: one file for a kind, or for kinds of one curve. A new one is a file and its name here."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from penode_gen.model import Model

from . import (
    aerated,
    bushings,
    channels,
    dampers,
    drives,
    experiments,
    friction,
    lines,
    loads,
    masses,
    networks,
    others,
    plays,
    springs,
    tyres,
)
from .form import Form, Motion, Part

FILES = (friction, springs, plays, dampers, bushings, masses, loads, tyres, aerated, lines, networks)
MEANING = {kind: text for file in (*FILES, drives, channels, others) for kind, text in file.MEANING.items()}
OF = {kind: file for file in FILES for kind in file.KINDS}

REVERSING = {kind for file in FILES for kind in getattr(file, "REVERSING", ())}  # kinds that act where a rate changes its sign

RIVALS = {frozenset(pair): how for file in (*FILES, drives, channels, others) for pair, how in getattr(file, "RIVALS", {}).items()}
OTHERWISE = (
    "broadband excitation at two amplitudes, with all sensors of the model file; chirps of constant amplitude are the least informative"
)


def separating(kind: str, alternatives: Iterable[str], model: Model | None = None) -> str:
    """The excitation that would tell a kind from others; empty if there are none. Where no file of the catalogue has one for a pair, that
    under which both show in the plant of `model`."""

    def general(other: str) -> str:
        return OTHERWISE if model is None else experiments.proposed(model, (kind, other))

    return "; ".join(dict.fromkeys(RIVALS.get(frozenset((kind, other))) or general(other) for other in alternatives))


def aside(form: Form) -> Form | None:
    """A form with its middle elsewhere; None where its kind has none."""
    shifted = getattr(OF.get(form.kind), "aside", None)
    return shifted(form) if shifted else None


def fitted(form: Form, laws: Sequence[tuple[float, Part]], motion: Motion) -> Form:
    """A form under the name that it has with its laws as they are fitted: a friction with hardly a peak is none of Stribeck's. The kind
    is empty where another form has that curve with fewer values."""
    named = getattr(OF[form.kind], "fitted", None)
    return replace(form, kind=named(form, laws, motion)) if named else form


def stem(kind: str) -> str:
    """What the elements of a kind are called in a model file."""
    return str(getattr(OF.get(kind), "STEMS", {}).get(kind, kind))


def has_one_curve(kind: str) -> bool:
    """Are a kind and the others of its file forms of one curve, of which a place has one?"""
    return getattr(OF.get(kind), "ONE", False)


def curve(kind: str) -> object:
    """What only one of is at a place: the file of a kind where its kinds are forms of one curve, else the kind itself."""
    return OF[kind] if has_one_curve(kind) else kind
