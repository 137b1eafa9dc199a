"""Plan of a cycle from descriptions and requests: mapping, layout, frames, start-up lists."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from catenary import notebook
from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, Direction
from catenary.model.module_mapping import with_mapping_of
from catenary.model.telegram_data import with_process_data
from catenary.plan.clock_report import Clocks
from catenary.plan.clocks import ClockChoice, choose_clocks, make_clock_plan, make_sync
from catenary.plan.combination import gather_requests
from catenary.plan.cycle import ClockPlan, CyclePlan, FramePlan, SyncUnit
from catenary.plan.frames import (
    acyclic_wire_time_ns,
    check_return,
    cyclic_wire_time_ns,
    make_frames,
)
from catenary.plan.layout import (
    EXACT_UNIT_MAX,
    UNIT_MAX,
    DeviceData,
    DeviceLayout,
    Layout,
    make_layout,
)
from catenary.plan.mailboxes import MailboxArea, with_mailboxes
from catenary.plan.mapping import make_mapping
from catenary.plan.modules import make_module_plan, with_requested_modules
from catenary.plan.op_mode import chosen_pdos
from catenary.plan.options import PlanOptions
from catenary.plan.output_owners import check_owners
from catenary.plan.pdo_mapping import Mapping
from catenary.plan.report import report
from catenary.plan.request import DeviceRequest, ProcessDataRequest, RequestTables
from catenary.plan.start_up import DevicePlan, compared, make_device_plan
from catenary.plan.watchdog import choose_watchdog
from catenary.wire.cia402 import Mode


@dataclass(frozen=True, slots=True)
class Plan:
    """Complete configuration of one network. `print(plan)` shows it. Plans compare by value.

    `tables[k]` has the axes and columns of the k-th request. `cycle` has those of all requests in
    order, followed by the columns of the `mailboxes`.
    """

    cycle: CyclePlan
    devices: tuple[DevicePlan, ...]
    layout: Layout
    tables: tuple[RequestTables, ...]
    mailboxes: MailboxArea

    @property
    def clocks(self) -> Clocks:
        """SYNC signals of all devices, with the sources of their settings."""
        return Clocks(self.devices, self.cycle.clock, self.cycle.period_ns)

    def __str__(self) -> str:
        axes = [axis for table in self.tables for axis in table.axis_reports]
        return report(self.cycle, self.devices, self.layout, axes)

    def _repr_html_(self) -> str:
        return notebook.preformatted(str(self))


def make_plan(
    devices: Sequence[DeviceDescription],
    requests: Sequence[ProcessDataRequest] = (),
    options: PlanOptions = PlanOptions(),
) -> Plan:
    """Return the plan that fulfils all requests.

    Args:
        devices: Descriptions of all devices of the segment, by position.
        requests: Process-data requests.
        options: Options that do not belong to a single request, such as the period.

    Raises:
        MappingError: An object cannot be mapped.
        ConfigurationError: Requests contradict each other or the devices, or the frames do not fit
            into the period.
        ValueError: An option or a start-up value is out of its range.
        TypeError: A start-up value does not agree with its type.
    """
    drafts = _drafts(devices, requests, options)
    layout, mailboxes = with_mailboxes(_layout(drafts, options), devices)
    clocks = {d.device.position: d.request.clock for d in drafts if d.request.clock is not None}
    choice = choose_clocks(devices, clocks, options.clock, options.reference)
    frames = make_frames(
        layout.units, len(devices), choice, mailboxes, exact_matching=options.exact_matching
    )
    tables = tuple(request.tables(layout) for request in requests)
    check_owners(devices, requests, tables, layout)
    _check_times(tables, options)
    cycle = _make_cycle(layout, mailboxes, frames, tables, options)
    if choice is not None:
        cycle = replace(cycle, clock=_make_clock(choice, cycle, options))
    clock = cycle.clock
    lead_ns = 0 if clock is None else clock.wire_ns + clock.allowance_ns
    plans = tuple(
        draft.plan(place, options.period_ns, lead_ns)
        for draft, place in zip(drafts, layout.devices, strict=True)
    )
    return Plan(cycle, plans, layout, tables, mailboxes)


class _Draft(NamedTuple):
    """One device of a plan, before its process data has places in the images."""

    device: DeviceDescription
    request: DeviceRequest
    outputs: Mapping
    inputs: Mapping
    watchdog_ns: int
    watchdog_source: str
    found: DeviceDescription  # with the mapping that the device reports

    def data(self, *, optional: bool) -> DeviceData:
        return DeviceData(
            self.device,
            self.outputs.assignments,
            self.inputs.assignments,
            self.request.divider,
            optional=optional or not self.request.required,
            watchdog_ns=self.watchdog_ns,
        )

    def plan(self, place: DeviceLayout, period_ns: int, lead_ns: int) -> DevicePlan:
        clock = self.request.clock
        plan = make_device_plan(
            self.device,
            self.request,
            self.outputs,
            self.inputs,
            place,
            self.watchdog_ns if place.output_size else 0,
            None
            if clock is None
            else make_sync(self.device, clock, period_ns * self.request.divider, lead_ns),
            self.watchdog_source if place.output_size else "",
        )
        plan = replace(plan, modules=make_module_plan(self.device, self.request.modules))
        return plan if self.found is self.device else compared(plan, self.found)


def _drafts(
    devices: Sequence[DeviceDescription],
    requests: Sequence[ProcessDataRequest],
    options: PlanOptions,
) -> list[_Draft]:
    """Return the request, the mappings and the watchdog time of every device."""
    combined = gather_requests(requests, options.period_ns)
    _check_positions(devices, combined)
    required = not combined or any(request.required for request in combined.values())
    drafts = []
    for found in devices:
        request = combined.get(found.position, DeviceRequest(required=required))
        if request.telegrams:
            found = with_process_data(found, request.telegrams)
        device = with_requested_modules(found, request.modules)
        watchdog_ns, watchdog_source = choose_watchdog(
            device, request, options.watchdog, options.period_ns
        )
        outputs, inputs = (
            chosen_pdos(device, request.pdos, request.clock, each) for each in Direction
        )
        drafts.append(
            _Draft(
                device,
                request,
                make_mapping(device, Direction.OUTPUT, request.outputs, outputs),
                make_mapping(device, Direction.INPUT, request.inputs, inputs),
                watchdog_ns,
                watchdog_source,
                device if device is found else with_mapping_of(device, found),
            )
        )
    return drafts


def _check_positions(
    devices: Sequence[DeviceDescription], combined: dict[int, DeviceRequest]
) -> None:
    known = [device.position for device in devices]
    if known != list(range(len(devices))):
        raise ValueError(f"devices must have the positions 0, 1, 2, ... of a segment, not {known}")
    for position in combined:
        if position not in range(len(devices)):
            raise ConfigurationError(
                f"a request names device {position}, but the segment has {len(devices)} devices",
                hint="scan again, or correct the position",
            )


def _layout(drafts: Sequence[_Draft], options: PlanOptions) -> Layout:
    data = [draft.data(optional=draft.device.position in options.optional) for draft in drafts]
    return make_layout(data, EXACT_UNIT_MAX if options.exact_matching else UNIT_MAX)


def _make_cycle(
    layout: Layout,
    mailboxes: MailboxArea,
    frames: tuple[FramePlan, ...],
    tables: Sequence[RequestTables],
    options: PlanOptions,
) -> CyclePlan:
    """Return the cycle without its clocks."""
    wire_ns = cyclic_wire_time_ns(frames)
    acyclic_ns = acyclic_wire_time_ns(wire_ns, options.period_ns)
    if options.execution == "threaded":
        check_return(wire_ns, options.period_ns, options.collect_deadline_ns)
    input_columns = [column for table in tables for column in table.input_columns]
    cycle = CyclePlan(
        period_ns=options.period_ns,
        execution=options.execution,
        receive_mode=options.receive_mode,
        collect_deadline_ns=options.collect_deadline_ns,
        output_size=layout.output_size,
        input_size=layout.input_size,
        frames=frames,
        sync_units=tuple(SyncUnit(u.name, u.devices, u.optional, u.divider) for u in layout.units),
        device_count=len(layout.devices),
        axes=tuple(axis for table in tables for axis in table.axes),
        output_columns=tuple(column for table in tables for column in table.output_columns),
        input_columns=(*input_columns, *mailboxes.columns),
        output_areas=tuple(area for table in tables for area in table.output_areas),
        input_areas=tuple(area for table in tables for area in table.input_areas),
        copies=tuple(copy for table in tables for copy in table.copies),
        wire_ns=wire_ns,
        acyclic_ns=acyclic_ns,
    )
    return _with_options(cycle, options)


def _make_clock(choice: ClockChoice, cycle: CyclePlan, options: PlanOptions) -> ClockPlan:
    return make_clock_plan(
        choice,
        cycle.frames,
        cycle.device_count,
        cycle.period_ns,
        cycle.execution,
        options.margin,
        options.burst,
    )


def _with_options(cycle: CyclePlan, options: PlanOptions) -> CyclePlan:
    """Return the cycle with the limits, the log and the thread settings of the options."""
    return replace(
        cycle,
        lost_limit=options.lost_limit,
        late_limit_position_ns=round(options.late_limit_position * 1e9),
        late_limit_velocity_ns=round(options.late_limit_velocity * 1e9),
        late_limit_torque_ns=round(options.late_limit_torque * 1e9),
        handover_ns=round(options.handover * 1e9),
        command_timeout_velocity_ns=round(options.command_timeout_velocity * 1e9),
        command_timeout_torque_ns=round(options.command_timeout_torque * 1e9),
        stop_deadline_ns=round(options.stop_deadline * 1e9),
        busy_wait_ns=round(options.busy_wait * 1e9),
        log_cycles=options.log,
        log_axes=options.log_axes,
        cpu=options.cpu,
        priority=options.priority,
    )


def _check_times(tables: Sequence[RequestTables], options: PlanOptions) -> None:
    """Raise ValueError for times that would leave an axis in CST under torque indefinitely."""
    if not 0 < options.handover < math.inf:
        raise ValueError(f"handover={options.handover} s: must be positive and finite")
    if options.late_limit_torque:
        return
    for table in tables:
        for axis in table.axis_reports:
            if Mode.CST in axis.modes:
                raise ValueError(
                    f"{axis.name}: late_limit=0 is refused with CST: a stalled program would "
                    "leave its last torque on the motor; give a time [s]"
                )
