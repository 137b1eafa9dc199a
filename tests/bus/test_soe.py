"""IDNs of a SERCOS drive: `sub.soe` without and with a loop, telegrams, events."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

import catenary as cat
from catenary.bus import MainDevice, SubDevice
from catenary.bus.event_types import SoeEmergency, SoeNotification
from catenary.errors import MailboxError, MappingError, ResponseTimeout, SoeError, StateError
from catenary.model.device import DeviceDescription
from catenary.model.esi_settings import IdnCommand
from catenary.virtual import Coupler, Segment, SercosDrive, Servo, SoeQuirks
from catenary.wire.sercos import Display
from catenary.wire.soe import Element

LARGE = list(range(1024))


@pytest.fixture
def drive() -> SercosDrive:
    return SercosDrive()


@pytest.fixture
def main(drive: SercosDrive) -> Iterator[MainDevice]:
    with MainDevice(Segment([Coupler(), drive])) as main:
        main.scan()
        yield main


@pytest.fixture
def sub(main: MainDevice) -> SubDevice:
    return main.subs[1]


@contextmanager
def scanned(quirks: SoeQuirks) -> Iterator[SubDevice]:
    with MainDevice(Segment([Coupler(), SercosDrive(soe_quirks=quirks)])) as main:
        yield main.scan()[1]


def test_values_are_displayed_numbers(sub: SubDevice, drive: SercosDrive) -> None:
    drive.move_to(1.0)
    assert sub.soe.read("S-0-0051") == round((1 << 20) / 6.283185307179586)
    assert sub.soe.read("S-0-0046") == -4
    assert sub.soe.read("S-0-0092") == 300.0
    assert sub.soe.read("S-0-0140") == "Catenary virtual SERCOS drive"
    assert sub.soe.read("S-0-0016") == ["S-0-0051"]
    assert sub.soe.read(0x800A) == 0


def test_a_value_is_written(sub: SubDevice, drive: SercosDrive) -> None:
    sub.soe.write("S-0-0092", 150.5)
    assert drive.idn_value("S-0-0092") == (1505).to_bytes(2, "little")
    sub.soe.write("S-0-0142", "Gripper")
    assert sub.soe.read("S-0-0142") == "Gripper"
    sub.soe.write_bytes("P-0-0010", b"\x34\x12")
    assert sub.soe.read_bytes("P-0-0010") == b"\x34\x12"


def test_large_lists_pass_in_fragments(sub: SubDevice, drive: SercosDrive) -> None:
    sub.soe.write("P-0-0018", LARGE)
    assert sub.soe.read("P-0-0018") == LARGE
    assert len(drive.idn_value("P-0-0018")) == 4 + 4096
    with pytest.raises(SoeError, match="0x7003"):
        sub.soe.write("P-0-0018", [*LARGE, 1])


def test_the_description_of_an_idn(sub: SubDevice) -> None:
    found = sub.soe.describe("S-0-0091")
    assert (found.idn, found.name, found.unit) == (
        "S-0-0091",
        "Bipolar velocity limit value",
        "rpm",
    )
    assert found.attribute.display is Display.UNSIGNED
    assert found.minimum == 0
    assert found.value == found.default == pytest.approx(3342.2538)
    assert sub.soe.describe("S-0-0016").list_limit == 32
    assert sub.soe.describe("S-0-0016").protected_in == ("SAFE_OP", "OP")
    assert "S-0-0091" in str(found)


def test_the_list_of_all_idns(sub: SubDevice) -> None:
    idns = sub.soe.list()
    assert {"S-0-0047", "S-0-0135", "P-0-0018"} <= set(idns)
    for idn in idns:
        assert sub.soe.describe(idn).idn == idn


@pytest.mark.parametrize(
    ("idn", "value", "code"),
    [
        ("S-0-0999", 1, 0x1001),
        ("S-0-0135", 1, 0x7004),
        ("S-0-0002", 100, 0x7006),
        ("S-0-0015", 8, 0x7007),
        ("S-0-0024", ["S-0-0051"], 0x7008),
        ("S-0-0024", ["S-0-0047", "S-0-0047"], 0x7008),
    ],
)
def test_a_refused_value(sub: SubDevice, idn: str, value: object, code: int) -> None:
    with pytest.raises(SoeError) as error:
        sub.soe.write(idn, value)  # type: ignore[arg-type]
    assert error.value.code == code
    assert idn in str(error.value)


def test_another_drive_does_not_exist(sub: SubDevice) -> None:
    with pytest.raises(SoeError, match="of drive 1: read refused with 0x800A: invalid drive"):
        sub.soe.read("S-0-0051", drive=1)


def test_wrong_arguments_are_refused(sub: SubDevice) -> None:
    for call in (
        lambda: sub.soe.read("47"),
        lambda: sub.soe.read("S-0-0047", drive=8),
        lambda: sub.soe.read("S-0-0047", timeout=0),
        lambda: sub.soe.command("S-0-0099", timeout=float("inf")),
        lambda: sub.soe.write("S-0-0092", 1e9),
        lambda: sub.soe.write("S-0-0099", 3),
    ):
        with pytest.raises(ValueError, match=r"IDN|drive|timeout|does not fit|procedure command"):
            call()


def test_devices_without_soe() -> None:
    with MainDevice(Segment([Coupler(), Servo()])) as main:
        coupler, servo = main.scan()
        with pytest.raises(MailboxError, match="has no mailbox"):
            coupler.soe.read("S-0-0047")
        with pytest.raises(MailboxError, match="protocol is not supported"):
            servo.soe.read("S-0-0047")


def test_a_sercos_drive_has_no_coe(sub: SubDevice) -> None:
    assert sub.description.soe
    assert not sub.description.coe
    with pytest.raises(MailboxError, match="does not support CoE"):
        sub.sdo.read(0x1000)


# -- commands --------------------------------------------------------------------------------------


def test_a_command_ends_with_a_notification(main: MainDevice, sub: SubDevice) -> None:
    sub.soe.command("S-0-0127")
    [event] = [each for each in main.events if isinstance(each, SoeNotification)]
    assert (event.sub, event.idn, event.data) == (sub, 127, b"\x03\x00")
    assert sub.soe.describe("S-0-0127").state == 0


def test_a_command_that_fails() -> None:
    with (
        scanned(SoeQuirks(failing_commands=("S-0-0264",))) as sub,
        pytest.raises(SoeError, match="S-0-0264: the procedure command failed"),
    ):
        sub.soe.command("S-0-0264")


def test_a_stuck_command_is_cancelled() -> None:
    with scanned(SoeQuirks(stuck_commands=("S-0-0099",))) as sub:
        with pytest.raises(ResponseTimeout, match=r"has not ended after 0\.2 s"):
            sub.soe.command("S-0-0099", timeout=0.2)
        assert sub.soe.describe("S-0-0099").state == 0


def test_a_refused_phase_lists_the_invalid_idns() -> None:
    with scanned(SoeQuirks(invalid_for_phase_3=("S-0-0079",))) as sub:
        with pytest.raises(SoeError, match="S-0-0021"):
            sub.soe.command("S-0-0127")
        assert sub.soe.read("S-0-0021") == ["S-0-0079"]
        with pytest.raises(StateError), cat.Loop(cat.ProcessData(sub)):
            pass


# -- quirks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "quirks",
    [
        SoeQuirks(fragment_bytes=2),
        SoeQuirks(fragment_bytes=5, constant_fragments=True),
        SoeQuirks(one_element=True),
        SoeQuirks(notifications=False),
    ],
)
def test_unusual_drives_are_read(quirks: SoeQuirks) -> None:
    with scanned(quirks) as sub:
        assert sub.description.notes == ()
        assert sub.soe.read("S-0-0016") == ["S-0-0051"]
        assert sub.soe.describe("S-0-0091").unit == "rpm"
        sub.soe.command("S-0-0099")


@pytest.mark.parametrize(
    ("quirks", "note"),
    [
        (SoeQuirks(refused={"S-0-0024": 0x7008}), "0x7008"),
        (SoeQuirks(lying_lists=("S-0-0016",)), "its header states"),
    ],
)
def test_telegrams_that_cannot_be_read_are_a_note(quirks: SoeQuirks, note: str) -> None:
    with scanned(quirks) as sub:
        assert sub.error is None
        assert note in sub.description.notes[0]
        assert sub.description.outputs == ()
        assert sub.soe.read("S-0-0002") == 1000


# -- telegrams -------------------------------------------------------------------------------------


def test_the_telegrams_are_process_data(sub: SubDevice) -> None:
    [axis] = sub.description.sercos_axes
    command, feedback = axis.output("S-0-0047"), axis.input("S-0-0051")
    assert command is not None
    assert feedback is not None
    assert (command.bit_offset, command.bit_length) == (16, 32)
    assert (axis.position.type, axis.position.resolution) == (0x0A, 1 << 20)
    assert (axis.velocity.exponent, axis.torque.polarity) == (-4, 0)
    assert axis.input("S-0-0040") is None
    assert sub.description.mapping_source == "SoE"


def test_telegrams_are_configured(sub: SubDevice) -> None:
    sub.soe.configure_telegrams(mdt=["S-0-0036", "S-0-0081"], at=["S-0-0040", "S-0-0084"])
    [axis] = sub.description.sercos_axes
    assert [each.idn for each in axis.outputs] == ["S-0-0134", "S-0-0036", "S-0-0081"]
    assert [each.bit_offset for each in axis.inputs] == [0, 16, 48]
    raw = cat.ProcessData(sub)
    with cat.Loop(raw) as loop:
        next(loop)
        assert len(raw.outputs) == len(raw.inputs) == 8


def test_standard_telegrams(sub: SubDevice, main: MainDevice) -> None:
    sub.soe.write("S-0-0015", 5)
    [_, sub] = main.scan()
    [axis] = sub.description.sercos_axes
    assert not axis.is_configurable
    assert [each.idn for each in axis.inputs] == ["S-0-0135", "S-0-0051", "S-0-0040"]
    with cat.Loop(cat.ProcessData(sub)) as loop:
        next(loop)


def test_telegrams_that_changed_after_the_scan_are_refused(sub: SubDevice) -> None:
    sub.soe.write("S-0-0024", ["S-0-0036"])
    with pytest.raises(MappingError, match="have changed since"), cat.Loop(cat.ProcessData(sub)):
        pass


def test_a_drive_without_values_has_its_words(sub: SubDevice) -> None:
    sub.soe.configure_telegrams(mdt=[], at=[])
    raw = cat.ProcessData(sub)
    with cat.Loop(raw) as loop:
        next(loop)
        assert len(raw.outputs) == 2
    with pytest.raises(ValueError, match="not an IDN"):
        sub.soe.configure_telegrams(mdt=["47"])


# -- start-up commands of an ESI or ENI ------------------------------------------------------------


def commanded(main: MainDevice, *commands: IdnCommand) -> SubDevice:
    """Scan with start-up commands, and return the drive."""

    def settings(device: DeviceDescription) -> DeviceDescription:
        return replace(device, idn_commands=commands) if device.position else device

    return main.scan(settings=settings)[1]


def command(transition: str, number: int, data: str) -> IdnCommand:
    return IdnCommand((transition,), number, bytes.fromhex(data), source="bus.xml:5")


def test_start_up_commands_run_at_their_transitions(main: MainDevice, drive: SercosDrive) -> None:
    at_safe_op, at_op = command("PS", 2, "d007"), command("SO", 0x800A, "3412")
    downward = command("SP", 0x800A, "0000")
    sub = commanded(main, command("IP", 24, "020002002400"), at_safe_op, at_op, downward)
    assert [each.idn for each in sub.description.sercos_axes[0].outputs] == ["S-0-0134", "S-0-0036"]
    assert drive.idn_value("S-0-0002") == (1000).to_bytes(2, "little")  # not yet
    with cat.Loop(cat.ProcessData(sub)) as loop:
        next(loop)
        assert drive.idn_value("S-0-0002") == (2000).to_bytes(2, "little")
        assert drive.idn_value("P-0-0010") == b"\x34\x12"


def test_start_up_commands_run_in_the_order_of_the_transitions(
    main: MainDevice, drive: SercosDrive
) -> None:
    """A command of IP comes before one of PS, whatever their order in the file."""
    sub = commanded(main, command("PS", 0x800A, "0200"), command("IP", 0x800A, "0100"))
    with cat.Loop(cat.ProcessData(sub)) as loop:
        next(loop)
        assert drive.idn_value("P-0-0010") == b"\x02\x00"


def test_a_refused_start_up_command_names_its_line(main: MainDevice) -> None:
    sub = commanded(main, command("PS", 51, "00000000"))
    with pytest.raises(SoeError, match=r"0x7004.*bus.xml:5"), cat.Loop(cat.ProcessData(sub)):
        pass


# -- with a loop -----------------------------------------------------------------------------------


def test_requests_while_a_loop_runs(sub: SubDevice) -> None:
    raw = cat.ProcessData(sub)
    with cat.Loop(raw) as loop:
        next(loop)
        answer = sub.soe.request("S-0-0095")
        writing = sub.soe.request_write("P-0-0018", LARGE)
        command = sub.soe.request_command("S-0-0099")
        refused = sub.soe.request_write("S-0-0047", 5)
        with pytest.raises(RuntimeError, match="would stop the loop"):
            sub.soe.read("S-0-0051")
        with pytest.raises(RuntimeError, match="loop"):
            sub.soe.configure_telegrams(mdt=[])
        for _ in loop:
            if all(each.done for each in (answer, writing, command, refused)):
                break
        assert answer.result() == "A0013 ready for operation"
        assert writing.result() is command.result() is None
        with pytest.raises(SoeError, match="0x700A"):
            refused.result()
        assert loop.timing.counters["lost"] == 0


def test_a_fault_is_an_event_and_is_reset(
    main: MainDevice, sub: SubDevice, drive: SercosDrive
) -> None:
    raw = cat.ProcessData(sub)
    with cat.Loop(raw) as loop:
        next(loop)
        drive.inject_fault(0x7310)
        found: list[SoeEmergency] = []
        for _ in loop:
            found += [each for each in main.events if isinstance(each, SoeEmergency)]
            if found and raw["S-0-0135"] >> 13 & 1:
                break
        assert found[0].data[:2] == (0x7310).to_bytes(2, "little")
        drive.inject_fault(0)
        command = sub.soe.request_command("S-0-0099")
        for _ in loop:
            if command.done and raw["S-0-0135"] >> 14 == 2:
                break
        command.result()


def returned(sub: SubDevice, drive: SercosDrive, kind: int) -> None:
    """Switch a drive off and on while a loop runs. Its telegrams then have their defaults."""
    telegrams = drive.application.telegrams
    assert telegrams is not None
    raw = cat.ProcessData(sub, required=False)
    with cat.Loop(raw, period=1e-3) as loop:
        for cycle in range(3000):
            next(loop)
            if cycle == 200:
                drive.power_off()
            if cycle == 400:
                telegrams.kind = kind
                telegrams.lists = {True: (47,), False: (51,)}
                drive.power_on()
            if cycle > 500 and raw.present:
                break
        assert raw.present


def test_a_drive_that_returns_gets_its_telegrams_back(sub: SubDevice, drive: SercosDrive) -> None:
    sub.soe.configure_telegrams(mdt=["S-0-0036"], at=["S-0-0040"])
    returned(sub, drive, 7)
    assert drive.application.telegrams is not None
    assert drive.application.telegrams.lists == {True: (36,), False: (40,)}


def test_a_drive_that_returns_gets_its_telegram_type_back(
    main: MainDevice, sub: SubDevice, drive: SercosDrive
) -> None:
    sub.soe.write("S-0-0015", 5)
    sub = main.scan()[1]
    returned(sub, drive, 7)
    assert drive.application.telegrams is not None
    assert drive.application.telegrams.kind == 5


def test_elements_are_read_as_bytes(sub: SubDevice) -> None:
    data = sub.soe.read_bytes("S-0-0047", Element.ATTRIBUTE | Element.VALUE)
    assert data == bytes.fromhex("01002200") + bytes(4)
