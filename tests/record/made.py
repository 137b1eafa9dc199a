"""Layouts, rows and events for tests, made without a loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.record.layout import Field, Layout
from catenary.share import SharedEvent

MONDAY_NS = 1_763_942_400_000_000_000  # a time in UTC
PERIOD_NS = 1_000_000


def make_layout(axes: int, *, period: float = 1e-3) -> Layout:
    """Return the layout of a share with these axes, and two columns with unusual names."""

    def per_axis(name: str, dtype: str, unit: str = "") -> Field:
        return Field(name, dtype, (axes,), unit, True)

    timing = ("period_ns", "lateness_ns", "receive_ns", "process_ns", "send_ns")
    fields = [
        Field("number", "<u8"),
        Field("scheduled_ns", "<i8", (), "ns"),
        *(Field(name, "<i4", (), "ns") for name in timing),
        Field("flags", "<u4"),
        Field("unit_valid", "|u1", (3,)),
    ]
    if axes:
        fields += [
            per_axis(f"{kind}{name}", "<f8", unit)
            for kind in ("", "commanded_")
            for name, unit in (("position", "rad"), ("velocity", "rad/s"), ("torque", "N·m"))
        ]
        fields += [
            per_axis("statusword", "<u2"),
            per_axis("controlword", "<u2"),
            per_axis("mode_actual", "|i1"),
        ]
    fields += [Field("door closed of device 4", "|b1"), Field("Pressure/bar", "<f4")]
    names = tuple(f"joint{n}" for n in range(axes))
    return Layout("cell-1", period, names, tuple(fields), "monotonic", MONDAY_NS)


def make_rows(layout: Layout, count: int, *, first: int = 1) -> npt.NDArray[np.void]:
    """Return rows of a smooth motion with noise; every value differs."""
    random = np.random.default_rng(first)
    rows = np.zeros(count, layout.dtype)
    n = np.arange(first, first + count)
    rows["number"] = n
    rows["scheduled_ns"] = 5_000_000_123 + n * round(layout.period * 1e9)
    for field in layout.fields[2:]:
        rows[field.name] = _values(field, n, random)
    return rows


def _values(field: Field, n: npt.NDArray[np.int64], random: np.random.Generator) -> Any:
    shape = (len(n), *field.shape)
    dtype = np.dtype(field.dtype)
    if dtype.kind == "f":
        phase = np.arange(int(np.prod(field.shape, initial=1))).reshape(field.shape)
        wave = np.sin(n.reshape(-1, *[1] * len(field.shape)) * 2e-3 + phase)
        return (wave + random.normal(0.0, 1e-4, shape)).astype(dtype)
    if field.name == "controlword":
        return np.full(shape, 0x0F, dtype)
    if field.name == "period_ns":
        return random.normal(1e6, 5e3, shape).astype(dtype)
    if dtype.kind == "b":
        return random.integers(0, 2, shape).astype(dtype)
    return random.integers(0, 100, shape).astype(dtype)


def make_event(number: int, kind: str = "DeviceLost", **details: object) -> SharedEvent:
    time = (5_000_000_123 + number * PERIOD_NS) * 1e-9
    message = f"device 2 (elbow) does not answer: {kind}"
    return SharedEvent(1, number, kind, message, time, 2, details)
