"""`catenary init bus.xml`: the machine file of an ENI can be read and run."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.cli.main import main
from catenary.esi.eni import read_eni
from catenary.machine import read_machine
from catenary.model.device import Direction
from tests.esi.eni_file import write_eni
from tests.machine.eni_bus import segment_of

OP = 8
COUNTS = "# counts_per_turn = 0 "


def test_a_drive_becomes_an_axis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "machine.toml"
    path = write_eni(tmp_path)
    assert main(["init", str(path), "-o", str(output)]) == 0
    printed = capsys.readouterr()
    assert "FILL IN" in printed.out
    assert "register 0x0410 to 0x0411 (PDI watchdog) = ea 03 is not converted" in printed.err
    assert "a machine file has no commands at SO" in printed.err
    assert main(["init", str(path), "-o", str(output)]) == 2
    text = output.read_text()
    assert COUNTS in text
    output.write_text(text.replace(COUNTS, "counts_per_turn = 65536 "))
    tables = read_machine(output).tables
    assert isinstance(tables.drives["axes"].pdos, dict)
    assert list(tables.drives["axes"].pdos) == ["0x1600", "0x1A00"]
    assert tables.clocks.reference == "drive"
    segment = segment_of(read_eni(path))
    with pytest.warns(UserWarning, match="no velocity_limit"):
        machine = cat.Machine(output, target=segment).open()
    with machine, machine.loop(enable=False) as loop:
        next(loop)
        assert segment[0].state == OP
        assert loop.plan.cycle.period_ns == 2_000_000
        [device] = loop.plan.devices
        assert device.sync is not None
        assert (device.sync.assign_activate, device.sync.shift_ns) == (0x0300, 250_000)
        assert segment[0].read_object(0x2000, 1) == b"\x11\x22"


def test_the_file_has_the_mapping_and_the_times_of_the_eni(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    segment = segment_of(read_eni(write_eni(tmp_path)))
    watchdog = (
        "<InitCmd><Transition>IP</Transition><Cmd>5</Cmd><Adp>1001</Adp><Ado>1056</Ado>"
        "<Data>1027</Data></InitCmd>"
    )
    gap = "<Entry><Index>0</Index><BitLen>8</BitLen></Entry>"
    path = write_eni(
        tmp_path,
        ("<Entry><Index>#x607a", f"{gap}<Entry><Index>#x607a"),
        ("<ShiftTime>250000", "<ShiftTime>-1234567"),
        ("</Mailbox>\n   <InitCmds>", f"</Mailbox>\n   <InitCmds>{watchdog}"),
    )
    output = tmp_path / "machine.toml"
    assert main(["init", str(path), "-o", str(output)]) == 0
    notes = capsys.readouterr().err
    assert "Drive: the watchdog time is not converted" in notes
    assert "the command at OI to register 0x0F80 (farewell) = 01 is not converted" in notes
    output.write_text(output.read_text().replace(COUNTS, "counts_per_turn = 65536 "))
    with pytest.warns(UserWarning, match="no velocity_limit"):
        machine = cat.Machine(output, target=segment).open()
    with machine:
        [device] = machine.main.plan(*machine.requests, period=2e-3).devices
        [pdo] = device.assignments(Direction.OUTPUT)[0].pdos
        assert [(each.index, each.bit_length) for each in pdo.entries] == [
            (0x6040, 16),
            (0, 8),
            (0x607A, 32),
        ]
        assert device.sync is not None
        assert device.sync.shift_ns == -1_234_567


def test_entries_without_a_variable_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gap = "<Entry><Index>0</Index><BitLen>8</BitLen></Entry></TxPdo>"
    path = write_eni(tmp_path, ("#x6040", "#x7040"), ("</TxPdo>", gap))
    assert main(["init", str(path), "-o", str(tmp_path / "machine.toml")]) == 0
    assert "the entries of PDO 0x1A00 are not converted" in capsys.readouterr().err


def test_io_becomes_process_data_with_start_up_objects(shared_data: Path, tmp_path: Path) -> None:
    path = shared_data / "eni" / "murr_VarioX_eni.xml"
    output = tmp_path / "machine.toml"
    assert main(["init", str(path), "-o", str(output)]) == 0
    eni = read_eni(path)
    tables = read_machine(output).tables
    assert [each.identity.product for each in tables.device] == [0x9AF9C5, 0xD568]
    downloads = [each.download for each in eni.devices[1].requests if each.download is not None]
    written = [each for each in downloads if not 0x1600 <= each.index < 0x1D00]
    assert len(tables.device[1].start_up) == len(written) == 86
    [data] = tables.process_data.values()
    assert isinstance(data.inputs, dict)
    assert isinstance(data.outputs, dict)
    assert len(data.inputs) + len(data.outputs) == 334
    segment = segment_of(eni)
    with cat.Machine(output, target=segment) as machine, machine.loop() as loop:
        for _ in range(3):
            next(loop)
        assert [device.state for device in segment] == [OP, OP]
        for each in written:
            assert segment[1].read_object(each.index, each.subindex) == each.data


def test_a_faulty_file_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_eni(tmp_path, ("<VendorId>#x9a", "<VendorId>vendor"))
    assert main(["init", str(path), "-o", str(tmp_path / "machine.toml")]) == 1
    assert "VendorId: 'vendor' is not a number" in capsys.readouterr().err
    assert not (tmp_path / "machine.toml").exists()
