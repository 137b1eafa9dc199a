"""Memory and functions of a C library by their addresses: here by ctypes, in a law natively
(`pointers_compiled`)."""

from __future__ import annotations

import ctypes

import numpy as np

from catenary.control.compiles import Row


def doubles(address: int, count: int) -> Row:
    """Return a view of `count` float64 at an address."""
    found: Row = np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))
    return found


def call(function: int, first: int, second: int) -> None:
    """Call the C function `void function(void *, void *)` at an address."""
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(function)(first, second)
