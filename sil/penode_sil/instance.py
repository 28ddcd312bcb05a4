# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An instance of a generated model in memory of its own, by ctypes: every call of the generated header."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from penode_gen.algebra.placeholder import columns
from penode_gen.flags import FLAGS
from penode_gen.model import Model

from .status import BIT


class Head(ctypes.Structure):
    """pen_set_head_t"""

    _fields_ = [(name, ctypes.c_uint32) for name in ("layout", "length", "id", "checksum")]


class Report(ctypes.Structure):
    """pen_status_report_t"""

    _fields_ = [("flags", ctypes.c_uint32), ("times", ctypes.c_uint32 * len(BIT))]

    def count(self, flag: str) -> int:
        """How often a flag of status.FLAGS was raised."""
        return int(self.times[FLAGS.index(flag)])


class Set(ctypes.Structure):
    """pen_set_t"""

    _fields_ = [("head", Head), ("value", ctypes.c_void_p)]


class Library(Protocol):
    """What an instance takes of the library that holds its code, see targets.Sil."""

    model: Model
    dtype: type
    instance_size: int
    saved_size: int
    set_length: int
    n_x: int
    n_u: int
    n_y: int
    n_z: int

    def function(self, name: str) -> Callable[..., int]: ...

    def loop(self) -> Callable[..., None]: ...

    def flash_set(self, name: str) -> Set: ...


class Instance:
    """One instance in memory of its own. Calls are those of the generated header; statuses are returned as they come.

    `memory` and `banks` are the instance's bytes and its two staging areas, for tests that poke.
    """

    def __init__(self, sil: Library, set_name: str, banks: bool):
        self.sil, self.dtype = sil, sil.dtype
        self.memory = np.zeros(sil.instance_size + 8, dtype=np.uint8)
        shift = -self.memory.ctypes.data % 8
        self.memory = self.memory[shift : shift + sil.instance_size]
        self.banks = self._zeros(2, sil.set_length)
        self._kept: list[Set] = []  # what the instance borrows
        self._y = self._zeros(sil.n_y)
        status = sil.function("init")(self._self, ctypes.byref(sil.flash_set(set_name)), self._pointer(self.banks) if banks else None)
        if status:
            raise AssertionError(f"init refused its own set: {status:#x}")

    @property
    def _self(self) -> ctypes.c_void_p:
        return self._pointer(self.memory)

    @staticmethod
    def _pointer(array: NDArray[Any]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    def _zeros(self, *shape: int) -> NDArray[Any]:
        return np.zeros(shape, dtype=self.dtype)

    def _vector(self, values: ArrayLike) -> NDArray[Any]:
        return np.ascontiguousarray(values, dtype=self.dtype)

    def _input(self, u: ArrayLike) -> NDArray[Any]:
        return self._vector(columns(self.sil.model, u))

    def step(self, u: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], int]:
        """One step with u [n_u]: state, outputs (those before if it holds) and status."""
        status = self.sil.function("step")(self._self, self._pointer(self._input(u)), self._pointer(self._y))
        return self.get_state(), self._y.copy(), status

    def step_jacobian(self, u: ArrayLike, entries: int) -> tuple[NDArray[Any], NDArray[Any], int]:
        """One step and its derivatives: outputs, the `entries` reals of the jacobian struct, status."""
        jacobian = self._zeros(entries)
        status = self.sil.function("step_jacobian")(
            self._self, self._pointer(self._input(u)), self._pointer(self._y), self._pointer(jacobian)
        )
        return self._y.copy(), jacobian, status

    def get_state(self) -> NDArray[Any]:
        x = self._zeros(self.sil.n_x)
        if x.size:
            self.sil.function("get_state")(self._self, self._pointer(x))
        return x

    def set_state(self, x: ArrayLike) -> int:
        return self.sil.function("set_state")(self._self, self._pointer(self._vector(x)))

    def sensors(self) -> NDArray[Any]:
        z = self._zeros(self.sil.n_z)
        self.sil.function("sensors")(self._self, self._pointer(z))
        return z

    def sensors_jacobian(self, entries: int) -> tuple[NDArray[Any], int]:
        """The `entries` reals of the sensors' jacobian struct, status."""
        jacobian = self._zeros(entries)
        status = self.sil.function("sensors_jacobian")(self._self, self._pointer(jacobian))
        return jacobian, status

    def get_input(self) -> NDArray[Any]:
        """The input of the last sample."""
        u = self._zeros(self.sil.n_u)
        self.sil.function("get_input")(self._self, self._pointer(u))
        return u[: len(self.sil.model.inputs)]

    def set_input(self, u: ArrayLike) -> int:
        """The input that the next step starts from."""
        return self.sil.function("set_input")(self._self, self._pointer(self._input(u)))

    def verify(self, n: int) -> int:
        """Look at up to n values of the running set for damage."""
        return self.sil.function("verify")(self._self, ctypes.c_uint32(n))

    def save(self) -> bytes:
        """All of the instance without addresses. AssertionError if it runs or may roll back to a set that is nowhere."""
        byte = np.zeros(self.sil.saved_size, dtype=np.uint8)
        status = self.sil.function("save")(self._self, self._pointer(byte))
        if status:
            raise AssertionError(f"save refused: {status:#x}")
        return byte.tobytes()

    def restore(self, saved: bytes) -> int:
        """What save() gave, of this model and real type."""
        if len(saved) != self.sil.saved_size:
            raise ValueError(f"{len(saved)} bytes; an instance of {self.sil.model.name} is saved in {self.sil.saved_size}")
        return self.sil.function("restore")(self._self, ctypes.c_char_p(saved))

    def status(self) -> Report:
        """Read and clear the sticky flags and their counts."""
        report = Report()
        self.sil.function("status")(self._self, ctypes.byref(report))
        return report

    def begin(self, head: Sequence[int]) -> int:
        return self.sil.function("tune_begin")(self._self, ctypes.byref(Head(*head)))

    def write(self, offset: int, values: ArrayLike) -> int:
        part = self._vector(values)
        return self.sil.function("tune_write")(self._self, ctypes.c_uint32(offset), self._pointer(part), ctypes.c_uint32(part.size))

    def begin_copy(self, identity: int) -> int:
        """Open a set with the values of the running one."""
        return self.sil.function("tune_begin_copy")(self._self, ctypes.c_uint32(identity))

    def write_bytes(self, offset: int, part: bytes) -> int:
        """Bytes of a set's serial form, behind its head."""
        return self.sil.function("tune_write_bytes")(self._self, ctypes.c_uint32(offset), ctypes.c_char_p(part), ctypes.c_uint32(len(part)))

    def expect(self, checksum: int) -> int:
        return self.sil.function("tune_expect")(self._self, ctypes.c_uint32(checksum))

    def withdraw(self) -> int:
        return self.sil.function("tune_withdraw")(self._self)

    def pending(self) -> bool:
        """Does a committed set wait for the next step?"""
        waits = ctypes.c_bool()
        self.sil.function("tune_pending")(self._self, ctypes.byref(waits))
        return waits.value

    def commit(self) -> int:
        return self.sil.function("tune_commit")(self._self)

    def abort(self) -> int:
        return self.sil.function("tune_abort")(self._self)

    def rollback(self) -> int:
        return self.sil.function("tune_rollback")(self._self)

    def select(self, what: str | Set) -> int:
        """Select a committed set by name, or one that the caller made (it is kept alive)."""
        chosen = self.sil.flash_set(what) if isinstance(what, str) else what
        self._kept.append(chosen)
        return self.sil.function("tune_select")(self._self, ctypes.byref(chosen))

    def hold(self, on: bool) -> int:
        return self.sil.function("tune_hold")(self._self, ctypes.c_bool(on))

    def running(self) -> Head:
        head = Head()
        self.sil.function("tune_running")(self._self, ctypes.byref(head))
        return head
