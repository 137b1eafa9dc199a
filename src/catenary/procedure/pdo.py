"""PDO assignment and mapping in the object dictionary, ETG.1000.6 §5.6.7.4.

The mapping of a device is read, written according to a plan, and verified.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from catenary.errors import ConfigurationError, MappingError, SdoAbort
from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Direction,
    Entry,
    Pdo,
    mapped_pdos,
)
from catenary.plan.download import Download
from catenary.plan.pdo_mapping import ASSIGNMENT_BASE, shape
from catenary.plan.pdo_search import place_names
from catenary.plan.start_up import DevicePlan, restoring_downloads
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import OBJECT_MISSING, download, refused, upload, upload_small

WRITE_ONLY = frozenset((0x0601_0000, 0x0601_0001))  # abort codes of an object that cannot be read
# Abort codes of an optional object that is absent, read-only, or refuses the value or the state
OPTIONAL_ABORTS = OBJECT_MISSING | {0x0601_0000, 0x0601_0002, 0x0609_0030, 0x0800_0020, 0x0800_0022}


def read_mapping(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Read the present mapping of a device, and return the description with it.

    A direction whose 0x1C1x cannot be read keeps its mapping (SII or ESI), as in IgH (fsm_pdo.c).

    Args:
        channel: The mailbox of the device.
        device: The description.

    Raises:
        MappingError: An assigned PDO is in neither the dictionary nor the SII.
    """
    outputs = yield from _read_direction(channel, device, Direction.OUTPUT)
    inputs = yield from _read_direction(channel, device, Direction.INPUT)
    return replace(
        device,
        outputs=device.outputs if outputs is None else outputs,
        inputs=device.inputs if inputs is None else inputs,
        output_pdos=_joined(device.output_pdos, outputs),
        input_pdos=_joined(device.input_pdos, inputs),
        mapping_source=device.mapping_source if outputs is None and inputs is None else "CoE",
    )


def write_downloads(
    channel: MailboxChannel, device: DeviceDescription, plan: DevicePlan
) -> Procedure[None]:
    """Write the SDO downloads of a plan in order.

    If the device refuses the new mapping, the old one is written back as far as possible.

    Args:
        channel: The mailbox of the device.
        device: The description with the old mapping.
        plan: The plan of the device.

    Raises:
        MappingError: The device refused the new mapping. The message names the object and the
            alternatives.
        SdoAbort: The device refused another download. Optional objects that are absent, read-only,
            or refuse the value are skipped.
        ConfigurationError: The value of a start-up object differs after it was written.
    """
    for step in (*plan.commands.in_pre_op, *plan.before_mapping):
        yield from write_object(channel, step)
    for step in plan.mapping:
        try:
            yield from download(channel, step.index, step.subindex, step.data)
        except SdoAbort as abort:
            yield from restore_mapping(channel, device, plan)
            raise _refused_mapping(channel, plan, step, abort) from abort
    for step in plan.start_up:
        yield from write_object(channel, step)


def write_in_safe_op(channel: MailboxChannel | None, plan: DevicePlan) -> Procedure[None]:
    """Write the objects that the ESI requires between SAFE-OP and OP.

    Args:
        channel: The mailbox of the device; None if it has none.
        plan: The plan of the device.

    Raises:
        SdoAbort: The device refused a download.
    """
    if channel is None:
        return
    for step in plan.commands.in_safe_op:
        yield from write_object(channel, step)


def write_object(channel: MailboxChannel, step: Download) -> Procedure[None]:
    """Write one object outside the mapping, and verify it if the plan requires this.

    Args:
        channel: The mailbox of the device.
        step: The object and its value.

    Raises:
        SdoAbort: The device refused it. Optional objects that it lacks or refuses are skipped.
        ConfigurationError: The value differs after it was written.
    """
    try:
        complete = step.complete_access
        yield from download(channel, step.index, step.subindex, step.data, complete_access=complete)
    except SdoAbort as abort:
        if not (step.optional and abort.code in OPTIONAL_ABORTS):
            what = f"start-up object {step.place} = {step.text or step.data.hex(' ')}"
            what += f" ({step.origin} {step.source})" * bool(step.source)
            raise refused(channel, step.index, step.subindex, abort.code, what=what) from abort
    if not step.verify:
        return
    try:
        found = yield from upload(channel, step.index, step.subindex)
    except SdoAbort as abort:
        if abort.code not in WRITE_ONLY:
            raise
        return
    # Devices may pad texts with zeros, or return an integer of a longer type.
    if found.rstrip(b"\0") != step.data.rstrip(b"\0"):
        raise ConfigurationError(
            f"{channel.station}: start-up object {step.place}: wrote {step.text}, bytes "
            f"{step.data.hex(' ')}; read back {found.hex(' ') or 'nothing'}",
            hint="the device limits or ignores the value; correct it, or use verify=False",
        )


def restore_mapping(
    channel: MailboxChannel, device: DeviceDescription, plan: DevicePlan
) -> Procedure[None]:
    """Write the old mapping back, as far as the device allows.

    SOEM and IgH leave the device without a mapping, so that the next scan finds no process data.

    Args:
        channel: The mailbox of the device.
        device: The description with the old mapping.
        plan: The plan of the device.
    """
    for step in restoring_downloads(device, plan):
        with suppress(SdoAbort):
            yield from download(channel, step.index, step.subindex, step.data)


def _refused_mapping(
    channel: MailboxChannel, plan: DevicePlan, step: Download, abort: SdoAbort
) -> MappingError:
    if step.entry is not None:
        what = f"object {step.entry} cannot be mapped into PDO 0x{step.index:04X}"
    elif step.index < ASSIGNMENT_BASE:
        what = f"the entries of PDO 0x{step.index:04X} cannot be changed"
    else:
        what = f"its list of PDOs, 0x{step.index:04X}, cannot be changed"
    refusal = abort.message.removeprefix(f"{channel.station}: ")
    alternatives = "".join(f"\n    {each}" for each in plan.rejected)
    return MappingError(
        f"{channel.station}: {what}: {refusal}"
        + (f"\n  alternatives that change less:{alternatives}" if alternatives else ""),
        hint="its SII allows the change, but the device does not; request only objects that it "
        "maps, or choose other PDOs with pdos= (print(sub.pdos) shows the mapping)",
    )


def verify_mapping(
    channel: MailboxChannel, device: DeviceDescription, plan: DevicePlan
) -> Procedure[None]:
    """Read the mapping after it was written, and write the old one back if it differs.

    A direction whose 0x1C1x cannot be read is not verified.

    Args:
        channel: The mailbox of the device.
        device: The description with the old mapping.
        plan: The plan of the device.

    Raises:
        MappingError: The mapping of the device differs from the written one.
    """
    for direction in Direction:
        found = yield from _read_direction(channel, device, direction)
        planned = _shape(plan.assignments(direction))
        if found is None or _shape(found) == planned:
            continue
        yield from restore_mapping(channel, device, plan)
        taken = place_names(_shape(found), empty="nothing")
        raise MappingError(
            f"{channel.station}: its mapping of {direction.noun} differs from the written one: "
            f"{taken} instead of {place_names(planned, empty='nothing')}",
            hint="its firmware changes mappings; map only objects that it accepts",
        )


def _shape(assignments: tuple[Assignment, ...]) -> tuple[tuple[int, int, int], ...]:
    return tuple(place for pdo in mapped_pdos(assignments) for place in shape(pdo))


def _read_direction(
    channel: MailboxChannel, device: DeviceDescription, direction: Direction
) -> Procedure[tuple[Assignment, ...] | None]:
    """Read the assignments; return None if no 0x1C1x of this direction can be read."""
    known = {pdo.index: pdo for pdo in device.pdos(direction)}
    before = {each.sync_manager: each for each in device.assignments(direction)}
    shown = False
    for manager in device.sync_managers:
        if manager.use is not direction.use:
            continue
        indices = yield from read_list(channel, ASSIGNMENT_BASE + manager.index)
        if indices is None:
            continue
        pdos = []
        for data in indices:
            index = int.from_bytes(data[:2], "little")
            if index:  # 0 marks an unused place
                pdos.append((yield from _read_pdo(channel, index, known.get(index), manager.index)))
        before[manager.index] = Assignment(manager.index, tuple(pdos))
        shown = True
    return tuple(before[number] for number in sorted(before)) if shown else None


def _read_pdo(
    channel: MailboxChannel, index: int, known: Pdo | None, sync_manager: int
) -> Procedure[Pdo]:
    words = yield from read_list(channel, index)
    if words is None:
        if known is None:
            raise MappingError(
                f"{channel.station} assigns PDO 0x{index:04X}, which is in neither its dictionary "
                "nor its SII",
                hint="write 0x1C12 and 0x1C13 again, or restore its defaults (0x1011)",
            )
        return replace(known, sync_manager=sync_manager)
    if known is None:
        return Pdo(index, read_entries(words, ()), sync_manager)
    return replace(known, entries=read_entries(words, known.entries), sync_manager=sync_manager)


def read_entries(words: list[bytes], known: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """Return the entries of a mapping object, with names and types if known.

    Args:
        words: The values of subindices 1 to n.
        known: Entries with names and types.
    """
    names = {(entry.index, entry.subindex): entry for entry in known}
    return tuple(_entry(data, names) for data in words)


def _entry(data: bytes, names: dict[tuple[int, int], Entry]) -> Entry:
    word = int.from_bytes(data[:4], "little")
    index, subindex, bits = word >> 16, word >> 8 & 0xFF, word & 0xFF
    named = names.get((index, subindex))
    if named is None:
        return Entry(index, subindex, bits)
    return replace(named, bit_length=bits)


def read_list(channel: MailboxChannel, index: int) -> Procedure[list[bytes] | None]:
    """Read subindices 1 to n of a list object. Return None if the device refuses.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
    """
    try:
        count = (yield from upload_small(channel, index, 0))[:1]
        items = []
        for subindex in range(1, int.from_bytes(count, "little") + 1):
            items.append((yield from upload_small(channel, index, subindex)))
    except SdoAbort:
        return None
    return items


def _joined(
    offered: tuple[Pdo, ...], assignments: tuple[Assignment, ...] | None
) -> tuple[Pdo, ...]:
    """Return all PDOs of a device: those of the SII, updated with those that are assigned."""
    if assignments is None:
        return offered
    read = {pdo.index: pdo for pdo in mapped_pdos(assignments)}
    kept = tuple(
        read.pop(pdo.index) if pdo.index in read else replace(pdo, sync_manager=None)
        for pdo in offered
    )
    return kept + tuple(read.values())
