"""Timelines of captures as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from catenary.capture import Device, Event, EventStream, MasterSummary
from catenary.capture.cycles import CycleStatistics
from catenary.capture.notes import notes
from catenary.capture.rows import Row, merge
from catenary.capture.spread import Spread
from catenary.capture.text import duration
from catenary.cli.tables import table
from catenary.cli.text import escaped

ALL = "all"
DEVICE_WIDTH, STEP_WIDTH = 14, 9
HEAD = f"{'time s':>12}  {'packet':>8}  {'device':{DEVICE_WIDTH}}  {'step':{STEP_WIDTH}}  event"


def print_rows(stream: EventStream, events: Iterable[Event]) -> None:
    """Print the events while they are read, with a line for each master.

    Args:
        stream: The capture.
        events: Its chosen events.
    """
    known = -1
    for row in merge(events):
        if known < 0:
            print(HEAD)
        while known < row.first.master:
            known += 1
            print(f"master {known}: {stream.masters[known].master}")
        print(row_text(row, stream.device(row.first)))


def row_text(row: Row, device: Device | None) -> str:
    """Return one line: time, packet, device, step, event.

    Args:
        row: The events.
        device: Their device; None for all devices.
    """
    event = row.first
    name = ALL if device is None else str(device)
    if event.master:
        name = f"m{event.master}: {name}"
    return (
        f"{event.time_ns * 1e-9:12.6f}  {event.packet:8}  {escaped(name):{DEVICE_WIDTH}}  "
        f"{event.step!s:{STEP_WIDTH}}  {escaped(str(row))}"
    )


def print_summary(stream: EventStream) -> None:
    """Print the statistics at the end of a capture: masters, devices, process data, clocks."""
    counts = stream.counts
    print(
        f"\n{counts.packets} packets in {duration(counts.duration_ns)}, "
        f"{counts.ethercat} of them EtherCAT"
    )
    for summary in stream.masters:
        print("\n".join(_master_lines(summary)))
    for note in notes(counts, stream.masters):
        print(f"note: {escaped(note)}")


def _master_lines(summary: MasterSummary) -> Iterator[str]:
    master = summary.master
    yield (
        f"\nmaster {master.number}: {master}, {len(summary.devices)} devices, "
        f"{master.sent} frames sent, {master.returned} returned, {master.lost} lost"
    )
    if summary.devices:
        head = ("position", "station", "vendor:product:revision", "serial", "name", "state")
        yield _indented(table([head, *(_device_cells(each) for each in summary.devices)]))
    for cycle in summary.cycles:
        yield from _cycle_lines(cycle)
    for number, clock in summary.clocks.items():
        yield (
            f"  clock of {escaped(str(summary.devices[number]))}: difference read "
            f"{clock.reads} times, first {duration(clock.first_ns)}, last "
            f"{duration(clock.last_ns)}, largest {duration(clock.largest_ns)}"
        )
    if summary.reference is not None:
        reference = summary.reference
        place = f"position {reference.address}"
        if not reference.by_position:
            place = f"station 0x{reference.address:04X}"
        drift = "" if reference.drift_ppm is None else f", drift {reference.drift_ppm:+.1f} ppm"
        yield (
            f"  reference clock at {place}: {reference.datagrams} times distributed in "
            f"{duration(reference.span_ns)}{drift}"
        )


def _device_cells(device: Device) -> tuple[str, ...]:
    numbers = (device.vendor, device.product, device.revision)
    return (
        "-" if device.position is None else str(device.position),
        "-" if device.station is None else f"0x{device.station:04X}",
        ":".join("-" if number is None else f"0x{number:08X}" for number in numbers),
        "-" if device.serial is None else str(device.serial),
        device.order or device.name or "-",
        "-" if device.state is None else str(device.state),
    )


def _cycle_lines(cycle: CycleStatistics) -> Iterator[str]:
    yield f"  process data {', '.join(map(str, cycle.layout))}: {cycle.frames} frames"
    yield f"    period {_spread(cycle.periods)}"
    yield f"    answer after {_spread(cycle.latencies)}"
    counters = ", ".join(map(str, cycle.working_counters))
    yield f"    working counter {counters}, {cycle.drops} times smaller, {cycle.lost} frames lost"


def _spread(spread: Spread) -> str:
    if not spread.count:
        return "unknown"
    return (
        f"{duration(spread.mean)}, from {duration(spread.minimum)} to {duration(spread.maximum)}, "
        f"standard deviation {duration(spread.deviation)}"
    )


def _indented(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines())
