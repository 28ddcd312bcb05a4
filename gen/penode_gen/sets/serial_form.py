# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parameter sets as bytes, for files and wires: the serial form of penode/pen_serial.h."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Model
from . import packing
from .packing import RealType

MAGIC = b"PENS"
VERSION = 1
HEAD = 32  # bytes before the values
_FIELDS = struct.Struct("<4sHHIIIII")  # magic, version, bytes a value, layout, length, id, checksum, 0; a CRC-32 follows


@dataclass(frozen=True, eq=False)
class SerialSet:
    """A set read from its serial form: its head as pen_set_head_t, and its values."""

    layout: int
    length: int
    id: int
    checksum: int
    values: NDArray[Any]  # [length] float32 or float64


def serial(model: Model, set_name: str, dtype: RealType = np.float32) -> bytes:
    """The serial form of a set of the model file. Raises KeyError for an unknown set."""
    head = packing.set_head(model, set_name, dtype)
    fields = _FIELDS.pack(MAGIC, VERSION, np.dtype(dtype).itemsize, *head, 0)
    values = packing.set_values(model, set_name, dtype)
    return fields + struct.pack("<I", zlib.crc32(fields)) + values.astype(values.dtype.newbyteorder("<")).tobytes()


def read_serial(data: bytes) -> SerialSet:
    """The set in these bytes. Raises ValueError with what is wrong; it does not know whose set it is: compare the layout."""
    if len(data) < HEAD:
        raise ValueError(f"{len(data)} bytes: a set begins with a head of {HEAD} bytes")
    magic, version, size, layout, length, identity, checksum, reserved = _FIELDS.unpack_from(data)
    if magic != MAGIC:
        raise ValueError(f"begins with {magic!r}: a set begins with {MAGIC!r}")
    if struct.unpack_from("<I", data, HEAD - 4)[0] != zlib.crc32(data[: HEAD - 4]):
        raise ValueError("the head is damaged: its CRC does not match; send it again")
    if version != VERSION or reserved:
        raise ValueError(f"version {version} of the serial form: this program reads version {VERSION}")
    if size not in (4, 8):
        raise ValueError(f"{size} bytes a value: 4 (float) and 8 (double) are known")
    if len(data) != HEAD + length * size:
        raise ValueError(f"{len(data)} bytes: the head promises {length} values of {size} bytes, {HEAD + length * size} bytes in all")
    if zlib.crc32(data[HEAD:]) != checksum:
        raise ValueError("the values are damaged: their CRC does not match that in the head; send them again")
    values = np.frombuffer(data, f"<f{size}", length, HEAD).astype(f"f{size}")
    if not np.isfinite(values).all():
        raise ValueError(f"value {int(np.argmin(np.isfinite(values)))} is NaN or Inf: no C accepts such a set")
    return SerialSet(layout, length, identity, checksum, values)
