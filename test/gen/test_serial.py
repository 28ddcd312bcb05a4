# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sets as bytes: written and read in Python, read and taken by the C."""

from __future__ import annotations

import ctypes
import struct
import zlib

import models
import numpy as np
import pytest

import penode_gen
from penode_gen.sets import serial_form
from penode_sil.instance import Head
from penode_sil.status import names
from penode_sil.targets import Sil


@pytest.fixture
def rich(tmp_path):
    return penode_gen.load(models.rich(tmp_path))


def test_form_to_the_byte(rich):
    """Against struct and zlib, as penode/pen_serial.h states the form."""
    layout, length, identity, checksum = penode_gen.set_head(rich, "heavy")
    data = penode_gen.serial(rich, "heavy")
    assert data[:4] == b"PENS" and struct.unpack("<HHIIIII", data[4:28]) == (1, 4, layout, length, identity, checksum, 0)
    assert struct.unpack("<I", data[28:32])[0] == zlib.crc32(data[:28])
    assert data[32:] == penode_gen.set_values(rich, "heavy").astype("<f4").tobytes() and zlib.crc32(data[32:]) == checksum
    assert len(penode_gen.serial(rich, "heavy", np.float64)) == 32 + 8 * length


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_read_gives_what_was_written(rich, dtype):
    read = penode_gen.read_serial(penode_gen.serial(rich, "heavy", dtype))
    assert (read.layout, read.length, read.id, read.checksum) == penode_gen.set_head(rich, "heavy", dtype)
    assert read.values.dtype == dtype and np.array_equal(read.values, penode_gen.set_values(rich, "heavy", dtype))


def sealed(data: bytes, at: int, part: bytes) -> bytes:
    """The bytes with a part of the head anew, and the CRC of the head with it."""
    head = data[:at] + part + data[at + len(part) : 28]
    return head + struct.pack("<I", zlib.crc32(head)) + data[32:]


def test_refused_with_what_is_wrong(rich):
    good = penode_gen.serial(rich, "default")
    values = np.frombuffer(good, "<f4", offset=32).copy()
    values[3] = np.nan
    nan = sealed(good[:32] + values.tobytes(), 20, struct.pack("<I", zlib.crc32(values.tobytes())))
    for bad, words in (
        (b"", "0 bytes"),
        (good[:31], "31 bytes"),
        (b"PENI" + good[4:], "begins with b'PENI'"),
        (good[:-1], "the head promises"),
        (good + b"\0", "the head promises"),
        (sealed(good, 4, b"\2\0"), "version 2"),
        (sealed(good, 6, b"\2\0"), "2 bytes a value"),
        (sealed(good, 24, b"\1"), "version"),
        (good[:40] + bytes([good[40] ^ 1]) + good[41:], "values are damaged"),
        (nan, "value 3 is NaN"),
    ):
        with pytest.raises(ValueError, match=words):
            penode_gen.read_serial(bad)
    for bit in range(8 * serial_form.HEAD):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        with pytest.raises(ValueError, match="begins with" if bit < 32 else "the head is damaged"):
            penode_gen.read_serial(bytes(bad))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_c_takes_these_bytes(rich, dtype):
    """pen_serial_read, tune_begin, tune_write_bytes in odd chunks, commit: then the C runs the set's values."""
    sil = Sil(rich, dtype)
    instance, data, head = sil.instance(), penode_gen.serial(rich, "heavy", dtype), Head()
    read = sil.runtime("pen_serial_read")
    other = penode_gen.serial(rich, "heavy", np.float64 if dtype == np.float32 else np.float32)
    assert names(read(ctypes.c_char_p(other), ctypes.byref(head))) == ["set_layout"]
    assert read(ctypes.c_char_p(data), ctypes.byref(head)) == 0
    assert instance.begin((head.layout, head.length, head.id, head.checksum)) == 0
    for at in range(0, len(data) - 32, 13):
        assert instance.write_bytes(at, data[32 + at : 32 + at + 13]) == 0
    assert instance.commit() == 0 and instance.pending()
    assert names(instance.step([0.0, 0.0])[2]) == ["adopted"] and not instance.pending()
    assert bytes(instance.running()) == bytes(Head(*penode_gen.set_head(rich, "heavy", dtype)))
    assert any(np.array_equal(bank, penode_gen.set_values(rich, "heavy", dtype)) for bank in instance.banks)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_calibrating_three_values(rich, dtype):
    """A copy of the running set, three values of it changed, and the checksum that Python expects."""
    instance = Sil(rich, dtype).instance()
    values = penode_gen.set_values(rich, "default", dtype)
    assert instance.begin_copy(77) == 0
    for at in (9, 0, len(values) - 1):
        values[at] += dtype(0.125)
        assert instance.write(at, values[at : at + 1]) == 0
    assert names(instance.commit()) == ["set_checksum"]
    assert instance.expect(zlib.crc32(values.tobytes())) == 0 and instance.commit() == 0
    assert names(instance.step([0.0, 0.0])[2]) == ["adopted"] and instance.running().id == 77
    assert names(instance.withdraw()) == ["set_idle"]
    assert instance.rollback() == 0 and instance.withdraw() == 0
    assert names(instance.step([0.0, 0.0])[2]) == ["withdrawn"] and instance.running().id == 77
    report = instance.status()
    assert (report.count("adopted"), report.count("withdrawn"), report.count("set_checksum"), report.count("set_idle")) == (1, 1, 1, 1)


def test_guard_through_the_library(rich):
    instance = Sil(rich).instance()
    assert instance.begin_copy(5) == 0 and instance.commit() == 0
    instance.step([0.0, 0.0])
    n = instance.sil.set_length
    assert instance.verify(n) == 0
    instance.banks[0][7] += 1.0
    assert names(instance.verify(n)) == ["set_damaged"]
    instance.banks[0][7] -= 1.0
    assert instance.verify(n) == 0
