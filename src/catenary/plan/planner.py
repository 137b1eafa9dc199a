"""Plan of a cycle from descriptions and requests: mapping, layout, frames, start-up lists."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from catenary import notebook
from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, Direction
from catenary.plan.clocks import BURST, SyncPlan, choose_clocks, make_clock_plan, make_sync
from catenary.plan.cycle import CyclePlan, ExecutionMode, FollowedClock, ReceiveMode, SyncUnit
from catenary.plan.frames import (
    acyclic_wire_time_ns,
    check_return,
    cyclic_wire_time_ns,
    make_frames,
)
from catenary.plan.layout import EXACT_UNIT_MAX, UNIT_MAX, DeviceData, Layout, make_layout
from catenary.plan.mailboxes import MailboxArea, with_mailboxes
from catenary.plan.mapping import make_mapping
from catenary.plan.output_owners import check_owners
from catenary.plan.pdo_mapping import Mapping
from catenary.plan.report import report
from catenary.plan.request import (
    DeviceRequest,
    DistributedClock,
    ObjectReference,
    ProcessDataRequest,
    RequestTables,
    WrittenPdo,
)
from catenary.plan.start_up import DevicePlan, make_device_plan
from catenary.plan.start_up_object import StartUp
from catenary.plan.watchdog import choose_watchdog
from catenary.wire.cia402 import Mode

PERIOD_MIN, PERIOD_MAX = 1e-6, 1000.0  # [s]; the core's limits are wider


@dataclass(frozen=True, slots=True)
class Plan:
    """Complete configuration of one network: `print(plan)` shows it. Plans compare by value.

    `tables[k]` has the axes and columns of the k-th request. In `cycle` the tables follow one
    another, and then come the columns of the `mailboxes`.
    """

    cycle: CyclePlan
    devices: tuple[DevicePlan, ...]
    layout: Layout
    tables: tuple[RequestTables, ...]
    mailboxes: MailboxArea

    def __str__(self) -> str:
        axes = [axis for table in self.tables for axis in table.axis_reports]
        return report(self.cycle, self.devices, self.layout, axes)

    def _repr_html_(self) -> str:
        return notebook.preformatted(str(self))


def make_plan(
    devices: Sequence[DeviceDescription],
    requests: Sequence[ProcessDataRequest] = (),
    *,
    period: float = 1e-3,
    execution: ExecutionMode = "threaded",
    receive_mode: ReceiveMode = "wait",
    optional: Collection[int] = (),
    watchdog: float | None = None,
    collect_share: float = 0.8,
    lost_limit: int = 3,
    late_limit_position: float = 0.050,
    late_limit_velocity: float = 0.050,
    late_limit_torque: float = 0.010,
    handover: float = 0.020,
    command_timeout_velocity: float = 0.200,
    command_timeout_torque: float = 0.020,
    stop_deadline: float = 2.0,
    busy_wait: float = 0.0,
    log: int = 1000,
    cpu: int | None = None,
    priority: int | None = 80,
    clock: FollowedClock = "reference",
    reference: int | None = None,
    margin: float | None = None,
    burst: int = BURST,
    exact_matching: bool = False,
    log_axes: bool = False,
) -> Plan:
    """Return the plan that fulfils all requests.

    Args:
        devices: Descriptions of all devices of the segment, by position.
        requests: Process-data requests.
        period: Period of the cycle [s].
        execution: "threaded" or "inline".
        receive_mode: "poll", "wait" or "busy".
        watchdog: Watchdog time of process data [s]; 0: off; None: 0.1 s, for devices in CST the
            longer of 10 ms and five exchanges.
        optional: Positions without which the cycle is good, in addition to the devices of optional
            requests. Devices without a request are required if any other one is.
        lost_limit: Number of consecutive bad cycles before WorkingCounterError.
        late_limit_position: Late limit in CSP [s].
        late_limit_velocity: Late limit in CSV [s].
        late_limit_torque: Late limit in CST [s].
        handover: Time for which CST keeps its torque after a law or stream ended [s].
        command_timeout_velocity: Validity of an update in the background in CSV [s].
        command_timeout_torque: Validity of an update in the background in CST [s].
        stop_deadline: Longest time from quick stop to standstill [s].
        busy_wait: Time of a busy-wait before each cycle start [s].
        collect_share: If threaded, share of the period in which frames may return.
        log: Number of cycles in the log.
        clock: Clock that the others follow.
        reference: Position of the reference clock; None: the first device with a clock.
        margin: Time between the cycle start and the frames [s]; None: by the execution mode.
        burst: Number of frames that synchronise the clocks before the cycle begins.
        exact_matching: True: every frame carries the cycle number (plan/frames.py).
        cpu: CPU of the native thread; None: unchanged.
        priority: SCHED_FIFO priority of the native thread; None: unchanged.
        log_axes: True: the log also has the values of the axes.

    Raises:
        ConfigurationError: An object cannot be mapped, requests contradict each other, or the
            frames do not fit into the period.
    """
    period_ns = period_in_ns(period)
    asked = _asked(devices, requests, period_ns)
    watchdogs = [
        choose_watchdog(device, asked.get(device.position, DeviceRequest()), watchdog, period_ns)
        for device in devices
    ]
    mappings = [
        _mappings(device, asked.get(device.position, DeviceRequest())) for device in devices
    ]
    unasked = DeviceRequest(
        required=not asked or any(request.required for request in asked.values())
    )
    data = [
        _device_data(device, mapping, asked.get(device.position, unasked), watchdog_ns)
        for device, mapping, watchdog_ns in zip(devices, mappings, watchdogs, strict=True)
    ]
    data = [replace(d, optional=d.optional or d.position in optional) for d in data]
    layout = make_layout(data, EXACT_UNIT_MAX if exact_matching else UNIT_MAX)
    syncs = _syncs(devices, asked, period_ns)
    layout, mailboxes = with_mailboxes(layout, devices)
    choice = choose_clocks(devices, _clock_requests(asked), clock, reference)
    frames = make_frames(
        layout.units, len(devices), choice, mailboxes, exact_matching=exact_matching
    )
    wire_ns = cyclic_wire_time_ns(frames)
    acyclic_ns = acyclic_wire_time_ns(wire_ns, period_ns)
    collect_ns = round(period_ns * collect_share)
    if execution == "threaded":
        check_return(wire_ns, period_ns, collect_ns)
    tables = tuple(request.tables(layout) for request in requests)
    check_owners(devices, requests, tables, layout)
    _check_times(tables, late_limit_torque, handover)
    cycle = CyclePlan(
        period_ns=period_ns,
        execution=execution,
        receive_mode=receive_mode,
        collect_deadline_ns=collect_ns,
        output_size=layout.output_size,
        input_size=layout.input_size,
        frames=frames,
        sync_units=tuple(SyncUnit(u.name, u.devices, u.optional, u.divider) for u in layout.units),
        device_count=len(devices),
        axes=tuple(axis for table in tables for axis in table.axes),
        output_columns=tuple(c for table in tables for c in table.output_columns),
        input_columns=(
            *(c for table in tables for c in table.input_columns),
            *mailboxes.columns,
        ),
        output_areas=tuple(area for table in tables for area in table.output_areas),
        input_areas=tuple(area for table in tables for area in table.input_areas),
        lost_limit=lost_limit,
        late_limit_position_ns=round(late_limit_position * 1e9),
        late_limit_velocity_ns=round(late_limit_velocity * 1e9),
        late_limit_torque_ns=round(late_limit_torque * 1e9),
        handover_ns=round(handover * 1e9),
        command_timeout_velocity_ns=round(command_timeout_velocity * 1e9),
        command_timeout_torque_ns=round(command_timeout_torque * 1e9),
        stop_deadline_ns=round(stop_deadline * 1e9),
        wire_ns=wire_ns,
        acyclic_ns=acyclic_ns,
        busy_wait_ns=round(busy_wait * 1e9),
        log_cycles=log,
        log_axes=log_axes,
        cpu=cpu,
        priority=priority,
        clock=None
        if choice is None
        else make_clock_plan(choice, frames, len(devices), period_ns, execution, margin, burst),
    )
    plans = tuple(
        make_device_plan(
            device,
            outputs,
            inputs,
            place,
            asked.get(device.position, DeviceRequest()).start_up,
            each.watchdog_ns if place.output_size else 0,
            syncs.get(device.position),
            asked.get(device.position, DeviceRequest()).objects,
        )
        for device, (outputs, inputs), place, each in zip(
            devices, mappings, layout.devices, data, strict=True
        )
    )
    return Plan(cycle, plans, layout, tables, mailboxes)


def period_in_ns(period: float) -> int:
    """Return a period in [ns]. ValueError unless it is between 1 us and 1000 s."""
    if not PERIOD_MIN <= period <= PERIOD_MAX:
        raise ValueError(f"period={period} s: must be {PERIOD_MIN:g} to {PERIOD_MAX:g} s")
    return round(period * 1e9)


def gather_requests(
    requests: Sequence[ProcessDataRequest], period_ns: int
) -> dict[int, DeviceRequest]:
    """Return the combined requests for each device, by position.

    Args:
        requests: Process-data requests.
        period_ns: Period of the cycle.
    """
    gathered: dict[int, DeviceRequest] = {}
    for request in requests:
        for position, pdos in request.pdos(period_ns).items():
            before = gathered.get(position, DeviceRequest(divider=pdos.divider, required=False))
            gathered[position] = DeviceRequest(
                _merged(before.outputs, pdos.outputs),
                _merged(before.inputs, pdos.inputs),
                before.start_up + tuple(d for d in pdos.start_up if d not in before.start_up),
                _one_clock(position, before.clock, pdos.clock),
                math.gcd(before.divider, pdos.divider),
                before.required or pdos.required,
                _one_mapping(position, before.pdos, pdos.pdos),
                _one_start_up(position, before.objects, pdos.objects),
            )
    return gathered


def _asked(
    devices: Sequence[DeviceDescription], requests: Sequence[ProcessDataRequest], period_ns: int
) -> dict[int, DeviceRequest]:
    asked = gather_requests(requests, period_ns)
    known = [device.position for device in devices]
    if known != list(range(len(devices))):
        raise ValueError(f"devices must be all of a segment in order, not positions {known}")
    for position in asked:
        if position not in range(len(devices)):
            raise ConfigurationError(
                f"a request names device {position}; the segment has {len(devices)} devices",
                hint="scan again, or correct the position",
            )
    return asked


def _one_clock(
    position: int, first: DistributedClock | None, second: DistributedClock | None
) -> DistributedClock | None:
    if first is not None and second is not None and first != second:
        raise ConfigurationError(
            f"device {position}: two requests need different clocks: {first} and {second}",
            hint="give both the same dc=",
        )
    return first if second is None else second


def _one_mapping(
    position: int, first: tuple[WrittenPdo, ...], second: tuple[WrittenPdo, ...]
) -> tuple[WrittenPdo, ...]:
    """Return the PDOs that two requests write down: per direction, one of them or equal ones."""
    directions = {pdo.direction for pdo in first} & {pdo.direction for pdo in second}
    for direction in directions:
        if [p for p in first if p.direction is direction] != [
            p for p in second if p.direction is direction
        ]:
            raise ConfigurationError(
                f"device {position}: two requests write down different PDOs for {direction.noun}",
                hint="give both the same pdos=, or only one of them",
            )
    return first + tuple(pdo for pdo in second if pdo not in first)


def _one_start_up(
    position: int, first: tuple[StartUp, ...], second: tuple[StartUp, ...]
) -> tuple[StartUp, ...]:
    """Return the start-up objects of two requests. They must not contradict each other."""
    values = {(each.index, each.subindex): each for each in first}
    for each in second:
        other = values.get((each.index, each.subindex))
        if other is not None and other != each and each not in first:
            raise ConfigurationError(
                f"device {position}: two requests write different values to start-up object "
                f"{each.place}: {other.value!r} and {each.value!r}",
                hint="give both the same start_up=, or only one of them",
            )
    return first + tuple(each for each in second if each not in first)


def _clock_requests(asked: dict[int, DeviceRequest]) -> dict[int, DistributedClock]:
    return {
        position: request.clock for position, request in asked.items() if request.clock is not None
    }


def _syncs(
    devices: Sequence[DeviceDescription], asked: dict[int, DeviceRequest], period_ns: int
) -> dict[int, SyncPlan]:
    return {
        position: make_sync(devices[position], request, period_ns * asked[position].divider)
        for position, request in _clock_requests(asked).items()
    }


def _check_times(
    tables: Sequence[RequestTables], late_limit_torque: float, handover: float
) -> None:
    """Raise ValueError for times that would leave an axis in CST under torque indefinitely."""
    if not 0 < handover < math.inf:
        raise ValueError(f"handover must be positive and finite [s], not {handover}")
    if late_limit_torque:
        return
    for table in tables:
        for axis in table.axis_reports:
            if Mode.CST in axis.modes:
                raise ValueError(
                    f"{axis.name}: late_limit=0 is refused with CST: a stalled program would "
                    "leave its last torque on the motor; give a time [s]"
                )


def _merged(
    first: tuple[ObjectReference, ...], second: tuple[ObjectReference, ...]
) -> tuple[ObjectReference, ...]:
    return first + tuple(reference for reference in second if reference not in first)


def _mappings(device: DeviceDescription, request: DeviceRequest) -> tuple[Mapping, Mapping]:
    return (
        make_mapping(device, Direction.OUTPUT, request.outputs, request.written(Direction.OUTPUT)),
        make_mapping(device, Direction.INPUT, request.inputs, request.written(Direction.INPUT)),
    )


def _device_data(
    device: DeviceDescription,
    mapping: tuple[Mapping, Mapping],
    request: DeviceRequest,
    watchdog_ns: int,
) -> DeviceData:
    outputs, inputs = (direction.assignments for direction in mapping)
    return DeviceData(
        device,
        outputs,
        inputs,
        request.divider,
        optional=not request.required,
        watchdog_ns=watchdog_ns,
    )
