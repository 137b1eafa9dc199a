"""The functions of `pointers` for compiled laws: casts without a call into Python.

Importing this module registers them with Numba.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from catenary.control import pointers

ir: Any = import_module("llvmlite.ir")
numba: Any = import_module("numba")
extending: Any = import_module("numba.extending")


def _pointer_of_address(context: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return numba.types.voidptr(numba.types.int64), generate


def _call_of_addresses(context: Any, function: Any, first: Any, second: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)  # a pointer is passed as a word on x86-64 and AArch64
        kind = ir.FunctionType(ir.VoidType(), [word, word])
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    word = numba.types.int64
    return numba.types.void(word, word, word), generate


pointer: Any = extending.intrinsic(_pointer_of_address)
called: Any = extending.intrinsic(_call_of_addresses)
carray: Any = numba.carray


def _doubles(address: Any, count: Any) -> Callable[..., Any]:
    def compiled(address: Any, count: Any) -> Any:
        return carray(pointer(address), (count,), np.float64)

    return compiled


def _call(function: Any, first: Any, second: Any) -> Callable[..., Any]:
    def compiled(function: Any, first: Any, second: Any) -> Any:
        return called(function, first, second)

    return compiled


extending.overload(pointers.doubles)(_doubles)
extending.overload(pointers.call)(_call)
