"""`catenary bench law`: what one call of a compiled law takes, called again and again from native
code: the law with its bounds checks and the function that turns what it raises into a status."""

from __future__ import annotations

import ctypes
import statistics
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.loop import law
from catenary.loop.laws.compiler import compile_law
from catenary.loop.laws.layout import LawLayout, record_type

CALLS = 100_000
ROUNDS = 31


@law
def pd(actual, target, memory, time, parameters):  # type: ignore[no-untyped-def]
    for i in range(actual.n):
        error = memory[i] - actual.position[i]
        target.torque[i] = parameters[0] * error - parameters[1] * actual.velocity[i]
    return time > 5.0


def measure(*, axes: int, file: Path | None) -> None:
    found = sorted(call_times(axes))
    median = statistics.median(found)
    print(f"{machine()}\na PD law on {axes} axes, {CALLS} calls, {ROUNDS} times")
    print(f"  median {median:.1f} ns a call, {found[0]:.1f} to {found[-1]:.1f}")
    write(file, {"machine": machine(), "axes": axes, "call_ns": [round(ns, 2) for ns in found]})


def call_times(axes: int) -> list[float]:
    """[ns] a call, of every round."""
    numba: Any = import_module("numba")
    block = 8 * axes
    layout = LawLayout(
        record_type(
            {
                "n": (0, "<u4", None),
                "position": (8, "<f8", axes),
                "velocity": (8 + block, "<f8", axes),
            },
            (),
            8 + 2 * block,
        ),
        record_type({"torque": (0, "<f8", axes)}, (), block),
    )
    compiled = compile_law(pd, layout)
    actual, target = np.zeros(1, layout.actual), np.zeros(1, layout.target)
    actual["n"] = axes
    memory, parameters = np.zeros(axes), np.array([4.0, 0.2])
    pointer = ctypes.CFUNCTYPE(
        ctypes.c_int32,
        *(ctypes.c_void_p, ctypes.c_void_p),
        *(ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64),
        ctypes.c_double,
    )(compiled.address)

    @numba.njit  # type: ignore[untyped-decorator]
    def many(a: int, t: int, m: int, p: int) -> int:
        total = 0
        for _ in range(CALLS):
            total += pointer(a, t, m, axes, p, 2, 1.0)
        return total

    places = [array.ctypes.data for array in (actual, target, memory, parameters)]
    many(*places)
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter_ns()
        many(*places)
        times.append((time.perf_counter_ns() - start) / CALLS)
    return times
