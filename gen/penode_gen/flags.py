# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The flags of inc/penode/pen_status.h, in the order of their bits and of their counters."""

FLAGS = (
    "input_nonfinite",
    "state_nonfinite",
    "step_nonfinite",
    "singular",
    "outside",
    "held",
    "adopted",
    "badarg",
    "weight_nonfinite",
    "input_range",
    "withdrawn",
    "set_busy",
    "set_closed",
    "set_range",
    "set_short",
    "set_checksum",
    "set_nonfinite",
    "set_layout",
    "set_no_previous",
    "set_pieces",
    "set_badarg",
    "set_promise",
    "set_trial",
    "set_damaged",
    "set_idle",
)

FILTER_FLAGS = ("missing", "refused", "limited", "nonfinite")  # PEN_EKF_... of inc/penode/pen_ekf.h, the bits behind those of FLAGS
MONITOR_FLAGS = ("cause", "other", "nonfinite")  # PEN_MONITOR_... of inc/penode/pen_monitor.h, the bits behind those
