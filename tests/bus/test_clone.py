"""Clones of virtual segments: what they contain, what they write, and what they restore."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import CloneError
from catenary.line import read_line
from catenary.link import Recorder, Ring
from catenary.wire.al import AlState
from catenary.wire.register import PROCESS_RAM, STATION_ADDRESS
from catenary.wire.sii import IDENTITY_WORD
from tests.bus.cloned_segment import (
    COUPLER,
    OUTPUTS,
    SERVO,
    WRIST,
    bring,
    contents,
    make_segment,
    memory,
    sent,
    written,
)


@pytest.fixture
def segment() -> cat.Segment:
    return make_segment()


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


def test_a_ring_is_cloned_in_the_order_of_its_first_end(tmp_path: Path) -> None:
    segment = cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo()], ring=True)
    line = cat.clone(Ring(segment.first, segment.second), tmp_path / "line", pre_op=True)
    assert [(device.parent, device.parent_port) for device in line.devices] == [
        (None, None),
        (0, 1),
    ]
    assert (line.complete, line.notes) == (True, ())


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
    (folder / "line.toml").unlink()  # as after an interruption
    edited.write_text(text.replace("serial = 0x00000005", "serial = 0x00000006"))
    cat.clone(segment, folder, pre_op=True)
    assert edited.read_text() == text
    (folder / "line.toml").unlink()
    edited.write_text(text.replace("notes = []", 'notes = ["mine"]'))
    cat.clone(segment, folder, pre_op=True)
    assert "mine" in edited.read_text()
    cat.clone(segment, folder, pre_op=True, fresh=True)
    assert edited.read_text() == text


def test_a_complete_clone_is_read_again_so_that_it_shows_changes(
    segment: cat.Segment, tmp_path: Path
) -> None:
    def stop(text: str, done: int, total: int) -> None:
        if "wrist" in text:
            raise KeyboardInterrupt

    folder = tmp_path / "line"
    cat.clone(segment, folder, pre_op=True)
    changed = b"\x07"
    for position in (SERVO, WRIST):
        segment.core.poke(position, 0x0300, changed)
    with pytest.raises(KeyboardInterrupt):
        cat.clone(segment, folder, pre_op=True, progress=stop)
    line = cat.clone(segment, folder, pre_op=True)  # not a mixture of old and new devices
    for position in (SERVO, WRIST):
        assert line.devices[position].registers[0x0300][:1] == changed
    assert read_line(folder) == line


def test_a_finished_device_is_not_replaced_by_less(segment: cat.Segment, tmp_path: Path) -> None:
    folder = tmp_path / "line"
    whole = cat.clone(segment, folder, pre_op=True)
    before = contents(folder)
    own = [name for name in before if name.startswith(("02-", "03-", "04-"))]
    bring(segment, OUTPUTS=AlState.OP)  # and all devices have other addresses
    line = cat.clone(segment, folder)
    assert line.devices[1:] == whole.devices[1:]  # the coupler was read again
    assert all("kept from an earlier clone" in note for note in line.notes)
    assert line.notes[1].startswith("device 2 (Catenary virtual 4-channel output): kept")
    after = contents(folder)
    assert {name: after[name] for name in own} == {name: before[name] for name in own}
    assert not cat.clone(segment, folder, fresh=True).complete


def test_serial_numbers_of_an_earlier_clone_are_not_kept(
    segment: cat.Segment, tmp_path: Path
) -> None:
    folder = tmp_path / "line"
    cat.clone(segment, folder, pre_op=True)
    bring(segment, WRIST=AlState.SAFE_OP, SERVO=AlState.PRE_OP)
    line = cat.clone(segment, folder, serials=False)
    assert line.devices[WRIST].identity is None
    assert line.devices[SERVO].identity.serial == 0
    assert b"serial = 0x00000007" not in b"".join(contents(folder).values())
