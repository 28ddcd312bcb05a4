# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How Eva analyses the XCP slave: a group of commands at a time, each from every state that the invariants of eva/xcp_state.inc allow."""

from __future__ import annotations

# Entry -> its file in eva/.
ENTRIES = {
    **dict.fromkeys(
        (
            "xcp_upload_page",
            "xcp_upload_region",
            "xcp_upload_text",
            "xcp_checksum",
            "xcp_download_command",
            "xcp_pages",
            "xcp_elapse",
            "xcp_keys",
            "xcp_dispatch",
        ),
        "xcp.c",
    ),
    **dict.fromkeys(
        ("xcp_lists", "xcp_allocate", "xcp_pointer", "xcp_write_entries", "xcp_whole_lists", "xcp_sampling", "xcp_static_lists"),
        "xcp_lists.c",
    ),
}
FILES = "pen_xcp*.c"  # no other entry analyses them

# Its loops over bytes are unrolled; states are merged elsewhere. The two contexts share words, each of which only one of them writes, and
# no index depends on one of the other's but by a comparison: so volatile is left out.
WORDS = ["-Dvolatile="]
_KEPT = "pen_tuning_write:40,pen_tuning_write_bytes:40,xcp_at:20,xcp_upload:20,xcp_build_checksum:40"
_RELATED = "pen_tuning_write,pen_tuning_write_bytes,pen_serial_get_bytes,pen_serial_put_bytes,pen_xcp_download_command"
OPTIONS = [
    "-eva-precision",
    "0",
    "-eva-plevel",
    "199",
    "-eva-min-loop-unroll",
    "24",
    "-eva-slevel-function",
    _KEPT,
    "-eva-domains-function",
    ",".join(f"octagon:{name}" for name in _RELATED.split(",")),
]
UNROLLED = {"xcp_sampling": "70", "xcp_static_lists": "70"}  # entries of an ODT, or of all lists

# File, what becomes of it, and the entry that must see it.
SEEDS = [
    ("pen_xcp_memory.c", "(n <= xcp->left) ? xcp->text : NULL", "xcp->text", "xcp_upload_text"),
    ("pen_xcp_memory.c", "(offset <= size) && (n <= (size - offset))", "(offset <= size)", "xcp_upload_region"),
    ("pen_xcp_memory.c", "} else if (n < now) {", "} else if (false) {", "xcp_download_command"),
    ("pen_xcp_options.c", "} else if ((n - 2U) < in[1]) {", "} else if (false) {", "xcp_keys"),
    ("pen_xcp_daq.c", "(n >= 4U) ? pen_xcp_get(&in[2], 2U) : 0U", "pen_xcp_get(&in[2], 2U)", "xcp_dispatch"),
    ("pen_xcp_lists.c", "} else if (count > (PEN_XCP_ODTS - daq->odts)) {", "} else if (false) {", "xcp_allocate"),
    ("pen_xcp_lists.c", "} else if (count > (PEN_XCP_ENTRIES - daq->entries)) {", "} else if (false) {", "xcp_allocate"),
    ("pen_xcp_lists.c", " && (in[5] < odt->entries)", "", "xcp_pointer"),
    ("pen_xcp_lists.c", "if (daq->left == 0U) {", "if (false) {", "xcp_write_entries"),
    ("pen_xcp_daq.c", "good = good && (n <= xcp->config->max_cto);", "", "xcp_sampling"),
    ("pen_xcp_static.c", " && (odts <= PEN_XCP_ODTS) && (entries <= PEN_XCP_ENTRIES)", "", "xcp_static_lists"),
]


def options(entry: str) -> list[str]:
    """More options of Frama-C for an entry."""
    return [UNROLLED[entry] if entry in UNROLLED and word == "24" else word for word in OPTIONS]
