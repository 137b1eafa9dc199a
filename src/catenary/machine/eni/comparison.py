"""Comparison of an ENI with the plan: commands that the plan restates with other values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.esi.eni.clocks import sync_signals
from catenary.esi.eni.settings import watchdog_of
from catenary.esi.eni.values import EniDevice, EniFile, RegisterCommand
from catenary.model.device import DeviceDescription, Direction, MailboxLayout
from catenary.plan.init_commands import BY_PLAN
from catenary.plan.planner import Plan
from catenary.plan.start_up import WATCHDOG_DIVIDER, DevicePlan
from catenary.wire import fmmu, register
from catenary.wire.datagram import EcatCommand

SYNC_MANAGERS, FMMUS = register.sync_manager(0), register.fmmu(0)
ASSIGNMENTS = range(0x1C10, 0x1C30)
AREA_END = 0x100  # bytes of all SyncManagers or FMMUs


def compare_plan(eni: EniFile, plan: Plan, devices: Sequence[DeviceDescription]) -> tuple[str, ...]:
    """Return the differences between the file and the plan, with file and line.

    Logical addresses, station addresses and start times are not compared: each MainDevice chooses
    its own.

    Args:
        eni: the file.
        plan: plan of the same devices.
        devices: descriptions of the devices.
    """
    found: list[str] = []
    for device, planned, described in zip(eni.devices, plan.devices, devices, strict=False):
        texts = (
            *_sync_managers(device, planned),
            *_mailbox(device, described.mailbox),
            *_fmmus(device, planned),
            *_watchdog(device, planned),
            *_clock(device, planned),
            *_assignments(device, planned),
            *_omitted(device, planned),
        )
        found += [_with_device(device, text) for text in texts]
    return tuple(found)


def _with_device(device: EniDevice, text: str) -> str:
    place, _, rest = text.partition(": ")
    return f"{place}: {device.name}: {rest}"


def _blocks(device: EniDevice, start: int, size: int) -> dict[int, tuple[bytes, RegisterCommand]]:
    """Return the blocks that the commands of IP and PS leave, by number; cleared ones are absent.

    Args:
        device: the device.
        start: address of block 0.
        size: size of a block.
    """
    blocks: dict[int, tuple[bytes, RegisterCommand]] = {}
    for step in ("IP", "PS"):
        for each in device.commands:
            inside = start <= each.offset < start + AREA_END and not (each.offset - start) % size
            if step not in each.transitions or EcatCommand(each.command).reads or not inside:
                continue
            first = (each.offset - start) // size
            for number in range(len(each.data) // size):
                data = each.data[number * size : (number + 1) * size]
                blocks[first + number] = data, each
    return {number: block for number, block in blocks.items() if any(block[0])}


def _sync_managers(device: EniDevice, planned: DevicePlan) -> Iterator[str]:
    plans = {each.index: each for each in planned.layout.sync_managers}
    mailboxes = 0 if device.mailbox is None else 2
    blocks = _blocks(device, SYNC_MANAGERS.address, SYNC_MANAGERS.size)
    for number, (data, command) in blocks.items():
        if number < mailboxes or not data[6] & 1:
            continue
        start, length, control = (int.from_bytes(data[i:j], "little") for i, j in AREAS)
        text = _area(start, length, control)
        own = plans.get(number)
        mine = "nothing" if own is None else _area(own.start, own.length, own.control)
        if text != mine:
            yield f"{command.source}: SyncManager {number}: the ENI has {text}, the plan {mine}"


AREAS = ((0, 2), (2, 4), (4, 5))  # start, length and control in the block of a SyncManager


def _area(start: int, length: int, control: int) -> str:
    return f"0x{start:04X} + {length}, control 0x{control:02X}"


def _assignments(device: EniDevice, planned: DevicePlan) -> Iterator[str]:
    """Yield the lists of PDOs (0x1C1x) that the CoE commands write, where the plan differs."""
    lists: dict[int, dict[int, int]] = {}
    sources: dict[int, object] = {}
    for request in device.requests:
        command = request.download
        if command is None or request.disabled or command.index not in ASSIGNMENTS:
            continue
        words = lists.setdefault(command.index, {})
        sources[command.index] = request.source
        if not command.complete_access:
            words[command.subindex] = int.from_bytes(command.data, "little")
            continue
        words[0] = int.from_bytes(command.data[:2], "little")  # a padded USINT
        pairs = zip(command.data[2::2], command.data[3::2], strict=False)
        words.update({1 + number: low | high << 8 for number, (low, high) in enumerate(pairs)})
    own = {
        ASSIGNMENTS.start + each.sync_manager: [pdo.index for pdo in each.pdos]
        for direction in Direction
        for each in planned.assignments(direction)
    }
    for index, words in lists.items():
        theirs = [words.get(number, 0) for number in range(1, min(words.get(0, 0), 254) + 1)]
        if theirs != own.get(index, []):
            yield (
                f"{sources[index]}: 0x{index:04X}: the commands of the ENI write {_pdos(theirs)}, "
                f"the plan has {_pdos(own.get(index, []))}"
            )


def _pdos(indices: Sequence[int]) -> str:
    return ", ".join(f"0x{index:04X}" for index in indices) or "no PDO"


def _omitted(device: EniDevice, planned: DevicePlan) -> Iterator[str]:
    """Yield the CoE commands that the plan does not write, without those of the mapping."""
    for each in planned.commands.omitted:
        if BY_PLAN not in each:
            yield f"{device.source}: not written: {each}"


def _mailbox(device: EniDevice, found: MailboxLayout | None) -> Iterator[str]:
    given = device.mailbox
    if given is None:
        return
    mine = None
    if found is not None:
        mine = found.receive_offset, found.receive_size, found.send_offset, found.send_size
    theirs = given.send_start, given.send_length, given.receive_start, given.receive_length
    if mine != theirs:
        yield (
            f"{given.source}: mailbox (out, in): the ENI has {_pair(theirs)}, the device "
            f"{'none' if mine is None else _pair(mine)}, which is used"
        )


def _pair(areas: tuple[int, int, int, int]) -> str:
    return f"0x{areas[0]:04X} + {areas[1]}, 0x{areas[2]:04X} + {areas[3]}"


def _fmmus(device: EniDevice, planned: DevicePlan) -> Iterator[str]:
    """Yield scrambled FMMUs, and differences of the memory that FMMUs map."""
    theirs: dict[Direction, list[tuple[int, int]]] = {direction: [] for direction in Direction}
    for number, (data, command) in _blocks(device, FMMUS.address, FMMUS.size).items():
        if any(data[13:]) or data[12] != 1 or data[11] not in (1, 2, 3):
            yield (
                f"{command.source}: FMMU {number}: its data {data.hex()} is not that of an FMMU, "
                "so it is scrambled; the plan sets the FMMUs"
            )
            return
        block = fmmu.decode_fmmu(data)
        direction = Direction.OUTPUT if block.writes else Direction.INPUT
        if block.bit_length > 1 or block.writes:  # a single input bit is the state of the mailbox
            theirs[direction].append((block.physical_address, block.length))
    for direction, areas in theirs.items():
        own = [
            (each.physical_start, each.length)
            for each in planned.layout.fmmus
            if each.direction is direction
        ]
        if areas and sorted(areas) != sorted(own):
            yield (
                f"{device.source}: FMMUs of {direction.noun}: the ENI maps {_spans(areas)}, the "
                f"plan {_spans(own)}"
            )


def _spans(areas: Sequence[tuple[int, int]]) -> str:
    return ", ".join(f"0x{start:04X} + {length}" for start, length in areas) or "nothing"


def _watchdog(device: EniDevice, planned: DevicePlan) -> Iterator[str]:
    values = watchdog_of(device)
    if values.process_data is None or not planned.layout.output_size:
        return
    divider = WATCHDOG_DIVIDER if values.divider is None else values.divider
    time_ns = values.process_data * register.watchdog_unit_ns(divider)
    if time_ns != planned.watchdog_ns:
        yield (
            f"{device.source}: watchdog: the ENI has {time_ns / 1e6:g} ms, the plan "
            f"{planned.watchdog_ns / 1e6:g} ms"
        )


def _clock(device: EniDevice, planned: DevicePlan) -> Iterator[str]:
    signals, sync = sync_signals(device), planned.sync
    if signals is None and sync is None:
        if device.clock is not None and device.clock.sync0:
            yield (
                f"{device.clock.source}: DC/CycleTime0 has no effect, because no command at PS "
                "starts the SYNC signals (0x0980)"
            )
        return
    theirs = "no SYNC signals"
    if signals is not None:
        theirs = _signals(
            signals.assign_activate, signals.sync0 * 1e9, signals.sync1 * 1e9, signals.shift * 1e9
        )
    mine = "no SYNC signals"
    if sync is not None:
        mine = _signals(sync.assign_activate, sync.cycle_ns, sync.sync1_ns, sync.shift_ns)
    if theirs != mine:
        yield f"{device.source}: clock: the ENI has {theirs}, the plan {mine}"


def _signals(assign: int, sync0_ns: float, sync1_ns: float, shift_ns: float) -> str:
    times = ", ".join(
        f"{name} {round(ns) / 1e6:g} ms"
        for name, ns in (("SYNC0", sync0_ns), ("SYNC1", sync1_ns), ("shift", shift_ns))
    )
    return f"AssignActivate 0x{assign:04X}, {times}"
