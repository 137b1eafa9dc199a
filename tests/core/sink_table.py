"""The table of a sink (native/sink.h) for the tests of the core."""

from __future__ import annotations

import ctypes

PUT = ctypes.CFUNCTYPE(
    None,
    ctypes.c_void_p,
    ctypes.c_uint64,
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_void_p,
)


class Table(ctypes.Structure):
    """`cat_sink` of native/sink.h."""

    _fields_ = (
        ("version", ctypes.c_uint32),
        ("record_size", ctypes.c_uint32),
        ("actual_size", ctypes.c_uint32),
        ("target_size", ctypes.c_uint32),
        ("self", ctypes.c_void_p),
        ("put", PUT),
        ("motion", ctypes.c_void_p),
        ("motion_axes", ctypes.c_uint32),
        ("jog", ctypes.c_uint32),
    )
