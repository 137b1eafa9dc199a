"""Clones of segments with faults: what was read is kept, and the folder has the reasons."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import LinkError, NoDeviceError, SegmentError
from catenary.line import Line, read_line
from catenary.link import Recorder, Ring
from catenary.procedure.exchange import Procedure, after
from catenary.virtual import MailboxQuirks, faults
from catenary.wire.al import AlState
from catenary.wire.frame import decode_frame, is_alien
from tests.bus.cloned_segment import (
    SERVO,
    WRIST,
    bring,
    contents,
    make_segment,
)
from tests.bus.links import Meddler


@pytest.fixture
def segment() -> cat.Segment:
    return make_segment()


def test_lost_frames_change_nothing(tmp_path: Path) -> None:
    for name, losses in (("a", ()), ("b", (faults.lose_frames(at=0.0, every=37),))):
        devices = [cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.DigitalOutputs()]
        line = cat.clone(cat.Segment(devices, faults=losses), tmp_path / name, pre_op=True)
        assert line.complete
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_a_cut_ring_is_refused(tmp_path: Path) -> None:
    segment = cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo()], ring=True)
    with cat.MainDevice(Ring(segment.first, segment.second)) as main:
        main.passive_scan()
    segment.inject(faults.cut(between=(0, 1)))
    with pytest.raises(SegmentError, match="the ring is cut"):
        cat.clone(Ring(segment.first, segment.second), tmp_path / "line")


def test_an_impossible_mailbox_is_a_reason(segment: cat.Segment, tmp_path: Path) -> None:
    bring(segment, SERVO=AlState.PRE_OP)
    segment.core.poke(SERVO, 0x0802, b"\x03\0")
    line = cat.clone(segment, tmp_path / "line")
    assert line.devices[SERVO].missing["objects"].startswith("its mailbox is configured with 3")


def clone_of(device: cat.virtual.Servo, folder: Path, **options: float) -> Line:
    return cat.clone(cat.Segment([device]), folder, pre_op=True, **options)


@pytest.mark.parametrize("kind", ["missing", "promised"])
def test_a_list_without_an_end_is_a_reason_and_the_rest_is_kept(tmp_path: Path, kind: str) -> None:
    quirks = MailboxQuirks(object_list=kind)
    [device] = clone_of(cat.virtual.Servo(mailbox_quirks=quirks), tmp_path / "line").devices
    assert "list of objects is truncated" in device.missing["objects"]
    assert device.value(0x1000, 0) is not None


def test_a_dictionary_that_takes_too_long_is_bounded(tmp_path: Path) -> None:
    servo = cat.virtual.Servo(mailbox_delay=0.02)
    [device] = clone_of(servo, tmp_path / "line", objects_timeout=2.0).devices
    assert "reading ended after 2 s" in device.missing["objects"]
    assert 0 < len(device.objects) < 70
    assert read_line(tmp_path / "line").devices == (device,)


def test_a_device_that_becomes_silent_in_the_middle(tmp_path: Path) -> None:
    segment = cat.Segment([cat.virtual.Servo(mailbox_delay=0.001), cat.virtual.DigitalOutputs()])

    def stop(text: str, done: int, total: int) -> None:
        if "objects" in text and done == 5:
            segment.inject(faults.mailbox_silent(0))

    line = cat.clone(segment, tmp_path / "line", pre_op=True, progress=stop)
    servo, outputs = line.devices
    assert "3 failures in a row" in servo.missing["objects"]
    assert len(servo.objects) >= 5
    assert outputs.complete


def test_single_objects_without_a_description_are_explained(tmp_path: Path) -> None:
    quirks = MailboxQuirks(malformed_descriptions=(0x1018,))
    [device] = clone_of(cat.virtual.Servo(mailbox_quirks=quirks), tmp_path / "line").devices
    found = device.object(0x1018)
    assert found.code == 0
    assert "invalid SDO information answer" in found.reason
    assert found.entry(2).value == b"\x01\0\x05\0"  # values are read without a description


def test_a_mailbox_that_refuses_everything_is_a_reason(tmp_path: Path) -> None:
    quirks = MailboxQuirks(error_reply="unsupported")
    [device] = clone_of(cat.virtual.Servo(mailbox_quirks=quirks), tmp_path / "line").devices
    assert "protocol is not supported" in device.missing["objects"]
    assert (device.objects, device.complete) == ((), False)


def test_a_refused_state_is_a_reason(segment: cat.Segment, tmp_path: Path) -> None:
    segment.inject(faults.refuse_state(SERVO, AlState.PRE_OP, 0x0012))
    line = cat.clone(segment, tmp_path / "line", pre_op=True)
    assert "0x0012" in line.devices[SERVO].missing["objects"]
    assert line.devices[WRIST].complete


def test_a_state_that_changes_meanwhile_ends_the_writing(
    segment: cat.Segment, tmp_path: Path
) -> None:
    bring(segment, SERVO=AlState.PRE_OP)
    path = tmp_path / "run.pcapng"

    def change(text: str, done: int, total: int) -> None:
        if "objects" in text and done == 10:
            segment.inject(faults.leave_state(SERVO, AlState.INIT, 0x001B))

    with Recorder(segment, path) as link:
        line = cat.clone(link, tmp_path / "line", progress=change)
    assert "it is not written to" in line.devices[SERVO].missing["objects"]
    assert len(line.devices[SERVO].objects) == 10


def test_nothing_is_written_after_a_device_left_pre_op_during_an_upload(
    segment: cat.Segment, tmp_path: Path
) -> None:
    bring(segment, SERVO=AlState.PRE_OP)
    station = segment.core.peek(SERVO, 0x10, 2)
    writes = []

    def change(count: int, frame: bytes) -> list[bytes]:
        """Set SAFE-OP when the servo has taken the tenth message, and note later writes."""
        for each in [] if is_alien(frame) else decode_frame(frame).datagrams:
            if each.command.name == "FPWR" and each.adp.to_bytes(2, "little") == station:
                writes.append(each)
                if len(writes) == 10:
                    segment.core.poke(SERVO, 0x0130, b"\x04")
        return [frame]

    with Meddler(segment.open_link(), change) as link:
        line = cat.clone(link, tmp_path / "line")
    assert "it is not written to" in line.devices[SERVO].missing["sii"]
    assert len(writes) == 10


def wait(seconds: float) -> Procedure[None]:
    yield after(seconds)


def configuration(segment: cat.Segment) -> list[bytes]:
    """Return address, AL status, owner of the EEPROM and mailbox of device 0, without states."""
    places = ((0x10, 2), (0x130, 6), (0x500, 1), (0x800, 5), (0x806, 1), (0x808, 5), (0x80E, 1))
    return [segment.core.peek(0, *place) for place in places]


@pytest.mark.parametrize(
    ("state", "register"),
    [
        *((AlState.INIT, each) for each in (0x0010, 0x0120, 0x0500, 0x0502, 0x0800, 0x1000)),
        *((AlState.PRE_OP, each) for each in (0x0010, 0x0500, 0x0502, 0x1000)),
    ],
)
def test_an_interruption_after_a_write_restores_the_device(
    tmp_path: Path, state: AlState, register: int
) -> None:
    segment = cat.Segment([cat.virtual.Servo()])
    with cat.MainDevice(segment) as main:
        main.request_states(main.passive_scan(), [0], state)
    segment.core.poke(0, 0x0010, bytes(2))
    segment.core.poke(0, 0x0500, b"\1")  # its processor owns the EEPROM
    before = configuration(segment)
    interrupted = False

    def interrupt(count: int, frame: bytes) -> list[bytes]:
        nonlocal interrupted
        found = () if is_alien(frame) else decode_frame(frame).datagrams
        if not interrupted and any(each.command.writes and each.ado == register for each in found):
            interrupted = True
            raise KeyboardInterrupt
        return [frame]

    with (
        Meddler(segment.open_link(), interrupt) as link,
        pytest.raises(KeyboardInterrupt) as error,
    ):
        cat.clone(link, tmp_path / "line", pre_op=True)
    assert not getattr(error.value, "__notes__", [])
    with cat.MainDevice(segment) as main:
        main.converse(wait(0.1))  # for a change of state on its way
    assert configuration(segment) == before


def test_a_device_that_disappears_is_an_error_and_not_a_clone(
    segment: cat.Segment, tmp_path: Path
) -> None:
    def unplug(text: str, done: int, total: int) -> None:
        segment.inject(faults.unplug(WRIST))

    with pytest.raises(SegmentError, match="4 devices were found, and 3 after"):
        cat.clone(segment, tmp_path / "line", progress=unplug)
    assert not (tmp_path / "line" / "line.toml").exists()


def test_an_earlier_clone_survives_an_empty_segment(segment: cat.Segment, tmp_path: Path) -> None:
    folder = tmp_path / "line"
    cat.clone(segment, folder)
    segment.unplug()
    with pytest.raises(NoDeviceError):
        cat.clone(segment, folder)
    assert len(read_line(folder).devices) == 4


def test_options_are_checked(segment: cat.Segment, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="objects_timeout"):
        cat.clone(segment, tmp_path, objects_timeout=0)


@pytest.mark.wire
def test_the_lock_of_the_interface_is_respected(tmp_path: Path, veth: tuple[str, str]) -> None:
    near, _ = veth
    with cat.MainDevice(near), pytest.raises(LinkError, match="another EtherCAT master is live"):
        cat.clone(near, tmp_path / "line")
