"""A device that cannot be brought to PRE-OP is named, and does not affect the others."""

import struct

import pytest

import catenary as cat
from catenary.errors import CatenaryError, MailboxError, StateError
from catenary.wire.al import AlState

REFUSED = 0x0016  # invalid mailbox configuration, PRE-OP


@pytest.fixture
def segment() -> cat.Segment:
    segment = cat.Segment(
        [
            cat.virtual.Coupler(),
            cat.virtual.Servo(),
            cat.virtual.Servo(),
            cat.virtual.DigitalOutputs(),
        ]
    )
    segment[1].refuse_state(AlState.PRE_OP, REFUSED)
    return segment


def test_a_strict_scan_raises_the_error_and_keeps_all_handles(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        with pytest.raises(StateError, match="device 1") as caught:
            main.scan()
        assert caught.value.position == 1
        assert [sub.state for sub in main.subs] == [
            AlState.PRE_OP,
            None,
            AlState.PRE_OP,
            AlState.PRE_OP,
        ]
        assert [device.state for device in segment][2:] == [2, 2]


def test_without_strict_the_error_is_raised_when_the_device_is_used(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        subs = main.scan(strict=False)
        assert isinstance(subs[1].error, StateError)
        assert subs[1].identity == subs[2].identity  # the readable part is known
        assert subs[2].error is None
        assert subs[2].sdo.read(0x1018, 1)
        with pytest.raises(StateError, match="device 1"):
            subs[1].sdo.read(0x1018, 1)
        arm = cat.Drives([subs[2]], counts_per_turn=2**20, velocity_limit=100.0)
        with pytest.raises(StateError, match="device 1"), cat.Loop(arm):
            pass


def test_a_repaired_device_works_after_a_new_scan(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        before = main.scan(strict=False)[2]
        segment[1].refuse_state(AlState.PRE_OP, None)
        subs = main.scan()
        assert subs[2] is before
        assert [sub.error for sub in subs] == [None] * 4
        assert [sub.state for sub in subs] == [AlState.PRE_OP] * 4


def test_further_errors_are_notes(segment: cat.Segment) -> None:
    segment[2].refuse_state(AlState.PRE_OP, REFUSED)
    with cat.MainDevice(segment) as main:
        with pytest.raises(CatenaryError, match="device 1") as caught:
            main.scan()
        assert any("device 2" in note for note in caught.value.__notes__)


SLOW_READ, WRITE = 400_000_000, 3_000_000  # [ns] of the EEPROM


@pytest.fixture
def slow_segment() -> cat.Segment:
    """Yield a segment in which reading the EEPROM of device 1 takes minutes."""
    segment = cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.Servo(serial=2)])
    segment.core.time_sii(1, SLOW_READ, WRITE, False)
    return segment


def test_a_slow_eeprom_does_not_block_a_scan(slow_segment: cat.Segment) -> None:
    segment = slow_segment
    with cat.MainDevice(segment) as main:
        subs = main.scan(strict=False)
        assert segment.now_ns < 40e9
        assert "device 1: its description was not complete within 30 s" in str(subs[1].error)
        assert [subs[0].error, subs[2].error] == [None, None]
        assert subs[2].sdo.read(0x1018, 4)


def test_a_slow_eeprom_does_not_block_a_passive_scan(slow_segment: cat.Segment) -> None:
    with cat.MainDevice(slow_segment) as main:
        found = main.passive_scan()
        assert slow_segment.now_ns < 40e9
        assert any("within 30 s" in note for note in found[1].description.notes)
        assert found[2].identity.serial == 2


def test_an_endless_object_does_not_block_a_scan() -> None:
    """The device announces 4000 bytes for 0x1000, and sends one byte per segment, after 50 ms."""
    device = cat.virtual.Servo(mailbox_delay=0.05)
    segment = cat.Segment([cat.virtual.Coupler(), device, cat.virtual.Servo(serial=2)])
    announced = struct.pack("<HBHBI", 0x3000, 0x41, 0x1000, 0, 4000)

    def drip(protocol: int, payload: bytes) -> list[bytes]:
        command = payload[2]
        if command >> 5 == 3:  # segments
            return [struct.pack("<HB7x", 0x3000, command & 0x10 | 6 << 1)]
        return [announced]

    device.application.mailbox._serve = drip
    with cat.MainDevice(segment) as main:
        subs = main.scan(strict=False)
        assert segment.now_ns < 10e9
        assert isinstance(subs[1].error, MailboxError)
        assert str(subs[1].error).startswith("device 1 (Catenary virtual servo): SDO 0x1000:00: ")
        assert "of 4000 bytes within 5 s" in str(subs[1].error)
        assert subs[2].error is None
