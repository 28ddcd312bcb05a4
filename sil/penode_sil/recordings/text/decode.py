# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Bytes of a file as text: UTF-8, UTF-16, UTF-32 or Latin-1, with one kind of line end."""

from __future__ import annotations

import codecs
from pathlib import Path

from ...errors import RecordingError

MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
# what other kinds of file begin with, and what they are
OTHERS = (
    (b"\x1f\x8b", "compressed (gzip)", "unpack it"),
    (b"PK\x03\x04", "an Excel workbook or a zip archive", "export CSV from it"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook", "export CSV from it"),
    (b"\x89HDF", "HDF5 (or MATLAB 7.3)", "export CSV or MDF4"),
    (b"MATLAB 5", "a MATLAB file", "export CSV or MDF4"),
    (b"PAR1", "a Parquet file", "export CSV or MDF4"),
    (b"TDSm", "a TDMS file", "export CSV or MDF4"),
    (b"\xfd7zXZ", "compressed (xz)", "unpack it"),
    (b"BZh", "compressed (bzip2)", "unpack it"),
)


def read_text(path: Path) -> tuple[str, str]:
    """The text of a file, lines ended by \\n, and the name of its encoding; UserError if it cannot be read or is no text."""
    try:
        data = path.read_bytes()
    except OSError as exc:
        raise RecordingError(f"{path}: {exc.strerror or exc}; name a CSV file that can be read") from exc
    for start, what, remedy in OTHERS:
        if data.startswith(start):
            raise RecordingError(f"{path}: it is no CSV text but {what}; {remedy}")
    try:
        text, encoding = _decoded(data)
    except UnicodeDecodeError as exc:
        raise RecordingError(f"{path}: it is no CSV text ({exc}); give a comma-separated file") from exc
    text = text.rstrip("\0")
    head = text[:4096]
    strange = sum(1 for c in head if c < " " and c not in "\t\n\r\f\v")
    if strange > 2 + len(head) // 50:
        raise RecordingError(f"{path}: it is no CSV text ({strange} control characters at its start); give a comma-separated file")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text, encoding


def _decoded(data: bytes) -> tuple[str, str]:
    for mark, encoding in MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding), encoding
    even, odd = data[0:4096:2].count(0), data[1:4096:2].count(0)
    if max(even, odd) > len(data[:4096]) // 5 and min(even, odd) <= max(even, odd) // 10:
        encoding = "utf-16-le" if odd > even else "utf-16-be"
        return data.decode(encoding), encoding
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        try:
            return data.decode("cp1252"), "cp1252"
        except UnicodeDecodeError:
            return data.decode("latin-1"), "latin-1"
