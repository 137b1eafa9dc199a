"""Functions of this package that Numba compiles inside a law, and their registration.

Numba asks for them when it compiles for the first time in a process (its entry point
`numba_extensions`, named in pyproject.toml): `import catenary.control` costs no Numba, and without
Numba they are plain functions.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt

P = ParamSpec("P")
R = TypeVar("R")

Row = npt.NDArray[np.float64]
"""A flat row of float64: a law's memory, its parameters, or a part of them."""

MODULES = (
    *("parts", "pid", "cascade", "dynamics", "low_pass", "feed_forward", "impedance"),
    *("admittance", "collision", "identification", "homing"),
)
MARK = "__catenary_compiles__"


def compiles(function: Callable[P, R]) -> Callable[P, R]:
    """Mark a function that laws may call: numbers and rows as input, no allocation, no state."""
    setattr(function, MARK, True)
    return function


def register() -> None:
    """Register the marked functions; Numba calls this once in a process."""
    extending: Any = import_module("numba.extending")
    import_module("catenary.control.pointers_compiled")
    for name in MODULES:
        module = import_module(f"catenary.control.{name}")
        for value in vars(module).values():
            if getattr(value, MARK, False) and value.__module__ == module.__name__:
                extending.register_jitable(value)
