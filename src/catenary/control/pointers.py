"""Access to memory and functions of a C library by address.

This module uses ctypes. A compiled law uses the native code of `pointers_compiled` instead.
"""

from __future__ import annotations

import ctypes

import numpy as np

from catenary.control.compiles import Row


def doubles(address: int, count: int) -> Row:
    """Return a view of `count` float64 values at an address."""
    found: Row = np.ctypeslib.as_array((ctypes.c_double * count).from_address(address))
    return found


def call(function: int, first: int, second: int) -> None:
    """Call the C function `void (void *first, void *second)` at the address `function`."""
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(function)(first, second)
