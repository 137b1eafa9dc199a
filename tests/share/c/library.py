"""libcatenary_share.so through ctypes, as C# calls it by P/Invoke."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from ctypes import (
    POINTER,
    byref,
    c_char,
    c_char_p,
    c_double,
    c_int,
    c_int64,
    c_size_t,
    c_uint32,
    c_uint64,
    c_void_p,
)
from pathlib import Path
from typing import Any

import numpy as np

ARGUMENT, NOT_FOUND, PERMISSION, NOT_TRUSTED, DAMAGED, VERSION = -1, -2, -3, -4, -5, -6
DEAD, ENDED, EMPTY, OVERWRITTEN, LEASED = -7, -8, -9, -10, -11
LEASE_ENDED, NOT_READ, LOCKED, FULL, NO_COMMANDS = -12, -13, -14, -15, -16
REFUSED = -20
DISABLE, ENABLE, QUICK_STOP, RESET = 0, 1, 2, 3
RUNNING, STATE_ENDED, STATE_DEAD = 1, 2, 3
STALE = 1
OWN_UID = -1


class ErrorText(ctypes.Structure):
    _fields_ = (("code", ctypes.c_int32), ("text", c_char * 508))


class Field(ctypes.Structure):
    _fields_ = (
        ("name", c_char_p),
        ("unit", c_char_p),
        ("offset", c_uint64),
        ("count", c_uint32),
        ("size", c_uint32),
        ("kind", c_char),
        ("per_axis", ctypes.c_uint8),
    )


class CError(Exception):
    """A negative code of the library, with its text."""

    def __init__(self, error: ErrorText) -> None:
        self.code = error.code
        super().__init__(error.text.decode())


SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "open": (c_int, (POINTER(c_void_p), c_char_p, c_int64, c_int, POINTER(ErrorText))),
    "close": (None, (c_void_p,)),
    "period": (c_double, (c_void_p,)),
    "utc_offset_ns": (c_int64, (c_void_p,)),
    "is_virtual": (c_int, (c_void_p,)),
    "writer_pid": (c_int64, (c_void_p,)),
    "axis_count": (c_uint32, (c_void_p,)),
    "axis_name": (c_char_p, (c_void_p, c_uint32)),
    "find_axis": (c_int64, (c_void_p, c_char_p)),
    "field_count": (c_uint32, (c_void_p,)),
    "field_at": (POINTER(Field), (c_void_p, c_uint32)),
    "find_field": (POINTER(Field), (c_void_p, c_char_p)),
    "state": (c_int, (c_void_p,)),
    "newest": (c_uint64, (c_void_p,)),
    "wait": (c_int, (c_void_p, c_uint64, c_double, POINTER(ErrorText))),
    "row_size": (c_size_t, (c_void_p,)),
    "read": (
        c_int,
        (c_void_p, c_void_p, c_size_t, POINTER(c_uint64), POINTER(ErrorText)),
    ),
    "read_cycle": (c_int, (c_void_p, c_uint64, c_void_p, c_size_t, POINTER(ErrorText))),
    "value": (c_double, (POINTER(Field), c_void_p, c_uint32)),
    "lease_take": (
        c_int,
        (
            c_void_p,
            POINTER(c_uint32),
            c_uint32,
            c_double,
            POINTER(c_void_p),
            POINTER(ErrorText),
        ),
    ),
    "lease_send": (c_int, (c_void_p, *[POINTER(c_double)] * 3, POINTER(ErrorText))),
    "lease_renew": (c_int, (c_void_p, POINTER(ErrorText))),
    "lease_request": (c_int, (c_void_p, c_int, POINTER(ErrorText))),
    "lease_request_status": (c_int, (c_void_p, POINTER(ErrorText))),
    "lease_release": (c_int, (c_void_p, POINTER(ErrorText))),
    "stop": (c_int, (c_void_p, POINTER(ErrorText))),
}


class Library:
    """The functions of catenary_share.h, with their types."""

    def __init__(self, path: Path) -> None:
        library = ctypes.CDLL(str(path))
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(library, f"catenary_{name}")
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)

    def checked(self, name: str, *arguments: object) -> int:
        """Call a function that reports errors. Raises CError for a negative code."""
        error = ErrorText()
        code = getattr(self, name)(*arguments, byref(error))
        if code < 0:
            assert code == error.code
            raise CError(error)
        return int(code)

    def attach(self, name: str, flags: int = 0, uid: int = OWN_UID) -> CShare:
        handle = c_void_p()
        try:
            self.checked("open", byref(handle), name.encode(), uid, flags)
        except CError:
            assert not handle
            raise
        return CShare(self, handle)


class CShare:
    """A share that C has opened."""

    def __init__(self, library: Library, handle: c_void_p) -> None:
        self.library, self.handle = library, handle
        self.row = ctypes.create_string_buffer(library.row_size(handle))

    def __enter__(self) -> CShare:
        return self

    def __exit__(self, *_: object) -> None:
        self.library.close(self.handle)

    def read(self) -> int:
        number = c_uint64()
        self.library.checked("read", self.handle, self.row, len(self.row), byref(number))
        return number.value

    def read_cycle(self, number: int) -> None:
        self.library.checked("read_cycle", self.handle, number, self.row, len(self.row))

    def values(self, name: str) -> list[float]:
        """Return all numbers of a field of the row that was read last."""
        field = self.library.find_field(self.handle, name.encode())
        assert field
        count = field.contents.count
        assert math.isnan(self.library.value(field, self.row, count))
        return [self.library.value(field, self.row, k) for k in range(count)]

    def lease(self, axes: Sequence[int] | None = None, duration: float = 600.0) -> CLease:
        array = (c_uint32 * len(axes))(*axes) if axes is not None else None
        handle = c_void_p()
        count = len(axes) if axes is not None else 0
        self.library.checked("lease_take", self.handle, array, count, duration, byref(handle))
        return CLease(self.library, handle)


class CLease:
    """A lease that C has taken."""

    def __init__(self, library: Library, handle: c_void_p) -> None:
        self.library, self.handle = library, handle

    def send(
        self,
        position: Sequence[float] | None = None,
        velocity: Sequence[float] | None = None,
        torque: Sequence[float] | None = None,
    ) -> None:
        given = [
            None if values is None else np.ctypeslib.as_ctypes(np.array(values, dtype=float))
            for values in (position, velocity, torque)
        ]
        self.library.checked("lease_send", self.handle, *given)

    def renew(self) -> None:
        self.library.checked("lease_renew", self.handle)

    def request(self, state: int) -> None:
        self.library.checked("lease_request", self.handle, state)

    def request_status(self) -> int:
        return self.library.checked("lease_request_status", self.handle)

    def release(self) -> None:
        self.library.checked("lease_release", self.handle)
