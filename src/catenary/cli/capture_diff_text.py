"""Comparisons of captures as text."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from catenary.capture.compared_master import Side
from catenary.capture.diff import CaptureComparison
from catenary.capture.difference import DeviceComparison, Difference, Mark, Topic
from catenary.capture.events import Device
from catenary.cli.text import escaped

ABSENT = "—"
MAXIMUM_WIDTH = 60
STEP_WIDTH = 11


def print_comparison(comparison: CaptureComparison, a: str, b: str) -> None:
    """Print the captures, the devices with their rows, and the summary.

    Args:
        comparison: The result.
        a: Path of A.
        b: Path of B.
    """
    print("\n".join(map(escaped, _head(comparison, a, b))))
    print()
    for line in _devices(comparison):
        print(escaped(line))
    print()
    for line in _summary(comparison, a, b):
        print(escaped(line))


def _head(comparison: CaptureComparison, a: str, b: str) -> Iterator[str]:
    rows = [
        (letter, Path(name).name, *_side(side))
        for letter, name, side in (("A", a, comparison.a), ("B", b, comparison.b))
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for letter, *cells in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths[1:], strict=True))
        yield f"{letter} {line.rstrip()}"
    yield (
        "Devices paired by vendor, product, serial, then by order. "
        f"Compared: INIT → {comparison.until}. Times are not compared."
    )


def _side(side: Side) -> tuple[str, ...]:
    if side.summary is None:
        return "no master", "", ""
    master = str(side.summary.master)
    if side.masters > 1:
        master += f", 1 of {side.masters} masters"
    took = "" if side.start_up_ns is None else f"start-up {side.start_up_ns * 1e-9:.2f} s"
    return master, f"{len(side.summary.devices)} devices", took


def _devices(comparison: CaptureComparison) -> Iterator[str]:
    rows = [row for each in comparison.devices for row in each.rows]
    left = max([1, *(min(len(row.a), MAXIMUM_WIDTH) for row in rows)])
    right = max([1, *(min(len(row.b), MAXIMUM_WIDTH) for row in rows)])
    width = max([0, *(len(_name(each)) for each in comparison.devices)])
    for each in comparison.devices:
        place = _place(each)
        if _has_table(each):
            yield f"{place}  {_name(each)} {_stations(each)}"
            yield f"   {'step':{STEP_WIDTH}}  {'A':{left}}  B"
            for row in each.rows:
                yield _row(row, left, right)
        else:
            yield f"{place}  {_name(each):{width}}  {_short(each)}"


def _has_table(device: DeviceComparison) -> bool:
    return any(row.mark is not Mark.ORDER and row.subject != "device" for row in device.rows)


def _row(row: Difference, left: int, right: int) -> str:
    a, b = (_cell(text) for text in (row.a, row.b))
    return f"   {row.step!s:{STEP_WIDTH}}  {a:{left}}  {b:{right}}  {row.remark}".rstrip()


def _cell(text: str) -> str:
    if not text:
        return ABSENT
    return text if len(text) <= MAXIMUM_WIDTH else f"{text[: MAXIMUM_WIDTH - 3]}..."


def _short(device: DeviceComparison) -> str:
    """Return the line of a device without a table."""
    if device.pair.a is None or device.pair.b is None:
        return f"{device.rows[0].mark.value} {_stations(device)}"
    if not device.rows:
        return f"same ({device.registers} register writes, {device.objects} SDO)"
    orders = [
        f"order of {row.note} differs"
        if row.topic is Topic.OBJECT
        else f"{row.a} in A, {row.b} in B"
        for row in device.rows
    ]
    return f"same; {'; '.join(orders)}"


def _place(device: DeviceComparison) -> int:
    found = device.pair.device
    return found.number if found.position is None else found.position


def _name(device: DeviceComparison) -> str:
    known = [each for each in (device.pair.a, device.pair.b) if each is not None]
    named = next((each.order or each.name for each in known if each.order or each.name), "")
    if named:
        return named
    identity = next((each for each in known if each.vendor is not None), None)
    if identity is None:
        return "unknown device"
    return f"0x{identity.vendor:08X}:0x{identity.product:08X}"


def _stations(device: DeviceComparison) -> str:
    found = [
        f"{letter} {'-' if each.station is None else f'0x{each.station:04X}'}"
        for letter, each in (("A", device.pair.a), ("B", device.pair.b))
        if each is not None
    ]
    return f"({', '.join(found)})"


def _summary(comparison: CaptureComparison, a: str, b: str) -> Iterator[str]:
    if comparison.equal:
        yield "No differences."
        return
    yield f"{', '.join(_counts(comparison))}."
    first = comparison.first
    if first is None:
        yield "Only the results differ: compare the process data and its timing."
        return
    before = "" if not first.side else f" before {first.side}'s error"
    code = "" if first.error is None else f" 0x{first.error:04X}"
    yield f"First difference{before}{code}: {first.text}."
    yield f"  try: {_next_command(comparison, a, b)}"


def _counts(comparison: CaptureComparison) -> Iterator[str]:
    """Yield the numbers of rows that are not 0."""
    if differing := comparison.count(Mark.DIFFERS, effect=True):
        verb = "difference that changes" if differing == 1 else "differences that change"
        yield f"{differing} {verb} what a device does"
    if harmless := comparison.count(Mark.DIFFERS, effect=False):
        yield f"{harmless} differs without an effect"
    for mark in (Mark.ONLY_A, Mark.ONLY_B):
        if count := comparison.count(mark):
            harmless = comparison.count(mark, effect=False)
            yield f"{count} {mark.value}" + (f" ({harmless} without an effect)" if harmless else "")
    if orders := comparison.count(Mark.ORDER):
        yield f"{orders} order"
    if results := comparison.count(Mark.RESULT):
        yield f"{results} with another result"


def _next_command(comparison: CaptureComparison, a: str, b: str) -> str:
    first = comparison.first
    assert first is not None
    device = first.device
    writes = any(row.topic in (Topic.OBJECT, Topic.MAPPING) for row in device.rows)
    if writes and device.pair.a is not None and device.objects:
        arguments = ["sdo", shlex.quote(a), "--device", _number(device.pair.a)]
        arguments += ["--format", "machine"]
    else:
        name = a if device.pair.b is None else b
        found = device.pair.b or device.pair.device
        arguments = ["show", shlex.quote(name), "--device", _number(found)]
    return f"catenary capture {' '.join(arguments)}"


def _number(device: Device) -> str:
    """Return the value of --device: the position, else the station address."""
    return f"0x{device.station or 0:04X}" if device.position is None else str(device.position)
