"""Steps from PRE-OP to SAFE-OP: read the mappings for a plan, and write the plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.bus.ring import end_for_clocks
from catenary.bus.runner import BlockingRunner
from catenary.bus.segment_scan import check_identity
from catenary.bus.sub_device import SubDevice
from catenary.errors import (
    ConfigurationError,
    MailboxError,
    MappingError,
    ResponseTimeout,
    SegmentError,
)
from catenary.link import RingLink
from catenary.model.device import DeviceDescription, Direction, mapped_pdos
from catenary.model.telegram_data import with_process_data
from catenary.plan.clocks import SYNC_OBJECTS
from catenary.plan.combination import gather_requests
from catenary.plan.modules import with_requested_modules
from catenary.plan.op_mode import chosen_pdos
from catenary.plan.pdo_search import any_carries
from catenary.plan.planner import Plan
from catenary.plan.request import DeviceRequest, ObjectReference, ProcessDataRequest
from catenary.plan.start_up import DevicePlan
from catenary.plan.start_up_object import StartUp
from catenary.procedure.al_state import request_state
from catenary.procedure.clocks import ClockMeasurement
from catenary.procedure.configure import configure_process_data
from catenary.procedure.exchange import Procedure
from catenary.procedure.idn_commands import PRE_OP_STEPS, SAFE_OP_STEPS, run_idn_commands
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.modules import check_order, prepare_modules
from catenary.procedure.names import name_entries
from catenary.procedure.pdo import (
    read_mapping,
    verify_mapping,
    write_downloads,
    write_in_safe_op,
)
from catenary.procedure.pdo_offers import read_offers, read_values
from catenary.procedure.profile import read_object
from catenary.procedure.register_commands import run_commands
from catenary.procedure.station import within
from catenary.procedure.sync import bring_together, read_types, stop, write_types
from catenary.procedure.telegrams import check_unchanged, restore
from catenary.wire.al import AlState

READ_TIMEOUT = 60.0  # [s] to read one device for a plan: hundreds of slow SDOs
WRITE_TIMEOUT = 60.0  # [s] to write and verify the objects of one device


def describe_mappings(
    runner: BlockingRunner,
    subs: Sequence[SubDevice],
    requests: Sequence[ProcessDataRequest],
    period_ns: int,
) -> None:
    """Update the mapping and the requested objects in the descriptions of all CoE devices.

    Objects that are requested but not mapped are read from the dictionaries. A device without
    requests keeps its description if it cannot be read.

    Args:
        runner: Runner of the procedures.
        subs: Devices of the segment.
        requests: Process-data requests.
        period_ns: Period of the cycle [ns].

    Raises:
        CatenaryError: A device with requests cannot be read. No description changes.
    """
    asked = gather_requests(requests, period_ns)
    with_coe = [sub for sub in subs if sub.description.coe]
    found = runner.run_all([_renewed(sub, asked.get(sub.position)) for sub in with_coe])
    for sub, description in zip(with_coe, found, strict=True):
        sub.description = description


def bring_to_safe_op(
    runner: BlockingRunner,
    subs: Sequence[SubDevice],
    plan: Plan,
    epoch_ns: int = 0,
    ring: RingLink | None = None,
) -> ClockMeasurement | None:
    """Bring all devices to PRE-OP, write the plan, synchronise the clocks, and request SAFE-OP.

    All devices are handled at the same time. 0x1C32:01 and 0x1C33:01 are saved before clocks are
    first used, and restored by a later plan without clocks.

    Args:
        runner: Runner of the procedures.
        subs: Devices of the segment.
        plan: Plan to write.
        epoch_ns: System time minus link time [ns].
        ring: Ring link of the segment; None for a line.

    Returns:
        Measurement of the clocks; None if the plan has no clocks.

    Raises:
        SegmentError: The number of devices differs from the plan.
        IdentityError: A device is not the planned one.
        StateError: A device refuses a state.
        ClockError: The ring is cut, so the clocks cannot be synchronised.
    """
    if len(subs) != len(plan.devices):
        raise SegmentError(
            f"the plan is for {len(plan.devices)} devices, but the segment has {len(subs)}",
            hint="scan and plan again",
        )
    for sub, device in zip(subs, plan.devices, strict=True):
        check_identity(sub.description, device.identity)
    runner.run_all([_prepare(sub, device) for sub, device in zip(subs, plan.devices, strict=True)])
    devices = [sub.description for sub in subs]
    runner.run(stop([device for device in devices if device.clock_bits]))
    measured = None
    if plan.cycle.clock is not None:
        syncs = {each.position: each.sync for each in plan.devices if each.sync is not None}
        clock = plan.cycle.clock
        end = None if ring is None else end_for_clocks(runner, ring, devices)
        measured = runner.run(
            bring_together(
                devices, syncs, clock.reference, epoch_ns, clock.burst, clock.follow, end
            )
        )
    runner.run_all([request_state(sub.station, AlState.SAFE_OP) for sub in subs])
    planned = zip(subs, plan.devices, strict=True)
    runner.run_all([_finish(sub, device) for sub, device in planned])
    for sub in subs:
        sub.state = AlState.SAFE_OP
    return measured


def _renewed(sub: SubDevice, request: DeviceRequest | None) -> Procedure[DeviceDescription]:
    """Read a device and return its new description.

    If a device without requests cannot be read, return its previous description.
    """
    reading = within(READ_TIMEOUT, sub.station, _describe(sub, request or DeviceRequest()))
    try:
        return (yield from reading)
    except (MailboxError, MappingError, ResponseTimeout):
        if request is not None:
            raise
        return sub.description


def _describe(sub: SubDevice, request: DeviceRequest) -> Procedure[DeviceDescription]:
    channel = _channel(sub)
    device = yield from read_mapping(channel, sub.description)
    device = yield from name_entries(channel, device)
    written = [(index, subindex) for index, subindex, _ in request.start_up]
    written += [(each.index, each.subindex) for each in request.objects]
    commands = [each for each in device.init_commands if not each.complete_access]
    written += [(each.index, each.subindex) for each in commands]
    if request.clock is not None:
        written += [(index, subindex) for index in SYNC_OBJECTS for subindex in (1, 2)]
    device = yield from read_values(channel, device, written)
    wanted = with_requested_modules(device, request.modules)
    for direction, references in (
        (Direction.OUTPUT, request.outputs),
        (Direction.INPUT, request.inputs),
    ):
        missing = _unmapped(wanted, direction, references)
        if missing or chosen_pdos(device, request.pdos, request.clock, direction):
            device = yield from read_offers(channel, device, direction)
        required = [each for each in missing if each.required]
        device = yield from _with_objects(channel, device, required)
    return (yield from _with_objects(channel, device, request.objects))


def _with_objects(
    channel: MailboxChannel,
    device: DeviceDescription,
    missing: Sequence[ObjectReference] | Sequence[StartUp],
) -> Procedure[DeviceDescription]:
    """Return the description, with the dictionary entries of the missing objects added."""
    for reference in missing:
        if device.known_object(reference.index, reference.subindex) is None:
            found = yield from read_object(channel, device, reference.index, reference.subindex)
            device = replace(device, objects=(*device.objects, found))
            if found.note:
                device = replace(device, notes=(*device.notes, found.note))
    return device


def _unmapped(
    device: DeviceDescription, direction: Direction, references: Sequence[ObjectReference]
) -> list[ObjectReference]:
    pdos = mapped_pdos(device.assignments(direction))
    return [each for each in references if not any_carries(pdos, each)]


def _prepare(sub: SubDevice, plan: DevicePlan) -> Procedure[None]:
    device = sub.description
    yield from request_state(sub.station, AlState.PRE_OP)
    if device.coe and plan.sync is not None and not sub.sync_types:
        sub.sync_types = yield from read_types(_channel(sub))
    elif plan.sync is None and sub.sync_types:
        yield from write_types(_channel(sub), sub.sync_types)
        sub.sync_types = {}
    if device.coe and plan.modules is not None:
        preparing = prepare_modules(_channel(sub), device, plan)
        what = "its modules were"
        device, plan = yield from within(WRITE_TIMEOUT, sub.station, preparing, what)
        sub.description = device
        check_order(device, plan)
    if plan.downloads:
        writing = _write(_channel(sub), device, plan)
        yield from within(WRITE_TIMEOUT, sub.station, writing, "its configuration was")
    idns = (*device.idn_commands, *plan.idns)
    if idns:
        yield from run_idn_commands(_channel(sub), idns, PRE_OP_STEPS)
    if plan.telegrams:
        device = sub.description = with_process_data(device, plan.telegrams)
        yield from restore(_channel(sub), device)
    elif device.sercos_axes:
        yield from check_unchanged(_channel(sub), device)
    yield from configure_process_data(sub.station, device, plan)
    yield from run_commands(sub.station, plan.registers, "PS")


def _finish(sub: SubDevice, plan: DevicePlan) -> Procedure[None]:
    if plan.commands.in_safe_op:
        writing = write_in_safe_op(_channel(sub), plan)
        yield from within(WRITE_TIMEOUT, sub.station, writing, "its configuration was")
    if sub.description.idn_commands:
        yield from run_idn_commands(_channel(sub), sub.description.idn_commands, SAFE_OP_STEPS)
    yield from run_commands(sub.station, plan.registers, "SO")


def _write(channel: MailboxChannel, device: DeviceDescription, plan: DevicePlan) -> Procedure[None]:
    yield from write_downloads(channel, device, plan)
    if plan.mapping_changed:
        yield from verify_mapping(channel, device, plan)


def _channel(sub: SubDevice) -> MailboxChannel:
    if sub.channel is None:
        raise ConfigurationError(
            f"{sub.station} has no mailbox for its start-up objects",
            hint="request no SDO downloads for this device",
        )
    return sub.channel
