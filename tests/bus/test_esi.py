"""Scan of a virtual segment with ESI files, and loops that use them."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import catenary as cat
from catenary.bus import MainDevice
from catenary.errors import ConfigurationError, EsiError, EsiLookupError, MappingError, SdoAbort
from catenary.esi.library import Library
from catenary.model.device import Direction
from catenary.plan import DeviceRequest
from catenary.plan.request import DistributedClock
from catenary.procedure.sdo import download
from catenary.types import SINT, UDINT, UINT, USINT
from catenary.wire.al import AlState
from catenary.wire.sdo_information import ListType
from tests.esi import servo_file
from tests.plan.devices import Asking


def test_program_7_plans_the_clocks_of_the_esi(tmp_path: Path) -> None:
    path = servo_file.write(tmp_path)
    with MainDevice(servo_file.segment()) as main:
        subs = main.scan(esi=tmp_path)
        assert subs[1].esi is not None
        assert [mode.name for mode in subs[1].esi.op_modes] == ["Synchron", "DC"]
        arm = cat.Drives(
            subs[1:2],
            counts_per_turn=2**20,
            velocity_limit=1.0,
            dc=cat.DistributedClock(op_mode="DC-Synchron"),
        )
        plan = main.plan(arm, period=1e-3)
        source = servo_file.line_of(path, "<Name>DC</Name>")
        assert str(plan.clocks).splitlines()[0] == (
            "device 1 (Catenary virtual servo): AssignActivate 0x0300, SYNC0 1 ms, shift +0 us, "
            f"OpMode 'DC', source: ESI {source}"
        )
        assert f"OpMode 'DC' (ESI {source})" in str(plan)
        main.configure(plan)
        assert main.subs[1].state is AlState.SAFE_OP


def test_names_come_from_the_esi_and_the_mapping_from_the_device(tmp_path: Path) -> None:
    servo_file.write(tmp_path)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        description = sub.description
        assert description.mapping_source == "CoE"
        assert sub.name == "Catenary virtual servo"
        assert [row.name for row in sub.pdos][:2] == ["ESI 6040", "ESI 6060"]
        # its ESI lacks the torques, which the device reports
        assert [(row.index, row.name) for row in sub.pdos if "orque" in row.name] == [
            (0x6071, "Target torque"),
            (0x6077, "Torque actual value"),
        ]
        assert any("0x1600 has" in note and "ESI" in note for note in main.notes)


def test_a_scan_without_esi_files_imports_neither_sqlite_nor_a_parser() -> None:
    program = (
        "import sys; import catenary.bus; from catenary.bus.esi_source import open_source\n"
        "assert open_source(None) is open_source(False) is None\n"
        "found = {'sqlite3', 'pyexpat', 'catenary.esi.library', 'catenary.esi.reader'}\n"
        "print(sorted(found & set(sys.modules)))"
    )
    environment = {"CATENARY_ESI": "/nonexistent", "PATH": "/usr/bin:/bin"}
    found = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        env=environment,
        cwd=Path(__file__).parents[2],
        check=True,
    )
    assert found.stdout.strip() == "[]"


def test_the_library_of_the_user_is_the_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = servo_file.write(tmp_path)
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "library"))
    Library().add(path)
    with MainDevice(servo_file.segment()) as main:
        first = main.scan()[1]
        assert first.esi is not None
        assert main.scan(esi=False)[1] is first
        assert first.esi is None
        assert main.scan(esi=Library())[1].esi is not None


def test_a_library_without_the_devices_is_silent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = servo_file.write(tmp_path, product=7)
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "library"))
    Library().add(path)
    with MainDevice(servo_file.segment()) as main:
        assert main.scan()[1].esi is None
        assert main.notes == ()


# -- bad input ---------------------------------------------------------------------------------


def test_the_file_of_another_device_is_refused_with_its_place(tmp_path: Path) -> None:
    path = servo_file.write(tmp_path, product=7)
    with MainDevice(servo_file.segment()) as main:
        with pytest.raises(EsiLookupError, match="describes none of the devices") as caught:
            main.scan(esi=path)
        assert servo_file.line_of(path, "<Device ") in str(caught.value)
        main.scan(esi=path, strict=False)
        assert "describes none of the devices" in main.notes[-1]


def test_a_missing_path_is_refused_before_anything_is_sent(tmp_path: Path) -> None:
    with MainDevice(servo_file.segment()) as main:
        with pytest.raises(EsiError, match="no such file or folder"):
            main.scan(esi=tmp_path / "none.xml")
        assert main.counts.sent == 0


def test_a_rule_that_refuses_the_revision_is_a_note(tmp_path: Path) -> None:
    path = servo_file.write(tmp_path, number=0xFF, check='CheckRevisionNo="EQ"')
    servo_file.write(tmp_path, "other.xml", product=9)
    with MainDevice(servo_file.segment()) as main:
        with pytest.raises(EsiLookupError):
            main.scan(esi=path)
        assert main.subs[1].esi is None
        assert main.subs[1].description.init_commands == ()


def test_two_files_that_contradict_each_other_are_noted(tmp_path: Path) -> None:
    servo_file.write(tmp_path, "a.xml")
    servo_file.write(
        tmp_path,
        "b.xml",
        pdos=servo_file.pdo("TxPdo", 0x1A00, "Other", servo_file.TX[:1], 'Sm="3"'),
    )
    with MainDevice(servo_file.segment()) as main:
        main.scan(esi=tmp_path)
        notes = [note for note in main.notes if "a.xml" in note and "b.xml" in note]
        assert len(notes) == 1


def test_a_pdo_that_the_device_lacks_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    extra = servo_file.pdo("TxPdo", 0x1A3F, "Extra", servo_file.TX[:1])
    path = servo_file.write(tmp_path, pdos=servo_file.PDOS + extra)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=path)[1]
        before = sub.sdo.read(0x1C13, 1, type=UINT)
        request = cat.ProcessData(sub, pdos=["Extra"])
        with pytest.raises(MappingError, match="but its dictionary does not") as caught:
            main.plan(request)
        assert servo_file.line_of(path, "<TxPdo ><Index>#x1a3f") in str(caught.value)
        assert (sub.sdo.read(0x1C13, 0, type=USINT), sub.sdo.read(0x1C13, 1, type=UINT)) == (
            1,
            before,
        )


def test_an_unknown_mode_names_the_file(tmp_path: Path) -> None:
    path = servo_file.write(tmp_path)
    with MainDevice(servo_file.segment()) as main:
        main.scan(esi=path)
        clock = DeviceRequest(clock=DistributedClock(op_mode="Turbo"))
        with pytest.raises(ConfigurationError, match=r"servo\.xml:\d+ has no OpMode 'Turbo'"):
            main.plan(Asking({1: clock}))


# -- commands ----------------------------------------------------------------------------------


def test_commands_are_written_before_your_objects(tmp_path: Path) -> None:
    commands = (
        servo_file.command(0x6065, "10270000", "IP")
        + servo_file.command(0x6083, "e8030000")
        + servo_file.command(0x6084, "e8030000", "SO")
        + servo_file.command(0x1C12, "00")
        + servo_file.command(0x6085, "d0070000")
    )
    path = servo_file.write(tmp_path, commands=commands)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=path)[1]
        own = cat.StartUp(0x6085, 0, 4000, type=UDINT)
        plan = main.plan(cat.ProcessData(sub, start_up=[own]))
        device = plan.devices[1]
        assert [each.index for each in device.downloads] == [0x6065, 0x6083, 0x6085]
        assert [each.index for each in device.commands.in_safe_op] == [0x6084]
        assert [line.split(" (")[0] for line in device.commands.omitted] == [
            "0x1C12:00: the plan writes the mapping",
            "0x6085:00: your start-up object replaces it",
        ]
        text = str(plan)
        assert f"→ 10 27 00 00  {servo_file.line_of(path, '<InitCmd >')} from the ESI" in text
        main.configure(plan)
        assert sub.sdo.read(0x6065, type=UDINT) == 10_000
        assert sub.sdo.read(0x6084, type=UDINT) == 1000
        assert sub.sdo.read(0x6085, type=UDINT) == 4000


def test_a_refused_command_names_its_place(tmp_path: Path) -> None:
    path = servo_file.write(tmp_path, commands=servo_file.command(0x5FFF, "00"))
    with MainDevice(servo_file.segment()) as main:
        main.scan(esi=path)
        plan = main.plan()
        with pytest.raises(SdoAbort, match=r"0x5FFF:00 = 00 \(ESI .*servo\.xml:\d+"):
            main.configure(plan)


def test_a_command_for_the_mode_does_not_override_the_chosen_mode(tmp_path: Path) -> None:
    pdos = servo_file.pdo("RxPdo", 0x1600, "Outputs", servo_file.RX, 'Sm="2"')
    path = servo_file.write(tmp_path, pdos=pdos, commands=servo_file.command(0x6060, "08", "SO"))
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=path)[1]
        plan = main.plan(cat.Drives([sub], counts_per_turn=2**20, mode="csv", velocity_limit=1.0))
        assert plan.devices[1].commands.in_safe_op == ()
        main.configure(plan)
        assert sub.sdo.read(0x6060, type=SINT) == 9


# -- choice of PDOs ----------------------------------------------------------------------------


def choices(folder: Path) -> Path:
    mapping = """<VendorSpecific><TwinCAT><AlternativeSmMapping><Name>Short</Name>
      <Sm No="2"><Pdo>#x1600</Pdo></Sm><Sm No="3"><Pdo>#x1A01</Pdo></Sm>
      </AlternativeSmMapping></TwinCAT></VendorSpecific>"""
    return servo_file.write(folder, pdos=servo_file.choices(), info=mapping)


def test_pdos_by_the_name_of_a_pdo_or_a_mapping(tmp_path: Path) -> None:
    choices(tmp_path)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        for chosen in (["inputs SHORT"], "Short"):
            request = cat.ProcessData(sub, pdos=chosen)
            plan = main.plan(request)
            inputs = plan.devices[1].assignments(Direction.INPUT)
            assert [pdo.index for each in inputs for pdo in each.pdos] == [0x1A01]
        assert "mapping from ESI" in str(plan)
        main.configure(plan)
        assert sub.sdo.read(0x1C13, 1, type=UINT) == 0x1A01


def test_names_that_exclude_each_other_are_refused(tmp_path: Path) -> None:
    path = choices(tmp_path)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        with pytest.raises(MappingError, match="cannot be assigned together") as caught:
            main.plan(cat.ProcessData(sub, inputs={}, pdos=["Inputs", "Inputs short"]))
        place = servo_file.line_of(path, "#x1a01</Index>")
        assert f"0x1A01 'Inputs short' excludes 0x1A00 'Inputs': {place}" in str(caught.value)


def test_an_unknown_name_lists_similar_ones(tmp_path: Path) -> None:
    choices(tmp_path)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        with pytest.raises(MappingError, match="has the name 'Inputs shrt'") as caught:
            cat.ProcessData(sub, pdos=["Inputs shrt"])
        assert "'Inputs short'" in str(caught.value)


# -- objects -----------------------------------------------------------------------------------


def test_types_and_named_values_come_from_the_dictionary_of_the_esi(tmp_path: Path) -> None:
    servo_file.write(tmp_path, profile=servo_file.PROFILE)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        [mode] = [row for row in sub.pdos if row.index == 0x6060]
        assert mode.enumeration == ((8, "CSP"),)
        assert "8 = CSP" in str(sub.pdos)
        known = sub.description.documented_object(0x6065, 0)
        assert known is not None
        assert (known.name, known.data_type) == ("Window", UDINT.index)


def test_objects_of_the_esi_replace_missing_sdo_information(tmp_path: Path) -> None:
    path = servo_file.write(tmp_path, profile=servo_file.PROFILE)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        assert sub.channel is not None
        sub.channel.layout = replace(sub.channel.layout, sdo_information=False)
        assert [each.index for each in sub.sdo.list()] == [0x6060, 0x6065]
        assert [each.index for each in sub.sdo.list(ListType.RXPDO_MAPPABLE)] == [0x6060]
        assert str(path) in sub.sdo.notes[0]
        [entry] = sub.sdo.describe(0x6065).entries
        assert (entry.data_type, entry.bit_length, entry.name) == (UDINT.index, 32, "Window")


def test_start_up_values_take_their_type_from_the_esi(tmp_path: Path) -> None:
    servo_file.write(tmp_path, profile=servo_file.PROFILE)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        assert sub.description.mailbox is not None
        silent = replace(sub.description.mailbox, sdo_information=False)
        sub.description = replace(sub.description, mailbox=silent)
        plan = main.plan(cat.ProcessData(sub, start_up=[cat.StartUp(0x6065, 0, 77)]))
        assert [each.data for each in plan.devices[1].downloads] == [b"M\0\0\0"]
        assert "77 (UDINT)" in str(plan)


def test_a_loop_runs_with_the_commands_and_clocks_of_the_esi(tmp_path: Path) -> None:
    commands = servo_file.command(0x6065, "10270000") + servo_file.command(0x6084, "e8030000", "SO")
    servo_file.write(tmp_path, commands=commands)
    with MainDevice(servo_file.segment()) as main:
        sub = main.scan(esi=tmp_path)[1]
        clock = cat.DistributedClock(op_mode="DC-Synchron")
        data = cat.ProcessData(sub, dc=clock)
        with cat.Loop(data, period=1e-3) as loop:
            for _ in range(10):
                next(loop)
            assert data.present
        assert sub.sdo.read(0x6065, type=UDINT) == 10_000
        assert sub.sdo.read(0x6084, type=UDINT) == 1000


def test_a_user_library_that_cannot_be_read_does_not_prevent_a_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(self: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setenv("CATENARY_ESI", str(tmp_path))
    monkeypatch.setattr(Path, "is_dir", refused)
    with MainDevice(servo_file.segment()) as main:
        assert main.scan()[1].esi is None
        assert any("your library of ESI files is not used" in note for note in main.notes)


def test_a_user_without_a_home_directory_has_no_library(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("CATENARY_ESI", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    with MainDevice(servo_file.segment()) as main:
        assert main.scan()[1].esi is None


def test_a_device_that_left_op_gets_the_commands_for_op_again(tmp_path: Path) -> None:
    servo_file.write(tmp_path, commands=servo_file.command(0x6084, "e8030000", "SO"))
    segment = servo_file.segment()
    with MainDevice(segment) as main:
        sub = main.scan(esi=tmp_path)[1]
        data = cat.ProcessData(sub, required=False)
        with cat.Loop(data, period=1e-3) as loop:
            for _ in range(10):
                next(loop)
            assert sub.channel is not None
            written = main.request(download(sub.channel, 0x6084, 0, bytes(4)))
            while not written.done:
                next(loop)
            segment.core.show_al_status(1, AlState.SAFE_OP | 0x10, 0x001A)
            for _ in range(1000):
                next(loop)
            assert data.present
        assert sub.sdo.read(0x6084, type=UDINT) == 1000
