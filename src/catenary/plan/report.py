"""Plan as text: devices, SyncManagers, FMMUs, entries, frames and watchdogs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from catenary.model.device import Assignment, Direction
from catenary.plan.axis_report import AxisReport
from catenary.plan.clocks import SyncPlan
from catenary.plan.cycle import ClockPlan, CyclePlan, DatagramKind, DatagramPlan, FramePlan
from catenary.plan.download import Download
from catenary.plan.frames import ACYCLIC_GUARD
from catenary.plan.layout import Layout
from catenary.plan.modules import ident_lines, module_lines
from catenary.plan.numbers import entry_places
from catenary.plan.register_commands import register_lines
from catenary.plan.start_up import DevicePlan
from catenary.wire.cia402 import Mode
from catenary.wire.clock import Activation
from catenary.wire.datagram import OVERHEAD, EcatCommand
from catenary.wire.frame import HEADER_SIZE, wire_time_ns

COMMON_SOURCES = ("SII", "CoE", "IgH master")  # of mappings, not printed
_ARROW = {Direction.OUTPUT: "out", Direction.INPUT: "in "}


def report(
    cycle: CyclePlan,
    devices: Sequence[DevicePlan],
    layout: Layout,
    axes: Sequence[AxisReport] = (),
) -> str:
    """Return a plan as text, for `print(plan)`.

    Args:
        cycle: Plan of the cycle.
        devices: Plans of the devices.
        layout: Places of the process data.
        axes: Reports of all axes, in order.
    """
    clocks = [] if cycle.clock is None else list(clock_lines(cycle.clock, cycle.period_ns, devices))
    return "\n".join(
        [
            *_heading(cycle),
            *_devices(devices),
            *_start_up(devices),
            *_axes(cycle, axes),
            *_copies(cycle),
            *clocks,
            *_frames(cycle),
            *_units(layout),
        ]
    )


def _heading(cycle: CyclePlan) -> Iterator[str]:
    yield (
        f"Plan: {cycle.device_count} devices, period {cycle.period_ns / 1e6:g} ms, "
        f"{cycle.execution}, receive {cycle.receive_mode}, "
        f"{cycle.output_size} bytes out, {cycle.input_size} bytes in, {len(cycle.axes)} axes"
    )


def _devices(devices: Sequence[DevicePlan]) -> Iterator[str]:
    for device in devices:
        place = device.layout
        off = ", watchdog off" if place.output_size else ""
        origin = f" ({device.watchdog_source})" * bool(device.watchdog_source)
        on = f", watchdog {device.watchdog_ns / 1e6:g} ms{origin}"
        watchdog = on if device.watchdog_ns else off
        yield (
            f"device {device.position:>3}  {device.name}  station 0x{device.station_address:04X}  "
            f"{place.output_size} out, {place.input_size} in{watchdog}"
        )
        for manager in place.sync_managers:
            control = f"control 0x{manager.control:02X}"
            if manager.triggers_watchdog:
                control += ", triggers the watchdog"
            yield (
                f"    SyncManager {manager.index} {_ARROW[manager.direction]}  "
                f"0x{manager.start:04X} + {manager.length}  {control}"
            )
        for fmmu in place.fmmus:
            yield (
                f"    FMMU {fmmu.index} {_ARROW[fmmu.direction]}  "
                f"logical 0x{fmmu.logical_start:08X} + {fmmu.length}  "
                f"→ 0x{fmmu.physical_start:04X}"
            )
        if place.mailbox is not None:
            yield f"    FMMU {place.mailbox.index} in   mailbox full, 1 bit"
        if device.sync is not None:
            yield f"    {sync_text(device.sync)}"
        if device.modules is not None:
            yield from (f"    {line}" for line in module_lines(device.modules))
        if device.mapping_source not in COMMON_SOURCES and (device.outputs or device.inputs):
            yield f"    mapping from {device.mapping_source}"
        yield from _entries(Direction.OUTPUT, device.outputs, place.output_offset)
        yield from _entries(Direction.INPUT, device.inputs, place.input_offset)
        if device.left_out:
            yield f"    not exchanged (optional): {', '.join(device.left_out)}"
        yield from (f"    register {each}" for each in register_lines(device.registers))


def _start_up(devices: Sequence[DevicePlan]) -> Iterator[str]:
    """Yield the SDO downloads in the order of writing, with old and new values."""
    chosen = [each for each in devices if each.downloads or each.commands.in_safe_op]
    if chosen:
        yield "start-up: SDOs written in PRE-OP, in this order"
    for device in chosen:
        yield f"    device {device.position}  {device.name}"
        if device.modules is not None:
            yield from (f"        {'modules':<15} {each}" for each in ident_lines(device.modules))
        old = {change.what: change.old or "(not read)" for change in device.changes}
        yield from (
            _download(device.commands.origin, each, old) for each in device.commands.in_pre_op
        )
        yield from (_download("before mapping", each, old) for each in device.before_mapping)
        for change in device.changes:
            if ":" not in change.what:  # a list of PDOs or of entries
                before = change.old or "(not read)"
                yield f"        {'mapping':<15} {change.what}  {before} → {change.new}"
        for each in device.start_up:
            yield _download("yours" if each.text else "Catenary", each, old)
        origin = device.commands.origin
        late = f"{origin}, in SAFE-OP"
        yield from (_download(late, each, old) for each in device.commands.in_safe_op)
        omitted = f"{origin}, omitted"
        yield from (f"        {omitted:<15} {each}" for each in device.commands.omitted)


def _download(owner: str, download: Download, old: Mapping[str, str]) -> str:
    """Return one download as text. `old` holds the old values of changed objects, by place."""
    before = old.get(download.place)
    value = download.text or download.data.hex(" ")
    unverified = ", not verified" if download.text and not download.verify else ""
    change = f"{value} (unchanged)" if before is None else f"{before} → {value}"
    source = f"  {download.source}" * bool(download.source)
    return f"        {owner:<15} {download.place}  {change}{unverified}{source}"


def _axes(cycle: CyclePlan, axes: Sequence[AxisReport]) -> Iterator[str]:
    if not axes:
        return
    late = (
        ("CSP", cycle.late_limit_position_ns),
        ("CSV", cycle.late_limit_velocity_ns),
        ("CST", cycle.late_limit_torque_ns),
    )
    limits = ", ".join(f"{mode} {ns / 1e6:g} ms" if ns else f"{mode} off" for mode, ns in late)
    yield (
        f"axes: late limit {limits}; "
        f"CST keeps its torque for {cycle.handover_ns / 1e6:g} ms after a law or stream ended"
    )
    yield (
        "    in the background, an update is valid for "
        f"{cycle.command_timeout_velocity_ns / 1e6:g} ms in CSV and PV, "
        f"{cycle.command_timeout_torque_ns / 1e6:g} ms in CST"
    )
    for number, axis in enumerate(axes):
        yield f"    axis {number}  {axis.name}  {', '.join(Mode(m).name for m in axis.modes)}"
        yield from (f"        {line}" for line in axis.lines)


def sync_text(sync: SyncPlan) -> str:
    """Return one device's SYNC signals and the related settings, as text."""
    second = f", SYNC1 {sync.sync1_ns / 1e3:g} us later" * (Activation.SYNC1 in sync.activation)
    hidden = "" if Activation.SYNC0 in sync.activation else " (not signalled to the device)"
    mode = f", OpMode {sync.op_mode!r}" * bool(sync.op_mode)
    mode += f" ({sync.source})" * sync.source.startswith("ESI")
    return (
        f"SYNC0 every {sync.cycle_ns / 1e3:g} us{hidden}, "
        f"{sync.shift_ns / 1e3:+g} us after the common SYNC0 time{second}, "
        f"AssignActivate 0x{sync.assign_activate:04X}{mode}"
    )


def clock_lines(clock: ClockPlan, period_ns: int, devices: Sequence[DevicePlan]) -> Iterator[str]:
    """Yield the reference clock, the time of the cycle starts, and the phase controller.

    Args:
        clock: Synchronisation of the cycle.
        period_ns: Period of the cycle [ns].
        devices: Plans of the devices.
    """
    name = devices[clock.reference].name
    follows = {
        "reference": "the cycle start follows it",
        "main": "it follows the MainDevice",
    }[clock.follow]
    yield f"reference clock: device {clock.reference} ({name}); {follows}"
    yield (
        f"    cycle starts {(period_ns - clock.phase_ns) / 1e3:g} us before SYNC0: "
        f"margin {clock.allowance_ns / 1e3:g} us, {clock.wire_ns / 1e3:g} us of frames"
    )
    yield (
        f"    phase controller: time constant {period_ns / clock.bandwidth / 1e6:g} ms, at most "
        f"{clock.rate_limit_ns / period_ns * 1e6:g} ppm of the period"
    )


def _entries(direction: Direction, assignments: Sequence[Assignment], offset: int) -> Iterator[str]:
    for pdo, places in groupby(entry_places(assignments, offset), key=lambda place: place.pdo):
        yield f"    PDO 0x{pdo.index:04X} {_ARROW[direction]}  {pdo.name}".rstrip()
        for _, entry, bit in places:
            what = str(entry) if entry.index else f"gap ({entry.bit_length} bits)"
            yield f"        {bit // 8:>5}.{bit % 8}  {what}"


def _copies(cycle: CyclePlan) -> Iterator[str]:
    """Yield the copies between devices."""
    if cycle.copies:
        yield "copies between devices"
    for copy in cycle.copies:
        whole = copy.bit_length % 8 == 0
        count, noun = (copy.bit_length // 8, "byte") if whole else (copy.bit_length, "bit")
        yield f"    {copy.name}, {count} {noun}{'s' if count > 1 else ''}"


def _frames(cycle: CyclePlan) -> Iterator[str]:
    yield _wire_time(cycle)
    yield from _exact_matching(cycle.frames)
    for number, frame in enumerate(cycle.frames):
        when = f", every {frame.divider} cycles" if frame.divider > 1 else ""
        yield f"frame {number}: {len(frame.template)} bytes{when}"
        for datagram in frame.datagrams:
            yield f"    {_datagram(datagram)}"


def _wire_time(cycle: CyclePlan) -> str:
    """Return the wire time of the busiest cycle, as text."""
    acyclic = f"up to {cycle.acyclic_ns / 1e3:g} us" if cycle.acyclic_ns else "one frame"
    return (
        f"wire time: {cycle.wire_ns / 1e3:g} us of {cycle.period_ns / 1e3:g} us for cyclic frames, "
        f"{acyclic} for acyclic frames, {ACYCLIC_GUARD:.0%} of the period free"
    )


def _exact_matching(frames: Sequence[FramePlan]) -> Iterator[str]:
    """Yield the cost of the cycle numbers. In the padding of short frames, they cost nothing."""
    sizes = [
        (HEADER_SIZE + sum(OVERHEAD + d.length for d in frame.datagrams), OVERHEAD + number.length)
        for frame in frames
        for number in frame.datagrams
        if number.kind is DatagramKind.CYCLE_NUMBER
    ]
    if not sizes:
        return
    time_ns = sum(wire_time_ns(size) - wire_time_ns(size - added) for size, added in sizes)
    total = sum(added for _, added in sizes)
    yield (
        f"exact matching: a cycle number in each frame; {total} bytes and "
        f"{time_ns / 1e3:g} us of wire time for {len(sizes)} frames"
    )


def _datagram(datagram: DatagramPlan) -> str:
    unit = "" if datagram.sync_unit < 0 else f"  sync unit {datagram.sync_unit}"
    return (
        f"{EcatCommand(datagram.command).name}  {datagram.length} bytes at {datagram.offset}  "
        f"expected counter {datagram.expected_counter}{unit}  {datagram.kind.name}"
    )


def _units(layout: Layout) -> Iterator[str]:
    for number, unit in enumerate(layout.units):
        optional = ", optional" if unit.optional else ""
        every = f", every {unit.divider} cycles" if unit.divider > 1 else ""
        how = "LRW" if unit.logical_read_write else "LRD + LWR"
        yield f"sync unit {number}: {unit.name}, {how}{optional}{every}"
