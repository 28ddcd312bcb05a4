# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""All numbers of training that somebody chose, in one place, by the module that uses them: a campaign may vary them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Chosen once on seed 1 of the campaign's first plant, but for limits of size and number; unit or meaning behind each."""

    curves_coarse: int = 25  # knots of the first curves
    curves_wider: float = 1.05  # of the visited range, that knots span
    data_orders: int = 4  # of the colour of noise: it follows from so many samples before, at most
    data_explained: float = 0.98  # share of the variance that a colour must leave: below it is one
    ends_close: float = 3.0  # gain in chi2 that counts: weights of a network go on gaining little for long
    left_more: float = 1.03  # times what it should be: a residual, or an error of the generated C, that somebody has to look at
    lines_rows: int = 8_000  # rows of each recording that straight lines, and weights at first, see at least
    lines_short: float = 8.0  # [s] of each recording that they see at least
    engine_room: int = 4_000_000  # doubles of derivatives that are held at a time
    judge_after: float = 0.5  # [s] after a sample outside of the trained range that are left out: what happened there dies away
    problem_limit: float = 0.5  # standard deviation of a parameter, in tolerances: a tolerance is a limit, not a deviation
    problem_unknown_deviation: float = 10.0  # standard deviation of a parameter that is unknown, over its nominal value
    problem_least: float = 0.02  # of its nominal value, that a parameter keeps
    problem_bent: float = 0.3  # of a curve's span: standard deviation of a knot from the line between its neighbours
    problem_large: float = 30.0  # of the force scale: standard deviation of a value, so that what nothing shows stays finite
    problem_decay: float = 3.0  # standard deviation of a weight of a network that is not a curve
    problem_wide: int = 300  # columns from which on curvature is taken from every SPARSE-th sample
    problem_sparse: int = 8
    problem_tied: float = 1e-4  # standard deviation along directions that no sensor sees, relative
    promised_first: float = 1e-5  # margin that is tried first: of the largest slope or force
    solve_close: float = 1.0  # gain in chi2 below which a step counts as none; twice in a row ends a fit
    solve_floor: float = 1e-9  # smallest damping of an unknown, as a part of the largest
    story_bins: int = 60  # of the density of visits
    story_across: int = 201  # places at which a force and its band are given
    story_tighter: float = 4.0  # margin of a promise from one try to the next
    story_tries: int = 8
    story_still: float = 1e-9  # a network's input that moves less against 1 has not been excited
    story_loud: float = 1.25  # times the noise that a sensor states, from which on a fit did not converge
    tries_most: int = 3
    unknown_invisible: float = (
        0.5  # of its prior deviation: what data leave uncertain by more rests on the model file, not on the recordings
    )
    unknown_nothing: float = (
        1e-2  # information in the data relative to that of the model file: a direction with less is not determined at all
    )
    unknown_part: float = 0.25  # of the largest: components of a direction that are named
    unknown_split: float = 0.01  # of a force's span: a constant that is known no better is reported


SETTINGS = Settings()
