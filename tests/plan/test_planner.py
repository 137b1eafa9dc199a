"""The whole plan: the demo's segment byte by byte, and its expected counters."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from catenary.errors import ConfigurationError, MappingError
from catenary.model.device import Direction
from catenary.plan import Number, NumberKind, PlanOptions, make_plan
from catenary.plan.cycle import Copy, DatagramKind, DatagramPlan
from catenary.plan.layout import MailboxFmmu
from catenary.plan.request import DeviceRequest, RequestTables
from catenary.wire.datagram import EcatCommand
from catenary.wire.features import Feature
from catenary.wire.frame import decode_frame
from tests.plan.devices import Asking, asks, block, coupler, demo, lamps, servo

MAILBOXES = DatagramPlan(  # of three drives, behind the 80 bytes of process data
    DatagramKind.PROCESS_DATA, EcatCommand.LRD, 122, 1, 3, -1, inputs=(Copy(132, 39, 1),)
)


def test_the_demo_segment_in_one_frame() -> None:
    """What SOEM (2 · outputsWKC + inputsWKC) and IgH compute for this segment: five devices with
    outputs, three with inputs: 2 · 5 + 3 = 13."""
    plan = make_plan(demo())
    cycle = plan.cycle
    assert (cycle.output_size, cycle.input_size) == (1 + 3 * 13 + 1, 3 * 13 + 1)
    [frame] = cycle.frames
    assert frame.datagrams == (
        DatagramPlan(DatagramKind.AL_STATUS, EcatCommand.BRD, 16, 2, 6, -1),
        DatagramPlan(
            DatagramKind.PROCESS_DATA,
            EcatCommand.LRW,
            30,
            80,
            13,
            0,
            outputs=(Copy(40, 0, 41),),
            inputs=(Copy(81, 0, 39),),
        ),
        MAILBOXES,
    )
    assert cycle.period_ns == 1_000_000
    assert cycle.device_count == 6
    assert [unit.devices for unit in cycle.sync_units] == [(1, 2, 3, 4, 5)]


def test_the_template_is_a_frame_of_its_datagrams() -> None:
    [frame] = make_plan(demo()).cycle.frames
    decoded = decode_frame(frame.template)
    assert [d.command for d in decoded.datagrams] == [
        EcatCommand.BRD,
        EcatCommand.LRW,
        EcatCommand.LRD,
    ]
    assert decoded.datagrams[0].address == 0x0130_0000
    assert decoded.datagrams[1].address == 0x0001_0000
    assert not any(decoded.datagrams[1].data)


def test_mailbox_bits_do_not_make_a_cycle_bad() -> None:
    plan = make_plan(demo(), options=PlanOptions(optional=[3]))
    assert plan.mailboxes.devices == (2, 3, 4)
    [column] = plan.cycle.input_columns
    assert column.number == Number(8 * 39, 3, NumberKind.UNSIGNED)
    assert plan.cycle.input_size == 39 + 1
    places = [plan.devices[position].layout.mailbox for position in range(6)]
    assert places == [
        *(None, None),
        *(MailboxFmmu(2, 8 * 0x8000 + k) for k in range(3)),
        None,
    ]
    assert "FMMU 2 in   mailbox full, 1 bit" in str(plan)


def test_a_device_without_a_spare_fmmu_has_no_mailbox_bit() -> None:
    small = replace(servo(1), controller=replace(servo(1).controller, fmmu_count=2))
    assert make_plan([coupler(0), small, servo(2)]).mailboxes.devices == (2,)
    bytes_only = servo(1)
    controller = replace(bytes_only.controller, features=Feature.FMMU_BYTE_ORIENTED)
    plan = make_plan([coupler(0), replace(bytes_only, controller=controller)])
    assert plan.mailboxes.devices == ()
    assert len(plan.cycle.frames[0].datagrams) == 2


def test_mailboxes_of_many_devices_take_several_columns() -> None:
    plan = make_plan([servo(position) for position in range(70)])
    bits = [column.number.bit_length for column in plan.mailboxes.columns]
    starts = [column.number.bit_offset - 8 * 70 * 13 for column in plan.mailboxes.columns]
    assert (bits, starts) == ([32, 32, 6], [0, 32, 64])


def test_places_of_objects() -> None:
    layout = make_plan(demo()).layout
    assert layout.output(1, 0x7010, 1) == Number(1, 1, NumberKind.UNSIGNED)
    assert layout.output(2, 0x6040, 0) == Number(8, 16, NumberKind.UNSIGNED)
    assert layout.output(3, 0x607A, 0) == Number((14 + 7) * 8, 32, NumberKind.SIGNED)
    assert layout.input(4, 0x6064, 0) == Number((26 + 7) * 8, 32, NumberKind.SIGNED)
    assert layout.output(2, 0x6064, 0) is None
    assert layout.sync_unit(0) == -1
    assert layout.sync_unit(5) == 0


def test_the_plan_of_one_device() -> None:
    plan = make_plan(demo())
    drive = plan.devices[3]
    assert drive.station_address == 0x1004
    assert [(m.index, m.start, m.length, m.control) for m in drive.layout.sync_managers] == [
        (2, 0x1100, 13, 0x64),
        (3, 0x1400, 13, 0x20),
    ]
    assert [
        (f.direction, f.logical_start, f.physical_start, f.length) for f in drive.layout.fmmus
    ] == [
        (Direction.OUTPUT, 0x1_0000 + 14, 0x1100, 13),
        (Direction.INPUT, 0x1_0000 + 41 + 13, 0x1400, 13),
    ]
    assert drive.downloads == ()
    assert drive.watchdog_count == 1000
    assert plan.devices[0].watchdog_ns == 0  # nothing to take down


def test_equal_plans_are_equal() -> None:
    assert make_plan(demo()) == make_plan(demo())
    assert make_plan(demo()) != make_plan(demo(), options=PlanOptions(period=2e-3))


def test_a_plan_prints_its_contents() -> None:
    text = str(make_plan(demo()))
    for part in (
        "6 devices, period 1 ms",
        "device   2  Servo  station 0x1003  13 out, 13 in, watchdog 100 ms",
        "SyncManager 2 out  0x1100 + 13  control 0x64, triggers the watchdog",
        "FMMU 0 out  logical 0x00010001 + 13  → 0x1100",
        "0x607A:00 (32 bits) Target position",
        "LRW  80 bytes at 30  expected counter 13",
    ):
        assert part in text


def test_a_device_without_lrw_gets_lrd_and_lwr() -> None:
    cycle = make_plan([coupler(0), servo(1), servo(2, lrw=False)]).cycle
    kinds = [
        (EcatCommand(d.command).name, d.length, d.expected_counter, d.sync_unit)
        for d in cycle.frames[0].datagrams
    ]
    assert kinds == [
        ("BRD", 2, 3, -1),
        ("LRW", 26, 3, 0),
        ("LWR", 13, 1, 1),
        ("LRD", 13, 1, 1),
        ("LRD", 1, 2, -1),  # mailboxes
    ]
    assert cycle.sync_units[1].devices == (2,)


def test_the_sii_alone_can_deny_lrw() -> None:
    denied = replace(servo(2), sii_denies_lrw=True)
    cycle = make_plan([coupler(0), servo(1), denied]).cycle
    kinds = [(EcatCommand(d.command).name, d.sync_unit) for d in cycle.frames[0].datagrams]
    assert kinds[1:4] == [("LRW", 0), ("LWR", 1), ("LRD", 1)]


def test_outputs_alone_need_no_lrw() -> None:
    cycle = make_plan([lamps(0), lamps(1)]).cycle
    datagram = cycle.frames[0].datagrams[1]
    assert (datagram.command, datagram.expected_counter) == (EcatCommand.LWR, 2)


@pytest.mark.parametrize("required", [True, False])
def test_devices_in_no_request_are_required_if_any_other_is(required: bool) -> None:
    requests = [
        Asking({2: DeviceRequest(required=required)}),
        Asking({3: DeviceRequest(required=False)}),
    ]
    units = make_plan(demo(), requests).cycle.sync_units
    optional = {position: unit.optional for unit in units for position in unit.devices}
    assert optional[3]
    assert all(optional[position] is not required for position in optional if position != 3)


def test_an_optional_device_is_a_unit_of_its_own() -> None:
    cycle = make_plan(demo(), options=PlanOptions(optional=[3])).cycle
    assert [(unit.devices, unit.optional) for unit in cycle.sync_units] == [
        ((1, 2, 4, 5), False),
        ((3,), True),
    ]
    counters = [d.expected_counter for d in cycle.frames[0].datagrams[1:]]
    assert counters == [2 * 4 + 2, 3, 3]


class Slow:
    """A request that only says how often."""

    def __init__(self, divider: int, *positions: int, required: bool = True) -> None:
        self.request = DeviceRequest(divider=divider, required=required)
        self.positions = positions

    def pdos(self, period_ns: int) -> dict[int, DeviceRequest]:
        return dict.fromkeys(self.positions, self.request)

    def tables(self, layout: object) -> RequestTables:
        return RequestTables()

    def bind(self, views: object) -> None:
        raise NotImplementedError


def test_devices_with_a_divider_have_their_own_frames() -> None:
    cycle = make_plan(demo(), [Slow(4, 2, 3)]).cycle
    assert [(u.devices, u.divider) for u in cycle.sync_units] == [((1, 4, 5), 1), ((2, 3), 4)]
    assert [(f.divider, f.phase) for f in cycle.frames] == [(1, 0), (4, 0)]
    assert "every 4 cycles" in str(make_plan(demo(), [Slow(4, 2, 3)]))


def test_units_of_a_divider_take_turns() -> None:
    """Three that are optional, so units of their own: never two of them in one cycle."""
    cycle = make_plan(demo(), [Slow(4, 2, 3, 4, required=False)]).cycle
    assert [(f.divider, f.phase) for f in cycle.frames] == [(1, 0), (4, 0), (4, 1), (4, 2)]


def test_requests_for_one_device_use_the_greatest_common_divisor() -> None:
    units = make_plan(demo(), [Slow(4, 2), Slow(6, 2, 3)]).cycle.sync_units
    assert [(u.devices, u.divider) for u in units] == [((1, 4, 5), 1), ((2,), 2), ((3,), 6)]


def test_one_request_that_requires_a_device_is_enough() -> None:
    requests = [Slow(1, 2, 3, required=False), Slow(1, 3)]
    units = make_plan(demo(), requests).cycle.sync_units
    assert [(u.devices, u.optional) for u in units] == [((1, 3, 4, 5), False), ((2,), True)]


def test_a_divider_too_long_for_the_watchdog_is_refused() -> None:
    with pytest.raises(ValueError, match="every 50 cycles"):
        make_plan(demo(), [Slow(50, 2)])


@pytest.mark.parametrize("count", [40, 56, 57, 120, 200])
def test_many_devices_use_several_frames_and_are_never_split(count: int) -> None:
    plan = make_plan([servo(position) for position in range(count)])
    cycle = plan.cycle
    assert all(len(frame.template) <= 1514 for frame in cycle.frames)
    found = [d for frame in cycle.frames for d in frame.datagrams if d.sync_unit >= 0]
    assert sum(d.expected_counter for d in found) == 3 * count
    assert sum(unit.devices == () for unit in cycle.sync_units) == 0
    assert sorted(p for unit in cycle.sync_units for p in unit.devices) == list(range(count))
    outputs = sorted((copy.image_offset, copy.size) for d in found for copy in d.outputs)
    assert outputs[0][0] == 0
    for (start, size), (following, _) in itertools.pairwise(outputs):
        assert start + size == following
    logical = sorted(
        (fmmu.logical_start, fmmu.length) for each in plan.devices for fmmu in each.layout.fmmus
    )
    for (start, length), (following, _) in itertools.pairwise(logical):
        assert start + length <= following


@pytest.mark.parametrize(("exact", "limit"), [(False, 1472), (True, 1456)])
def test_a_device_that_exceeds_a_datagram_is_refused_with_both_numbers(
    exact: bool, limit: int
) -> None:
    fits = block(0, outputs=700, inputs=limit - 700)
    plan = make_plan([fits], options=PlanOptions(exact_matching=exact))
    assert len(plan.cycle.frames) == 1
    with pytest.raises(MappingError) as caught:
        make_plan(
            [block(0, outputs=701, inputs=limit - 700)], options=PlanOptions(exact_matching=exact)
        )
    text = str(caught.value)
    assert f"701 bytes of outputs and {limit - 700} bytes of inputs" in text
    assert f"{limit + 1} bytes; the process data of a device" in text
    assert f"one datagram of {limit} bytes" in text
    assert "1 bytes less" in text


def test_more_frames_in_a_cycle_than_indices_are_refused_by_the_plan() -> None:
    devices = [block(k, outputs=1000, inputs=0) for k in range(33)]
    assert len(make_plan(devices[:32], options=PlanOptions(period=5e-3)).cycle.frames) == 32
    with pytest.raises(ConfigurationError) as caught:
        make_plan(devices, options=PlanOptions(period=5e-3))
    assert "too many frames in one cycle: 33; the limit is 32" in str(caught.value)
    assert "exact_matching=True" in str(caught.value)
    exact = make_plan(devices, options=PlanOptions(period=5e-3, exact_matching=True))
    assert len(exact.cycle.frames) == 33


def test_cyclic_frames_that_exceed_the_period_are_refused() -> None:
    devices = [block(k, outputs=1000, inputs=0) for k in range(12)]
    with pytest.raises(ConfigurationError) as caught:
        make_plan(devices, options=PlanOptions(period=1e-3))
    assert str(caught.value).startswith(
        "the cyclic frames take 1011.04 us at 100 Mbit/s; the period is 1000 us"
    )
    assert "divider=" in str(caught.value)
    turns = make_plan(devices, [Slow(2, *range(12))], PlanOptions(period=1e-3)).cycle
    assert turns.wire_ns < 600_000  # of the busiest cycle, not of all frames


def test_frames_that_return_too_late_are_refused() -> None:
    devices = [block(k, outputs=1000, inputs=0) for k in range(10)]
    with pytest.raises(ConfigurationError) as caught:
        make_plan(devices, options=PlanOptions(period=1e-3))
    assert str(caught.value).startswith(
        "period=0.001 s is too short: the cyclic frames take 842.72 us at 100 Mbit/s, and must be "
        "back 800 us after the cycle start"
    )
    make_plan(devices, options=PlanOptions(period=1e-3, execution="inline"))


def test_acyclic_frames_get_the_remaining_wire_time() -> None:
    plan = make_plan(
        [block(k, outputs=1000, inputs=0) for k in range(2)], options=PlanOptions(period=1e-3)
    )
    assert plan.cycle.acyclic_ns == 1_000_000 - plan.cycle.wire_ns - 100_000
    left = f"{plan.cycle.acyclic_ns / 1e3:g}"
    assert f"of 1000 us for cyclic frames, up to {left} us for acyclic frames, 10%" in str(plan)
    full = make_plan(
        [block(k, outputs=1000, inputs=0) for k in range(11)],
        options=PlanOptions(period=1e-3, collect_share=1.0),
    )
    assert full.cycle.acyclic_ns == 0
    assert "one frame for acyclic frames" in str(full)


def test_a_request_for_a_missing_device() -> None:
    with pytest.raises(ConfigurationError, match="device 9, but the segment has 6"):
        make_plan(demo(), [asks(9)])


@pytest.mark.parametrize(
    ("period", "watchdog", "match"),
    [
        (0.0, 0.1, "period=0.0 s: must be 1e-06 to 1000 s"),
        (-1e-3, 0.1, "period=-0.001 s"),
        (math.nan, 0.1, "period=nan s"),
        (math.inf, 0.1, "period=inf s"),
        (1e-7, 0.1, "period=1e-07 s"),
        (1e-3, 1e-3, "expire"),
        (1e-3, 10.0, "watchdog"),
        (1e-3, -0.1, "watchdog"),
    ],
)
def test_impossible_times(period: float, watchdog: float, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        make_plan(demo(), options=PlanOptions(period=period, watchdog=watchdog))


def test_the_watchdog_can_be_off() -> None:
    plan = make_plan(demo(), options=PlanOptions(watchdog=0))
    assert plan.devices[2].watchdog_count == 0
    assert plan.devices[2].layout.sync_managers[0].control == 0x24
    assert "13 out, 13 in, watchdog off" in str(plan)


def test_a_notebook_shows_the_text() -> None:
    html = make_plan(demo())._repr_html_()
    assert html.startswith("<pre>Plan: ")
    assert html.count("\n") == str(make_plan(demo())).count("\n")
