"""Marker and registration of the functions that Numba compiles inside a law.

Numba calls `register` when it compiles for the first time in a process (entry point
`numba_extensions` in pyproject.toml). `import catenary.control` therefore does not import Numba.
Without Numba, the functions are plain Python.
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
"""A flat row of float64: the memory or the parameters of a law, or a part of them."""

MODULES = (
    *("parts", "pid", "cascade", "dynamics", "low_pass", "feed_forward", "impedance"),
    *("admittance", "collision", "identification", "homing"),
    *("kinematics", "null_space", "cartesian", "energy", "delay"),
    *("coupling", "force_feedback", "passivity"),
)
MARK = "__catenary_compiles__"


def compiles(function: Callable[P, R]) -> Callable[P, R]:
    """Mark a function that a law may call.

    Its arguments are numbers and rows. It allocates nothing and keeps no state of its own.
    """
    setattr(function, MARK, True)
    return function


def register() -> None:
    """Register the marked functions. Numba calls this once per process."""
    extending: Any = import_module("numba.extending")
    import_module("catenary.control.pointers_compiled")
    for name in MODULES:
        module = import_module(f"catenary.control.{name}")
        for value in vars(module).values():
            if getattr(value, MARK, False) and value.__module__ == module.__name__:
                extending.register_jitable(value)
