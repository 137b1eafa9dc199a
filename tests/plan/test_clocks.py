"""Choice of clocks, SYNC times, and the time of the frames."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest

from catenary.errors import ConfigurationError, MappingError
from catenary.model.device import DeviceDescription, Entry, OpMode, Pdo, SyncManager
from catenary.model.esi_settings import ModeAssignment
from catenary.plan.clocks import SyncPlan, make_sync, start_time_ns
from catenary.plan.cycle import DatagramKind
from catenary.plan.options import PlanOptions
from catenary.plan.planner import Plan, make_plan
from catenary.plan.request import DeviceRequest, DistributedClock, ObjectReference
from catenary.plan.start_up import renewed
from catenary.wire.datagram import EcatCommand, decode_datagram
from catenary.wire.features import Feature
from catenary.wire.sii_categories import SyncManagerUse
from tests.plan.devices import Asking, coupler, lamps, servo
from tests.plan.devices import device as device_of

PERIOD_NS = 1_000_000
LONG = Feature.DISTRIBUTED_CLOCKS | Feature.DISTRIBUTED_CLOCKS_64_BIT


def clocked(device: DeviceDescription, *modes: OpMode) -> DeviceDescription:
    controller = replace(device.controller, features=device.controller.features | LONG)
    return replace(device, controller=controller, system_time=True, op_modes=modes)


def cell() -> list[DeviceDescription]:
    """A coupler with a clock, lamps without, two servos with."""
    return [clocked(coupler(0)), lamps(1), clocked(servo(2)), clocked(servo(3))]


def asking(*positions: int, clock: DistributedClock | None = None) -> Asking:
    return Asking(
        {position: DeviceRequest(clock=clock or DistributedClock()) for position in positions}
    )


def planned(devices: list[DeviceDescription], *positions: int, **options: object) -> Plan:
    return make_plan(devices, [asking(*positions)], PlanOptions(**options))  # type: ignore[arg-type]


def clock_datagrams(plan: Plan) -> list[tuple[EcatCommand, int, int, int]]:
    """Command, station, register and expected counter, in the order of the frame."""
    frame = plan.cycle.frames[0]
    found = []
    for each in frame.datagrams:
        if each.kind is DatagramKind.CLOCK:
            datagram, _ = decode_datagram(frame.template, each.offset)
            found.append((datagram.command, datagram.adp, datagram.ado, each.expected_counter))
    return found


def test_no_clock_request() -> None:
    plan = make_plan(cell())
    assert plan.cycle.clock is None
    assert clock_datagrams(plan) == []
    assert all(device.sync is None for device in plan.devices)


def test_the_first_clock_is_the_reference() -> None:
    plan = planned(cell(), 2, 3)
    assert plan.cycle.clock is not None
    assert plan.cycle.clock.reference == 0
    assert plan.cycle.clock.followers == (2, 3)
    assert clock_datagrams(plan) == [
        (EcatCommand.FRMW, 0x1001, 0x0910, 3),
        (EcatCommand.FPRD, 0x1003, 0x092C, 1),
    ]


def test_a_chosen_reference() -> None:
    plan = planned(cell(), 2, 3, reference=2)
    assert plan.cycle.clock is not None
    assert (plan.cycle.clock.reference, plan.cycle.clock.followers) == (2, (3,))


def test_the_reference_follows_the_main_device() -> None:
    plan = planned(cell(), 2, clock="main")
    assert clock_datagrams(plan)[:2] == [
        (EcatCommand.FPWR, 0x1001, 0x0910, 1),
        (EcatCommand.FRMW, 0x1001, 0x0910, 3),
    ]


def test_a_reference_alone_has_no_followers() -> None:
    plan = planned([clocked(servo(0))], 0)
    assert clock_datagrams(plan) == [(EcatCommand.FRMW, 0x1001, 0x0910, 1)]


def test_frames_pass_all_devices_before_sync0() -> None:
    plan = planned(cell(), 2, 3)
    clock = plan.cycle.clock
    assert clock is not None
    size = len(plan.cycle.frames[0].template)
    assert clock.wire_ns == (size + 24) * 80 + 4 * 1000  # 100 Mbit/s; a microsecond a device
    assert clock.allowance_ns == 0.2 * PERIOD_NS
    assert clock.phase_ns == PERIOD_NS - clock.wire_ns - clock.allowance_ns
    inline = planned(cell(), 2, 3, execution="inline").cycle.clock
    assert inline is not None
    assert inline.allowance_ns == 0.5 * PERIOD_NS
    given = planned(cell(), 2, 3, margin=10e-6).cycle.clock
    assert given is not None
    assert given.allowance_ns == 10_000


def test_frames_that_do_not_fit() -> None:
    with pytest.raises(ConfigurationError, match="do not fit into a period of 1000 us"):
        planned(cell(), 2, margin=0.99e-3)


def test_the_controller_slows_down_to_the_same_time_at_any_period() -> None:
    for period, bandwidth in ((1e-3, 0.01), (250e-6, 0.0025), (20e-3, 1 / 16)):
        clock = planned(cell(), 2, period=period).cycle.clock
        assert clock is not None
        assert clock.bandwidth == pytest.approx(bandwidth)
        assert clock.rate_limit_ns == pytest.approx(period * 1e6)


@pytest.mark.parametrize(
    ("positions", "options", "message"),
    [
        ((1,), {}, r"device 1 \(Lamps\): dc= was requested, but it has no"),
        ((2,), {"reference": 1}, "given as the reference clock, but it has no"),
        ((2,), {"reference": 3}, r"device 2 \(Servo\) precedes device 3 \(Servo\)"),
        ((2,), {"reference": 4}, "there is no device 4; the segment has 4 devices"),
    ],
)
def test_impossible_clock_requests(
    positions: tuple[int, ...], options: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        planned(cell(), *positions, **options)


def test_a_clock_that_only_latches() -> None:
    devices = cell()
    devices[2] = replace(devices[2], system_time=False)
    with pytest.raises(ConfigurationError, match="only latches receive times"):
        planned(devices, 2)


def test_two_requests_for_one_clock() -> None:
    one, other = asking(2), asking(2, clock=DistributedClock(shift=1e-4))
    with pytest.raises(ConfigurationError, match="device 2: two requests"):
        make_plan(cell(), [one, other])
    assert make_plan(cell(), [one, one, Asking({2: DeviceRequest()})]).devices[2].sync is not None


def sync(asked: DistributedClock, *modes: OpMode) -> SyncPlan:
    return make_sync(clocked(servo(0), *modes), asked, PERIOD_NS)


def test_sync_without_an_op_mode_is_sync0() -> None:
    assert sync(DistributedClock()) == SyncPlan(0x0300, PERIOD_NS, 0, 0)


def test_sync_as_the_sii_says() -> None:
    free = OpMode(shift_ns=1_882_234_944)  # of a real image: pollen_Orbita2d.bin
    mode = OpMode(shift_ns=-20_000, sync1_shift_ns=5_000, assign_activate=0x0700)
    assert sync(DistributedClock(), free, mode) == SyncPlan(0x0700, PERIOD_NS, 5_000, -20_000)


def test_sync_of_parts_and_multiples_of_the_period() -> None:
    part = OpMode(sync0_factor=-4, sync1_factor=4, assign_activate=0x0700)
    assert sync(DistributedClock(), part) == SyncPlan(0x0700, 250_000, 750_000, 0)
    assert sync(DistributedClock(), part).span_ns == PERIOD_NS
    double = OpMode(sync0_factor=2, assign_activate=0x0300)
    assert sync(DistributedClock(), double).cycle_ns == 2 * PERIOD_NS


@pytest.mark.parametrize(
    ("mode", "sync0_ns", "sync1_ns"),
    [
        # Beckhoff's EL3702 with two-fold and four-fold oversampling; ecmc's notes on DC clocks
        # compute 250 us and 750 us for the latter.
        (OpMode("DcSync2", "", 0x0730, sync0_factor=-2, sync1_factor=-1), 500_000, 500_000),
        (OpMode("DcSync4", "", 0x0730, sync0_factor=-4, sync1_factor=-1), 250_000, 750_000),
        # EL7201 and EL7221-9014: SYNC1 in every period, 1 us after SYNC0
        (
            OpMode("DC", "", 0x0700, sync0_factor=1, sync1_factor=-1, sync1_shift_ns=1_000),
            PERIOD_NS,
            1_000,
        ),
        # SYNC0 in every second period: SYNC1 cannot come more often
        (OpMode("DC", "", 0x0700, sync0_factor=2, sync1_factor=-1), 2 * PERIOD_NS, 0),
    ],
)
def test_a_negative_factor_of_sync1_counts_periods(
    mode: OpMode, sync0_ns: int, sync1_ns: int
) -> None:
    plan = sync(DistributedClock(), mode)
    assert (plan.cycle_ns, plan.sync1_ns) == (sync0_ns, sync1_ns)
    assert plan.span_ns == max(PERIOD_NS, sync0_ns)


FREE = OpMode("SM_Sync or Async")
SYNC0 = OpMode("DC", "DC-Synchron", 0x0300, sync0_factor=1)
OVERSAMPLED = OpMode("DcSync4", "", 0x0730, sync0_factor=-4, sync1_factor=-1)
# The only modes of a device in robert-burger/libethercat#21, "DcSync500us" and so on
SYNC1_ALONE = OpMode("DcSync250us", "", 0x0500, sync0_factor=1, shift_ns=250_000)


@pytest.mark.parametrize("name", ["DcSync4", "dcsync4"])
def test_an_op_mode_is_chosen_by_its_name(name: str) -> None:
    plan = sync(DistributedClock(op_mode=name), FREE, SYNC0, OVERSAMPLED)
    assert plan == SyncPlan(0x0730, 250_000, 750_000, 0, "DcSync4")


def test_without_a_name_the_first_op_mode_with_sync0() -> None:
    assert sync(DistributedClock(), FREE, SYNC1_ALONE, SYNC0).op_mode == "DC"
    assert sync(DistributedClock(), FREE, SYNC1_ALONE).op_mode == "DcSync250us"


def test_an_unknown_op_mode_lists_the_known_ones() -> None:
    with pytest.raises(ConfigurationError, match=r"no OpMode 'x'; it has 'SM_Sync or Async', 'DC'"):
        sync(DistributedClock(op_mode="x"), FREE, SYNC0)
    with pytest.raises(ConfigurationError, match=r"no OpMode 'x'; it has none") as refused:
        sync(DistributedClock(op_mode="x"))
    assert "assign_activate=" in refused.value.hint


def test_sync1_alone() -> None:
    expected = SyncPlan(0x0500, PERIOD_NS, 0, 250_000, "DcSync250us")
    plan = sync(DistributedClock(op_mode="DcSync250us"), FREE, SYNC0, SYNC1_ALONE)
    assert plan == expected
    assert plan.objects[0] == (0x1C32, 1, b"\x03\x00")  # synchronised with SYNC1
    assert sync(DistributedClock(assign_activate=0x0500)) == SyncPlan(0x0500, PERIOD_NS, 0, 0)


def test_sync_as_requested() -> None:
    mode = OpMode(shift_ns=-20_000, assign_activate=0x0300)
    assert sync(DistributedClock(shift=1e-4, sync1=2e-5), mode) == SyncPlan(
        0x0700, PERIOD_NS, 20_000, 100_000
    )
    assert sync(DistributedClock(assign_activate=0x0320), mode).assign_activate == 0x0320
    assert sync(DistributedClock(sync0=5e-4), mode).cycle_ns == 500_000
    plan = sync(DistributedClock(op_mode="DcSync4", sync0=5e-4), OVERSAMPLED)
    assert (plan.cycle_ns, plan.sync1_ns) == (500_000, 500_000)


@pytest.mark.parametrize(
    ("asked", "mode", "message"),
    [
        (
            DistributedClock(assign_activate=0x0100),
            OpMode(),
            r"device 0 \(Servo\): AssignActivate 0x0100 does not start a SYNC signal",
        ),
        (DistributedClock(shift=1e-3), OpMode(), r"device 0 \(Servo\): a shift of 1000 us"),
        (
            DistributedClock(),
            OpMode("DC", sync0_ns=300_000, assign_activate=0x0300),
            r"its EEPROM \(OpMode 'DC'\): SYNC0 every 300 us",
        ),
        (DistributedClock(sync0=3e-4), SYNC0, r"device 0 \(Servo\): SYNC0 every 300 us"),
        (
            DistributedClock(op_mode="SM_Sync or Async"),
            FREE,
            r"its EEPROM \(OpMode 'SM_Sync or Async'\): AssignActivate 0x0000",
        ),
    ],
)
def test_impossible_sync_settings(asked: DistributedClock, mode: OpMode, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        sync(asked, mode)


def test_an_implausible_shift_is_the_eeproms_and_can_be_overridden() -> None:
    """2000200000 ns: what EasyConfigurator writes for every EasyCAT, meant in another unit
    (Seobuk/Easycat_config, HUslave.xml: "10nS unit"; pollen_Orbita2d.xml)."""
    easycat = OpMode("DC_Sync", "DC_Sync", 0x0300, sync0_factor=1, shift_ns=2_000_200_000)
    with pytest.raises(
        ConfigurationError,
        match=r"its EEPROM \(OpMode 'DC_Sync'\): a shift of 2 s is not less than the cycle",
    ) as refused:
        sync(DistributedClock(), FREE, easycat)
    assert refused.value.hint.endswith("override the EEPROM: cat.DistributedClock(shift=0.0)")
    assert sync(DistributedClock(shift=0.0), FREE, easycat).shift_ns == 0


def test_the_image_of_an_easycat_names_each_correction() -> None:
    """As EasyConfigurator leaves it: its OpMode lacks AssignActivate, and the shift is one too."""
    mode = OpMode("DC_Sync", "DC_Sync", shift_ns=1_882_234_944)  # pollen_Orbita2d.bin
    asked = DistributedClock(op_mode="DC_Sync")
    with pytest.raises(ConfigurationError, match="does not start a SYNC signal") as refused:
        sync(asked, FREE, mode)
    assert "DistributedClock(op_mode='DC_Sync', assign_activate=0x0300)" in refused.value.hint
    asked = DistributedClock(op_mode="DC_Sync", assign_activate=0x0300)
    with pytest.raises(ConfigurationError, match=r"a shift of 1\.882 s"):
        sync(asked, FREE, mode)
    assert sync(DistributedClock(), FREE, mode) == SyncPlan(0x0300, PERIOD_NS, 0, 0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("sync0", 0.0), ("sync0", -1e-3), ("sync0", 1e-12), ("sync0", 5.0)),
        *(("sync1", -1e-6), ("sync1", 5.0), ("shift", float("nan"))),
        *(("assign_activate", -1), ("assign_activate", 0x10000)),
    ],
)
def test_impossible_values_are_refused_at_once(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        DistributedClock(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("sync0_factor", [-32768, -3, -1, 0, 1, 32767])
@pytest.mark.parametrize("sync1_factor", [-32768, -1, 0, 1, 32767])
@pytest.mark.parametrize("period_ns", [10_000, PERIOD_NS, 1_000_000_000])
def test_any_factors_make_a_plan_or_name_the_device(
    sync0_factor: int, sync1_factor: int, period_ns: int
) -> None:
    mode = OpMode("DC", "", 0x0700, sync0_factor=sync0_factor, sync1_factor=sync1_factor)
    plan, refusal = None, ""
    try:
        plan = make_sync(clocked(servo(0), mode), DistributedClock(), period_ns)
    except ConfigurationError as error:
        refusal = error.message
    if plan is None:
        assert "device 0 (Servo): its EEPROM (OpMode 'DC')" in refusal
    else:
        assert 0 < plan.cycle_ns < 1 << 32
        assert 0 <= plan.sync1_ns < 1 << 32


def test_sync_objects_may_be_refused() -> None:
    """0x1C32 and 0x1C33: type and cycle time; who has no mailbox is told nothing."""
    plan = planned([clocked(coupler(0)), clocked(servo(1))], 0, 1)
    told = [(d.index, d.subindex, d.data) for d in plan.devices[1].downloads if d.optional]
    cycle = struct.pack("<I", PERIOD_NS)
    assert told == [
        (index, subindex, data)
        for index in (0x1C32, 0x1C33)
        for subindex, data in ((1, b"\x02\x00"), (2, cycle))
    ]
    assert plan.devices[0].downloads == ()


def test_all_start_at_a_common_sync0_time() -> None:
    every_third = SyncPlan(0x0700, PERIOD_NS, 2 * PERIOD_NS, 0)
    every = SyncPlan(0x0300, PERIOD_NS, 0, 0)
    for now in (0, 1, 123_456_789, 10**18 + 1):
        start = start_time_ns(now, [every, every_third])
        assert start % (3 * PERIOD_NS) == 0
        assert 100_000_000 <= start - now < 103_000_000


def test_it_prints() -> None:
    text = str(planned(cell(), 2, 3))
    assert "reference clock: device 0 (Coupler); the cycle start follows it" in text
    assert "SYNC0 every 1000 us, +0 us after the common SYNC0 time, AssignActivate 0x0300" in text
    assert "us before SYNC0: margin 200 us" in text
    assert "time constant 100 ms, at most 1000 ppm of the period" in text


def test_an_op_mode_is_a_name() -> None:
    with pytest.raises(TypeError, match="op_mode=0: must be the name of an OpMode"):
        DistributedClock(op_mode=0)  # type: ignore[arg-type]


# -- modes of an ESI -----------------------------------------------------------------------------


def test_a_mode_is_found_by_its_description() -> None:
    mode = OpMode("DC", "DC-Synchron", 0x0300, source="drive.xml:64")
    plan = make_sync(clocked(servo(0), mode), DistributedClock(op_mode="dc-synchron"), PERIOD_NS)
    assert (plan.op_mode, plan.source) == ("DC", "ESI drive.xml:64")


def test_the_cycle_of_sync1_may_be_a_time() -> None:
    mode = OpMode("DC", "", 0x0700, sync0_ns=250_000, sync1_ns=1_000_000)
    plan = make_sync(clocked(servo(0), mode), DistributedClock(), PERIOD_NS)
    assert (plan.cycle_ns, plan.sync1_ns, plan.span_ns) == (250_000, 750_000, 1_000_000)


def test_the_factor_of_a_shift_adds_sync0_cycles() -> None:
    mode = OpMode("DC", "", 0x0300, sync0_factor=2, shift_ns=-10_000, shift_factor=1)
    plan = make_sync(clocked(servo(0), mode), DistributedClock(), PERIOD_NS)
    assert (plan.cycle_ns, plan.shift_ns) == (2_000_000, 1_990_000)


def test_a_shift_of_inputs_counts_from_the_start_of_the_frames() -> None:
    mode = OpMode("DC", "", 0x0300, shift_ns=-10_000, shift_of_inputs=True)
    device = clocked(servo(0), mode)
    plan = make_sync(device, DistributedClock(), PERIOD_NS, lead_ns=200_000)
    assert plan.shift_ns == 790_000  # 10 us before the next cycle start, 200 us before SYNC0
    chosen = make_sync(device, DistributedClock(shift=1e-6), PERIOD_NS, lead_ns=200_000)
    assert chosen.shift_ns == 1000


def test_an_error_names_the_file_of_the_mode() -> None:
    mode = OpMode("SM", "", 0, source="drive.xml:60")
    with pytest.raises(ConfigurationError, match=r"drive\.xml:60 \(OpMode 'SM'\): AssignActivate"):
        make_sync(clocked(servo(0), mode), DistributedClock(op_mode="sm"), PERIOD_NS)


def test_clocks_show_the_settings_and_their_source() -> None:
    mode = OpMode("DC", "DC-Synchron", 0x0300, source="drive.xml:64")
    plan = make_plan([clocked(servo(0), mode)], [asking(0)])
    assert str(plan.clocks).splitlines()[0] == (
        "device 0 (Servo): AssignActivate 0x0300, SYNC0 1 ms, shift +0 us, OpMode 'DC', "
        "source: ESI drive.xml:64"
    )
    assert [clock.position for clock in plan.clocks] == [0]
    assert "reference clock: device 0" in str(plan.clocks)
    assert str(make_plan([servo(0)]).clocks) == "no distributed clocks"


@pytest.mark.parametrize("samples", [0, 1_000_000])  # 0 would empty the assignment
def test_absurd_oversampling_is_refused(samples: int) -> None:
    own = ModeAssignment(3, (0x1A00,), (samples,))
    mode = OpMode("DC", "", 0x0300, assignments=(own,), source="el.xml:5")
    with pytest.raises(MappingError, match=rf"el\.xml:5: {samples} samples of PDO 0x1A00"):
        make_plan([clocked(servo(0), mode)], [asking(0, clock=DistributedClock(op_mode="DC"))])


def test_a_mode_with_oversampling_changes_only_the_lengths_without_coe() -> None:
    pdo = Pdo(0x1A00, (Entry(0x6000, 1, 16, "Value", 3),), None)
    inputs = SyncManager(0, SyncManagerUse.INPUTS, 0x1100, 2, 0x20)
    own = ModeAssignment(0, (0x1A00,), (4,))
    mode = OpMode("4x", "", 0x0300, sync0_factor=-4, assignments=(own,), source="el.xml:5")
    device = device_of(0, "Inputs", inputs=(pdo,), sync_managers=(inputs,))
    plan = make_plan([clocked(device, mode)], [asking(0, clock=DistributedClock(op_mode="4x"))])
    [manager] = plan.devices[0].layout.sync_managers
    assert (manager.index, manager.length) == (0, 8)
    [assignment] = plan.devices[0].inputs
    assert [each.index for each in assignment.pdos] == [0x1A00, 0x1A01, 0x1A02, 0x1A03]
    assert plan.devices[0].downloads == ()
    assert "mapping from ESI el.xml:5" in str(plan)


def test_a_returning_device_keeps_the_entries_of_its_samples() -> None:
    own = ModeAssignment(3, (0x1A00,), (2,))
    device = clocked(servo(0), OpMode("2x", "", 0x0300, assignments=(own,)))
    chosen = asking(0, clock=DistributedClock(op_mode="2x"))
    plan = make_plan([device], [chosen]).devices[0]
    assert [each.index for each in plan.mapping] == [0x1C13] * 4
    assert renewed(plan, device).mapping == plan.mapping


def test_an_error_names_the_mode_whose_pdos_lack_an_object() -> None:
    position = ObjectReference(0x6064, 0, 32)
    own = ModeAssignment(3, (0x1A05,))
    status = Pdo(0x1A05, (Entry(0x6041, 0, 16),), None)
    device = servo(0)
    device = replace(device, input_pdos=(*device.input_pdos, status))
    device = clocked(device, OpMode("DC", "", 0x0300, assignments=(own,), source="el.xml:5"))
    request = DeviceRequest(inputs=(position,), clock=DistributedClock(op_mode="dc"))
    with pytest.raises(MappingError, match=r"as specified by ESI el\.xml:5 \(0x1A05\)"):
        make_plan([device], [Asking({0: request})])


def test_a_mode_without_its_name_keeps_the_assignment_of_the_device() -> None:
    own = ModeAssignment(3, (0x1A05,))
    device = servo(0)
    status = Pdo(0x1A05, (Entry(0x6041, 0, 16),), None)
    device = replace(device, input_pdos=(*device.input_pdos, status))
    device = clocked(device, OpMode("DC", "", 0x0300, assignments=(own,)))
    unnamed = make_plan([device], [asking(0)]).devices[0]
    assert unnamed.inputs == device.inputs
    assert not unnamed.mapping
    named = make_plan([device], [asking(0, clock=DistributedClock(op_mode="DC"))]).devices[0]
    assert [pdo.index for each in named.inputs for pdo in each.pdos] == [0x1A05]
