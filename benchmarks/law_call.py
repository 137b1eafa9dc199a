"""`python -m benchmarks law`: time of one call of a compiled law, from native code.

The time includes the bounds checks and the function that converts exceptions into a status. The
laws are a PD law, and a cascade of `catenary.control` with friction and feed-forward.
"""

from __future__ import annotations

import ctypes
import statistics
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.needed import need
from catenary import control
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.loop import law
from catenary.loop.laws.compiler import compile_law
from catenary.loop.laws.law import Law
from catenary.loop.laws.layout import LawLayout, record_type
from catenary.loop.laws.run import Numbers

CALLS = 100_000
ROUNDS = 31


@law
def pd(actual, target, memory, time, parameters):  # type: ignore[no-untyped-def]
    for i in range(actual.n):
        error = memory[i] - actual.position[i]
        target.torque[i] = parameters[0] * error - parameters[1] * actual.velocity[i]
    return time > 5.0


@law
def cascade(actual, target, memory, parameters):  # type: ignore[no-untyped-def]
    gains, motor = control.part(parameters, 0), control.part(parameters, 1)
    rub = control.part(parameters, 2)
    for i in range(actual.n):
        known = control.feed_forward(motor, i, 0.1, 0.2) + control.friction(rub, i, 0.1)
        target.torque[i] = control.cascade(
            memory, gains, i, 1.0, 0.1, known, actual.position[i], actual.velocity[i], 1e-3
        )


def measure(*, axes: int, file: Path | None) -> None:
    need("numba")
    print(f"{machine()}\n{axes} axes, {CALLS} calls, {ROUNDS} times")
    figures: dict[str, object] = {"machine": machine(), "axes": axes}
    for name, of_law in {"pd": pd, "cascade": cascade}.items():
        found = sorted(call_times(axes, of_law))
        median = statistics.median(found)
        print(f"  {name:8} median {median:.1f} ns a call, {found[0]:.1f} to {found[-1]:.1f}")
        figures["call_ns" if of_law is pd else f"{name}_ns"] = [round(ns, 2) for ns in found]
        figures[name] = {"p50": round(median, 2)}  # [ns]
    write(file, figures)


def numbers_of(axes: int, of_law: Law) -> tuple[Numbers, Numbers]:
    """Return the memory and the parameters of a law."""
    if of_law is pd:
        return np.zeros(axes), np.array([4.0, 0.2])
    block = control.Cascade(
        control.Pid(axes, 20.0, limit=3.0, rate=50.0),
        control.Pid(axes, 40.0, 200.0, limit=100.0, rate=1e4),
    )
    known = control.FeedForward(axes, 0.1), control.Friction(axes, 0.1, 0.2)
    return block.memory, control.join(block.parameters, *(part.parameters for part in known))


def call_times(axes: int, of_law: Law = pd) -> list[float]:
    """Return the time per call [ns] of each round."""
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
    compiled = compile_law(of_law, layout)
    actual, target = np.zeros(1, layout.actual), np.zeros(1, layout.target)
    actual["n"] = axes
    memory, parameters = numbers_of(axes, of_law)
    pointer = ctypes.CFUNCTYPE(
        ctypes.c_int32,
        *(ctypes.c_void_p, ctypes.c_void_p),
        *(ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64),
        ctypes.c_double,
    )(compiled.address)

    memory_count, parameter_count = len(memory), len(parameters)

    @numba.njit  # type: ignore[untyped-decorator]
    def many(a: int, t: int, m: int, p: int) -> int:
        total = 0
        for _ in range(CALLS):
            total += pointer(a, t, m, memory_count, p, parameter_count, 1.0)
        return total

    places = [array.ctypes.data for array in (actual, target, memory, parameters)]
    many(*places)
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter_ns()
        many(*places)
        times.append((time.perf_counter_ns() - start) / CALLS)
    return times
