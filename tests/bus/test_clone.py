"""Clones of virtual segments: what they contain, what they write, and what they restore."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import CloneError, LinkError, NoDeviceError, SegmentError
from catenary.line import Line, read_line
from catenary.link import Recorder
from catenary.virtual import MailboxQuirks, faults
from catenary.wire.al import AlState
from catenary.wire.datagram import Datagram
from catenary.wire.frame import decode_frame, is_alien
from catenary.wire.pcapng import decode_pcapng
from catenary.wire.register import PROCESS_RAM, STATION_ADDRESS
from catenary.wire.sii import IDENTITY_WORD

COUPLER, SERVO, OUTPUTS, WRIST = range(4)


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment(
        [
            cat.virtual.Coupler(),
            cat.virtual.Servo(alias=10, serial=5),
            cat.virtual.DigitalOutputs(),
            cat.virtual.Servo(name="wrist", serial=7),
        ]
    )


def bring(segment: cat.Segment, **states: AlState) -> None:
    """Bring devices to states, named by their constants. They stay in them."""
    with cat.MainDevice(segment) as main:
        for name, state in states.items():
            found = main.request_states(main.passive_scan(), [globals()[name]], state)
            for outcome in found.values():
                assert not isinstance(outcome, Exception), outcome


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def memory(segment: cat.Segment, position: int) -> dict[int, bytes]:
    """Return the registers of a device that do not change by themselves, by 16 bytes."""
    core = segment.core
    found = {start: core.peek(position, start, 16) for start in range(0, 0x900, 16)}
    del found[0x0500]  # data and status of the SII interface
    found[0x0500] = core.peek(position, 0x0500, 1)
    return found


def sent(path: Path) -> Iterator[Datagram]:
    """Yield the datagrams that a recorder saw."""
    for packet in decode_pcapng(path.read_bytes()).packets:
        if not is_alien(packet.data):
            yield from decode_frame(packet.data).datagrams


def written(path: Path) -> Iterator[Datagram]:
    return (each for each in sent(path) if each.command.writes)


def test_a_clone_has_everything_of_a_device(segment: cat.Segment, tmp_path: Path) -> None:
    line = cat.clone(segment, tmp_path / "line", pre_op=True)
    assert line.complete
    assert line == read_line(tmp_path / "line")
    coupler, servo, outputs, _ = line.devices
    assert (servo.parent, servo.parent_port, servo.alias) == (COUPLER, 1, 10)
    assert servo.identity == (0x43544E59, 0x00050001, servo.identity.revision, 5)
    assert servo.sii == segment.core.sii_image(SERVO)[: len(servo.sii or b"")]
    assert servo.value(0x1018, 4) == b"\x05\0\0\0"
    entry = servo.object(0x6040).entry(0)
    assert (entry.bit_length, entry.name) == (16, "Controlword")
    assert servo.mapping_source == "CoE"
    assert [each.sync_manager for each in servo.assignments] == [2, 3]
    assert servo.assignments[0].pdos[0].entries[0].index == 0x6040
    assert (outputs.mapping_source, outputs.objects) == ("SII", ())
    assert servo.error_counters is not None
    assert coupler.raised is False
    assert servo.raised is True


@pytest.mark.parametrize("pre_op", [False, True])
def test_two_clones_of_an_unchanged_segment_are_identical(
    segment: cat.Segment, tmp_path: Path, pre_op: bool
) -> None:
    if not pre_op:
        bring(segment, COUPLER=AlState.INIT, SERVO=AlState.PRE_OP, WRIST=AlState.PRE_OP)
    for name in "ab":
        assert cat.clone(segment, tmp_path / name, pre_op=pre_op).complete
    assert len(contents(tmp_path / "a")) == 1 + 2 * 4 + 2
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_what_is_raised_is_restored(segment: cat.Segment, tmp_path: Path) -> None:
    bring(segment, COUPLER=AlState.INIT)
    before = [memory(segment, n) for n in range(len(segment))]
    cat.clone(segment, tmp_path / "line", pre_op=True)
    assert [memory(segment, n) for n in range(len(segment))] == before


def test_without_pre_op_no_state_is_requested(segment: cat.Segment, tmp_path: Path) -> None:
    with Recorder(segment, tmp_path / "run.pcapng") as link:
        line = cat.clone(link, tmp_path / "line")
    assert "pre_op=True" in line.devices[SERVO].missing["objects"]
    assert not line.complete
    addresses = {each.ado for each in written(tmp_path / "run.pcapng")}
    assert not addresses & {0x0120, 0x0800, 0x0808}


def test_nothing_is_written_to_devices_in_safe_op_or_op(
    segment: cat.Segment, tmp_path: Path
) -> None:
    bring(segment, COUPLER=AlState.OP, OUTPUTS=AlState.SAFE_OP, WRIST=AlState.PRE_OP)
    running = (COUPLER, OUTPUTS)
    before = [memory(segment, n) for n in running]
    own = {int.from_bytes(segment.core.peek(n, 0x10, 2), "little") for n in running}
    path = tmp_path / "run.pcapng"
    with Recorder(segment, path) as link:
        line = cat.clone(link, tmp_path / "line", pre_op=True)
    assert [memory(segment, n) for n in running] == before
    commands = list(written(path))
    assert {each.command.name for each in commands} == {"FPWR"}  # by address, to the others
    assert not {each.adp for each in commands} & own
    # not even reads of a mailbox, which would empty it
    assert not [each for each in sent(path) if each.adp in own and each.ado >= PROCESS_RAM]
    for n in running:
        device = line.devices[n]
        assert (device.sii, device.identity) == (None, None)
        assert "writes to the device" in device.missing["sii"]
        assert device.information is not None
    assert line.devices[SERVO].complete
    assert line.devices[WRIST].complete


@pytest.mark.parametrize("address", [0, 0x1001])
def test_a_device_with_the_address_of_a_running_one_gets_another_for_the_reading(
    segment: cat.Segment, tmp_path: Path, address: int
) -> None:
    bring(segment, COUPLER=AlState.OP)
    segment.core.poke(COUPLER, STATION_ADDRESS.address, (0x1001).to_bytes(2, "little"))
    for position in (SERVO, OUTPUTS, WRIST):
        data = address.to_bytes(2, "little")
        segment.core.poke(position, STATION_ADDRESS.address, data)
    before = memory(segment, COUPLER)
    path = tmp_path / "run.pcapng"
    with Recorder(segment, path) as link:
        line = cat.clone(link, tmp_path / "line", pre_op=True)
    assert 0x1001 not in {each.adp for each in written(path) if each.command.name == "FPWR"}
    assert memory(segment, COUPLER) == before
    assert [each.station_address for each in line.devices] == [0x1001, *[address] * 3]
    assert line.devices[WRIST].complete
    found = [segment.core.peek(n, 0x10, 2) for n in (SERVO, OUTPUTS, WRIST)]
    assert found == [address.to_bytes(2, "little")] * 3


def test_serial_numbers_can_be_left_out(segment: cat.Segment, tmp_path: Path) -> None:
    line = cat.clone(segment, tmp_path / "line", pre_op=True, serials=False)
    servo = line.devices[SERVO]
    assert servo.identity.serial == 0
    assert servo.sii[2 * IDENTITY_WORD + 12 : 2 * IDENTITY_WORD + 16] == bytes(4)
    assert servo.object(0x1018).entry(4).reason == "withheld"
    assert line.complete
    assert not read_line(tmp_path / "line").serials


def test_an_interrupted_clone_continues(segment: cat.Segment, tmp_path: Path) -> None:
    def stop(text: str, done: int, total: int) -> None:
        if "wrist" in text:
            raise KeyboardInterrupt

    folder = tmp_path / "line"
    with pytest.raises(KeyboardInterrupt):
        cat.clone(segment, folder, pre_op=True, progress=stop)
    with pytest.raises(CloneError, match="not a finished clone"):
        read_line(folder)
    state = segment.core.peek(WRIST, 0x130, 1)[0]
    assert state & 15 == AlState.INIT  # it was brought back
    kept = contents(folder)
    times = {path: path.stat().st_mtime_ns for path in folder.glob("02-*/*")}
    line = cat.clone(segment, folder, pre_op=True)
    assert line.complete
    assert {path: path.stat().st_mtime_ns for path in folder.glob("02-*/*")} == times
    assert {name: contents(folder)[name] for name in kept} == kept
    cat.clone(segment, tmp_path / "whole", pre_op=True)
    assert contents(folder) == contents(tmp_path / "whole")


def test_a_device_is_read_again_if_it_does_not_fit_or_on_request(
    segment: cat.Segment, tmp_path: Path
) -> None:
    folder = tmp_path / "line"
    cat.clone(segment, folder, pre_op=True)
    edited = folder / "02-Catenary_virtual_servo" / "device.toml"
    text = edited.read_text()
    edited.write_text(text.replace("serial = 0x00000005", "serial = 0x00000006"))
    cat.clone(segment, folder, pre_op=True)
    assert edited.read_text() == text
    edited.write_text(text.replace("notes = []", 'notes = ["mine"]'))
    cat.clone(segment, folder, pre_op=True)
    assert "mine" in edited.read_text()
    cat.clone(segment, folder, pre_op=True, fresh=True)
    assert edited.read_text() == text


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
