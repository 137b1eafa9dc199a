"""Scan, identity, SDO, plan and configuration over the virtual segment, in virtual time."""

from __future__ import annotations

import pytest

from catenary.bus import MainDevice
from catenary.errors import (
    CatenaryError,
    IdentityError,
    MailboxError,
    MappingError,
    NoDeviceError,
    ResponseTimeout,
    SdoAbort,
    SegmentError,
    StateError,
)
from catenary.plan import DeviceRequest, ObjectReference, make_plan
from catenary.types import INT, UDINT, UINT, USINT, VISIBLE_STRING
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DigitalInputs,
    DigitalOutputs,
    Segment,
    Servo,
    demo_segment,
)
from catenary.wire.al import AlState
from catenary.wire.datagram import EcatCommand
from tests.bus.links import Echo
from tests.plan.devices import Asking, asks


def test_the_device_gets_its_eeprom_before_pre_op() -> None:
    """Some devices refuse PRE-OP without it. A later access of the master returns it."""
    segment = demo_segment()
    with MainDevice(segment) as main:
        for _ in range(2):
            for sub in main.scan():
                assert segment.core.peek(sub.position, 0x0500, 1) == b"\x01"
        main.passive_scan()
        assert segment.core.peek(2, 0x0500, 1) == b"\x01"


def test_a_scan_ends_in_pre_op_with_names_and_profiles() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        subs = main.scan()
        assert len(subs) == 6
        assert [sub.is_drive for sub in subs] == [False, False, True, True, True, False]
        assert [sub.position for sub in subs.drives] == [2, 3, 4]
        assert subs.drives[0].slots == (0,)
        assert [sub.description.parent for sub in subs] == [None, 0, 1, 2, 3, 4]
        assert all(sub.state is AlState.PRE_OP for sub in subs)
        assert [device.state for device in segment] == [AlState.PRE_OP] * 6


def test_every_axis_of_a_drive_is_a_slot() -> None:
    with MainDevice(Segment([Coupler(), Servo(axes=3)])) as main:
        assert main.scan().drives[0].slots == (0, 1, 2)


def test_a_second_scan_keeps_the_handles() -> None:
    with MainDevice(demo_segment()) as main:
        first = list(main.scan())
        second = list(main.scan())
        assert all(a is b for a, b in zip(first, second, strict=True))
        assert second[2].sdo.read(0x1000, 0, type=UDINT) & 0xFFFF == 402


def test_closing_brings_all_devices_to_init() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        main.scan()
        main.configure(main.plan())
        assert [device.state for device in segment] == [AlState.SAFE_OP] * 6
    assert [device.state for device in segment] == [AlState.INIT] * 6


def test_an_exception_in_the_block_closes_the_link() -> None:
    segment = demo_segment()
    main = MainDevice(segment)
    with pytest.raises(KeyboardInterrupt):
        scan_and_interrupt(main)
    assert not main.is_open
    assert [device.state for device in segment] == [AlState.INIT] * 6


def test_sdo_of_every_kind() -> None:
    with MainDevice(Segment([Servo(name="Elbow", serial=7)])) as main:
        [drive] = main.scan()
        assert drive.sdo.read(0x1018, 4, type=UDINT) == 7  # expedited
        assert drive.sdo.read(0x1008, 0, type=VISIBLE_STRING) == "Elbow"  # normal
        blob = drive.sdo.read(0x2100)  # segmented
        assert blob == bytes(k * 7 & 0xFF for k in range(2048))
        drive.sdo.write(0x6065, 0, 5000, type=UDINT)
        assert drive.sdo.read(0x6065, 0, type=UDINT) == 5000
        drive.sdo.write(0x2101, 0, blob[::-1])
        assert drive.sdo.read(0x2101) == blob[::-1]


def test_an_sdo_abort_names_device_and_object() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan().drives[1]
        with pytest.raises(SdoAbort, match=r"device 3 .*0x5FFF:03.*does not exist") as caught:
            drive.sdo.read(0x5FFF, 3)
        assert (caught.value.position, caught.value.code) == (3, 0x0602_0000)
        with pytest.raises(SdoAbort, match="0x6041:00"):
            drive.sdo.write(0x6041, 0, 1, type=UINT)


def test_sdo_of_a_device_without_a_mailbox_is_an_error() -> None:
    with MainDevice(demo_segment()) as main:
        lamps = main.scan()[1]
        with pytest.raises(MailboxError, match=r"device 1 .*has no mailbox"):
            lamps.sdo.read(0x1000)


def test_invalid_arguments_send_nothing() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        before = main.counts.sent
        with pytest.raises(ValueError, match="index has 16 bits"):
            drive.sdo.read(0x12345)
        with pytest.raises(TypeError, match="type"):
            drive.sdo.write(0x6065, 0, 5000)  # type: ignore[call-overload]
        with pytest.raises(ValueError, match="USINT"):
            drive.sdo.write(0x6065, 0, 5000, type=USINT)
        assert main.counts.sent == before


def test_attributes_send_nothing() -> None:
    with MainDevice(demo_segment()) as main:
        subs = main.scan()
        before = main.counts.sent
        for sub in subs:
            _ = (
                sub.name,
                sub.identity,
                sub.state,
                sub.alias,
                sub.slots,
                sub.emergencies,
                repr(sub),
            )
        assert main.counts.sent == before


def test_read_state_reads_the_device() -> None:
    with MainDevice(demo_segment()) as main:
        assert main.scan()[2].read_state().state is AlState.PRE_OP


def test_no_device() -> None:
    with MainDevice(Echo()) as main, pytest.raises(NoDeviceError, match="unprocessed"):
        main.scan()
    with MainDevice(Echo(silent=True)) as main, pytest.raises(NoDeviceError, match="no frame"):
        main.scan()


def test_a_wrong_device_is_refused_with_both_identities() -> None:
    with MainDevice(Segment([Coupler(), DigitalOutputs()])) as main:
        identity = main.scan()[1].identity
        main.scan(expected=[None, identity])
        with pytest.raises(
            IdentityError, match=r"device 1 .*expected .*0x00000007.*found"
        ) as caught:
            main.scan(expected=[None, (7, 8)])
        assert caught.value.found == identity
        with pytest.raises(SegmentError, match="3 devices expected, 2 found"):
            main.scan(expected=[None, None, None])


def test_a_device_that_refuses_a_state() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        main.scan()
        segment[3].refuse_state(AlState.SAFE_OP, 0x001E)
        with pytest.raises(StateError, match=r"device 3 .*SAFE-OP.*0x001E"):
            main.configure(main.plan())


def test_a_device_that_never_reaches_a_state() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        main.scan()
        segment[4].delay_state(AlState.SAFE_OP, None)
        start = main.link.now()
        with pytest.raises(StateError, match=r"device 4 .*did not reach SAFE-OP within 10 s"):
            main.configure(main.plan())
        assert main.link.now() - start < 15e9


def test_a_silent_mailbox_has_a_deadline() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        drive = main.scan()[2]
        segment[2].mailbox_silent = True
        start = main.link.now()
        with pytest.raises(CatenaryError, match="device 2"):
            drive.sdo.read(0x1000)
        assert main.link.now() - start < 5e9


def test_emergencies_are_kept_for_every_reader() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        drive = main.scan()[2]
        segment[2].send_emergency(0x7500, b"\x01")
        drive.sdo.read(0x1000)
        assert [emergency.error_code for emergency in drive.emergencies] == [0x7500]


def test_a_lost_segment_is_an_error() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        drive = main.scan()[2]
        segment.unplug()
        with pytest.raises(ResponseTimeout, match="device 2"):
            drive.sdo.read(0x1000)


def test_the_default_mapping_is_read_from_the_dictionary_and_kept() -> None:
    with MainDevice(demo_segment()) as main:
        subs = main.scan()
        plan = main.plan()
        assert subs[2].description.mapping_source == "CoE"
        assert (plan.cycle.output_size, plan.cycle.input_size) == (41, 39 + 1)  # mailboxes
        assert all(device.downloads == () for device in plan.devices)
        main.configure(plan)


def test_a_request_beyond_the_default_is_mapped_and_verified() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        subs = main.scan()
        asked = asks(3, inputs=((0x60F4, 0, 32), (0x6064, 0, 32)), outputs=((0x60B1, 0, 32),))
        plan = main.plan(asked)
        assert plan.devices[3].mapping_changed
        main.configure(plan)
        assert segment[3].state == AlState.SAFE_OP
        count = subs[3].sdo.read(0x1C13, 0, type=USINT)
        pdos = [subs[3].sdo.read(0x1C13, k + 1, type=UINT) for k in range(count)]
        assert pdos == [pdo.index for a in plan.devices[3].inputs for pdo in a.pdos]


def test_a_changed_mapping_is_the_default_of_the_next_plan() -> None:
    with MainDevice(demo_segment()) as main:
        main.scan()
        asked = asks(3, inputs=((0x60F4, 0, 32),))
        main.configure(main.plan(asked))
        main.leave()
        again = main.plan(asked)
        assert not again.devices[3].mapping_changed
        main.configure(again)


@pytest.mark.parametrize(
    ("asked", "match"),
    [
        (asks(3, inputs=((0x5FFF, 0, 32),)), r"(?s)device 3 .*0x5FFF:00.*does not exist"),
        (asks(3, inputs=((0x605A, 0, 16),)), r"(?s)device 3 .*0x605A:00.*cannot be mapped"),
        (asks(3, outputs=((0x6041, 0, 16),)), r"(?s)device 3 .*0x6041:00.*cannot be mapped"),
        (asks(1, outputs=((0x7050, 1, 1),)), r"device 1 .*0x7050:01"),
        (asks(0, inputs=((0x6000, 1, 1),)), r"device 0 .*0x6000:01"),
    ],
)
def test_an_impossible_request_is_refused_before_anything_is_written(
    asked: Asking, match: str
) -> None:
    with MainDevice(demo_segment()) as main:
        main.scan()
        with pytest.raises(MappingError, match=match):
            main.plan(asked)


def test_start_up_values_are_written_before_safe_op() -> None:
    segment = demo_segment()
    start_up = ((0x6065, 0, UDINT.encode(1234)), (0x605A, 0, INT.encode(6)))
    with MainDevice(segment) as main:
        drive = main.scan()[2]
        main.configure(main.plan(Asking({2: DeviceRequest(start_up=start_up)})))
        assert drive.sdo.read(0x6065, 0, type=UDINT) == 1234
        assert drive.sdo.read(0x605A, 0, type=INT) == 6


def test_a_plan_of_another_segment_is_refused() -> None:
    with MainDevice(demo_segment()) as main:
        main.scan()
        plan = main.plan()
    with MainDevice(Segment([Coupler()])) as main:
        main.scan()
        with pytest.raises(SegmentError, match="6 devices"):
            main.configure(plan)


def test_leaving_brings_devices_from_safe_op_to_pre_op() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        main.scan()
        main.configure(main.plan())
        main.leave()
        assert [device.state for device in segment] == [AlState.PRE_OP] * 6


def test_devices_with_all_kinds_of_controllers_reach_safe_op() -> None:
    devices = [Coupler(), DigitalInputs(), AnalogInputs(), Servo(lrw=False), DigitalOutputs()]
    segment = Segment(devices)
    with MainDevice(segment) as main:
        subs = main.scan()
        plan = make_plan([sub.description for sub in subs])
        main.configure(plan)
        assert [device.state for device in segment] == [AlState.SAFE_OP] * 5
        assert len(plan.cycle.sync_units) == 2


FEATURES, NO_LRW = 0x0008, 0x0200


@pytest.mark.parametrize("by_sii", [True, False])
def test_one_indication_is_enough_to_avoid_lrw(by_sii: bool) -> None:
    """The indication is in the SII's general category, or in the features of the controller."""
    segment = Segment([Servo(lrw=not by_sii), Servo()])
    features = int.from_bytes(segment.core.peek(0, FEATURES, 2), "little")
    shown = features & ~NO_LRW if by_sii else features | NO_LRW
    segment.core.poke(0, FEATURES, shown.to_bytes(2, "little"))
    with MainDevice(segment) as main:
        first, second = (sub.description for sub in main.scan())
        assert (first.supports_lrw, second.supports_lrw) == (False, True)
        plan = make_plan([first, second])
        main.configure(plan)
        assert [device.state for device in segment] == [AlState.SAFE_OP] * 2
        units = {d.sync_unit: d.command for d in plan.cycle.frames[0].datagrams if d.sync_unit >= 0}
        assert sorted(units.values()) == [EcatCommand.LRD, EcatCommand.LRW]


def test_a_hundred_devices_in_few_frames() -> None:
    """PySOEM's config_init takes about 100 frames per device (`python -m benchmarks scan`)."""
    segment = Segment([Coupler(), *(Servo() for _ in range(99))])
    with MainDevice(segment) as main:
        assert len(main.scan()) == 100
        assert main.counts.sent < 15 * 100


def test_two_devices_with_one_alias_are_noted() -> None:
    with MainDevice(Segment([DigitalOutputs(alias=5), DigitalOutputs(alias=5)])) as main:
        main.scan()
        assert main.notes == ("devices (0, 1) have the same alias 5",)


def test_calls_on_a_closed_main_device_are_errors() -> None:
    main = MainDevice(demo_segment())
    with pytest.raises(RuntimeError, match="with block"):
        main.scan()


def test_the_length_of_a_requested_object_is_checked() -> None:
    with MainDevice(demo_segment()) as main:
        main.scan()
        asked = Asking({2: DeviceRequest(inputs=(ObjectReference(0x60F4, 0, 16),))})
        with pytest.raises(MappingError, match="has 32 bits, but 16 were requested"):
            main.plan(asked)


def scan_and_interrupt(main: MainDevice) -> None:
    with main:
        main.scan()
        raise KeyboardInterrupt
