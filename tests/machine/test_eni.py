"""Machine from an ENI, on virtual devices of its content."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import catenary as cat
from catenary.errors import (
    ConfigurationError,
    MachineFileError,
    SdoAbort,
)
from catenary.esi.eni import read_eni
from tests.esi.eni_file import write_eni
from tests.machine.eni_bus import segment_of

OP = 8
PDI_WATCHDOG = 0x0410
CYCLES = 5


def run(loop: cat.Loop, cycles: int = CYCLES) -> None:
    for _ in range(cycles):
        next(loop)


def test_variables_have_names_types_and_offsets(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    segment = segment_of(read_eni(path))
    with cat.Machine(path, target=segment) as machine:
        variables = machine.variables
        assert len(variables) == 4
        described = variables.describe("Drive.Inputs.Position")
        assert (described.data_type, described.bit_length, described.bit_offset) == ("DINT", 32, 32)
        with machine.loop() as loop:
            variables["Drive.Outputs.Target"] = -5
            segment[0].write_object(0x6064, 0, b"\xfe\xff\xff\xff")
            run(loop)
            assert segment[0].state == OP
            assert segment[0].read_object(0x607A) == b"\xfb\xff\xff\xff"
            assert variables["Drive.Inputs.Position"] == -2
            assert machine.process_data["Drive"]["Inputs.Position"] == -2
            raw = np.frombuffer(machine.process_data["Drive"].inputs, np.uint8)
            assert bytes(raw[2:6]) == b"\xfe\xff\xff\xff"
            assert loop.plan.cycle.period_ns == 2_000_000
        with pytest.raises(KeyError, match="not process data of a device"):
            variables["Drive.WcState"]
        with pytest.raises(KeyError, match=r'did you mean "Drive.Outputs.Target"'):
            variables["Drive.Output.Target"]
        with pytest.raises(TypeError, match="read-only"):
            variables["Drive.Inputs.Position"] = 1


def test_commands_run_at_their_transitions(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    segment = segment_of(read_eni(path))
    with cat.Machine(path, target=segment) as machine:
        drive = segment[0]
        assert drive.core.peek(0, PDI_WATCHDOG, 2) == b"\xea\x03"  # IP
        assert drive.read_object(0x2000, 1) == bytes(2)
        plan = str(machine.main.plan(*machine.requests, period=2e-3))
        assert "PS  0x0410 to 0x0411 (check PDI watchdog) read" in plan
        with machine.loop():
            assert drive.read_object(0x2000, 1) == b"\x11\x22"
            assert drive.read_object(0x2100) == b"\x05"


def test_a_failed_validation_names_command_and_value(tmp_path: Path) -> None:
    path = write_eni(tmp_path, ("<Data>e003</Data>", "<Data>0005</Data>"))
    segment = segment_of(read_eni(path))
    with (
        cat.Machine(path, target=segment) as machine,
        pytest.raises(ConfigurationError, match="expected 00 05 under mask f0 ff, read ea 03") as e,
        machine.loop(),
    ):
        pass
    assert "check PDI watchdog" in e.value.message


def test_a_wrong_working_counter_is_an_error(tmp_path: Path) -> None:
    path = write_eni(tmp_path, ("<Data>ea03</Data><Cnt>1</Cnt>", "<Data>ea03</Data><Cnt>2</Cnt>"))
    with (
        pytest.raises(ConfigurationError, match="expected working counter 2, received 1"),
        cat.Machine(path, target=segment_of(read_eni(path))),
    ):
        pass


def test_clocks_and_reference_are_those_of_the_file(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    with cat.Machine(path, target=segment_of(read_eni(path))) as machine, machine.loop() as loop:
        [device] = loop.plan.devices
        assert device.sync is not None
        assert device.sync.assign_activate == 0x0300
        assert (device.sync.cycle_ns, device.sync.shift_ns) == (2_000_000, 250_000)
        assert loop.plan.cycle.clock is not None
        assert loop.plan.cycle.clock.reference == 0


def test_notes_name_what_differs_from_the_plan(tmp_path: Path) -> None:
    segment = segment_of(read_eni(write_eni(tmp_path)))
    path = write_eni(
        tmp_path,
        ("<Data>0011060064000100", "<Data>0012060064000100"),
        ("<RevisionNo>66592", "<RevisionNo>66593"),
    )
    with cat.Machine(path, target=segment) as machine:
        notes = "\n".join(machine.notes)
        assert "SyncManager 2: the ENI has 0x1200 + 6, control 0x64, the plan 0x1100 + 6" in notes
        assert "the ENI has revision 0x00010421, the device 0x00010420" in notes
        assert "0x0F80 (farewell) is not sent at OI" in notes
        assert "clock" not in notes


def test_a_clock_that_no_command_starts_is_a_note(tmp_path: Path) -> None:
    path = write_eni(tmp_path, ("<Ado>2432</Ado><Data>0003", "<Ado>2432</Ado><Data>0000"))
    with cat.Machine(path, target=segment_of(read_eni(path))) as machine:
        assert any("DC/CycleTime0 has no effect" in note for note in machine.notes)


def test_an_output_is_not_written_by_its_command(tmp_path: Path) -> None:
    """The process data is 0 until the application writes it, so a command has no lasting effect."""
    path = write_eni(
        tmp_path,
        ("<Index>#x6040</Index>", "<Index>#x6060</Index>"),
        ("<Index>8448</Index>", "<Index>24672</Index>"),
        ("<Data>05</Data>", "<Data>0800</Data>"),
        ("<Transition>SO</Transition><Comment>late", "<Transition>PS</Transition><Comment>late"),
    )
    segment = segment_of(read_eni(path))
    with cat.Machine(path, target=segment) as machine:
        [note] = [each for each in machine.notes if "0x6060:00" in each]
        assert "the process data writes this output in each cycle; set it to 08 00 there" in note
        with machine.loop() as loop:
            run(loop)
            assert segment[0].read_object(0x6060) == b"\0\0"
            machine.variables["Drive.Outputs.Control word"] = 8
            run(loop)
            assert segment[0].read_object(0x6060) == b"\x08\0"


def test_the_watchdog_is_that_of_the_file(tmp_path: Path) -> None:
    command = (
        "<InitCmd><Transition>IP</Transition><Cmd>5</Cmd><Adp>1001</Adp><Ado>1056</Ado>"
        "<Data>1027</Data></InitCmd>"
    )
    path = write_eni(tmp_path, ("</Mailbox>\n   <InitCmds>", f"</Mailbox>\n   <InitCmds>{command}"))
    with cat.Machine(path, target=segment_of(read_eni(path))) as machine:
        plan = machine.main.plan(*machine.requests, period=2e-3)
        assert plan.devices[0].watchdog_ns == 1_000_000_000
        assert "watchdog 1000 ms (ENI)" in str(plan)
        assert not any("watchdog:" in note for note in machine.notes)


def test_an_eni_needs_a_target(tmp_path: Path) -> None:
    with pytest.raises(MachineFileError, match="names no network interface") as caught:
        cat.Machine(write_eni(tmp_path))
    assert 'target="eth0"' in caught.value.hint


def test_without_is_only_for_an_eni(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text('format = "catenary-machine/1"\ntarget = "virtual"\n')
    with pytest.raises(ValueError, match="only for an ENI"):
        cat.Machine(path, without=["EoE"])
    with pytest.raises(ValueError, match="choose from"):
        cat.Machine(write_eni(tmp_path), target="virtual", without="CoE")


def test_commands_run_again_when_a_device_returns(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    segment = segment_of(read_eni(path))
    with cat.Machine(path, target=segment) as machine:
        data = cat.ProcessData(machine.subs["Drive"], required=False)
        with cat.Loop(data, period=2e-3) as loop:
            run(loop)
            segment.switch_power(0, False)
            run(loop, 200)
            segment.switch_power(0, True)
            assert segment[0].core.peek(0, PDI_WATCHDOG, 2) != b"\xea\x03"
            for cycle in loop:
                if segment[0].state == OP or cycle.number > 5000:
                    break
            assert segment[0].state == OP
            assert segment[0].core.peek(0, PDI_WATCHDOG, 2) == b"\xea\x03"
            assert segment[0].read_object(0x2000, 1) == b"\x11\x22"


@pytest.mark.parametrize(
    ("name", "without", "count"), [("rocos_eni.xml", (), 10), ("murr_VarioX_eni.xml", ["EoE"], 334)]
)
def test_shared_files_run_on_devices_of_their_content(
    shared_data: Path, name: str, without: list[str], count: int
) -> None:
    path = shared_data / "eni" / name
    eni = read_eni(path)
    segment = segment_of(eni)
    names = [
        (tag, each.findtext("Name"), int(each.findtext("BitSize") or 0))
        for tag in ("Outputs", "Inputs")
        for each in ElementTree.parse(path).getroot().findall(f"Config/ProcessImage/{tag}/Variable")
    ]
    outputs = {each: bits for tag, each, bits in names if tag == "Outputs" and each is not None}
    with cat.Machine(path, target=segment, without=without) as machine:
        assert set(machine.variables) == {each for _, each, _ in names}
        assert len(machine.variables) == count
        with machine.loop() as loop:
            values = {each: 1 + k % 100 for k, each in enumerate(outputs)}
            for each, value in values.items():
                machine.variables[each] = value
            run(loop)
            assert [device.state for device in segment] == [OP] * len(eni.devices)
            image = bytes(next(iter(machine.process_data.values())).outputs)
            for variable in eni.variables:
                if variable.name in values:
                    bits = int.from_bytes(image, "little") >> variable.bit_offset
                    assert bits & ((1 << variable.bit_length) - 1) == values[variable.name]
        for device in eni.devices:
            for request in device.requests:
                command = request.download
                if command is None or 0x1600 <= command.index < 0x1D00 or command.index == 0x6060:
                    continue
                found = segment[device.position].read_object(command.index, command.subindex)
                assert found == command.data


def test_scrambled_fmmus_of_an_encrypted_file_are_reported(shared_data: Path) -> None:
    path = shared_data / "eni" / "murr_VarioX_eni.xml"
    with cat.Machine(path, target=segment_of(read_eni(path)), without=["EoE"]) as machine:
        notes = "\n".join(machine.notes)
    assert "the content is plain" in notes
    assert "is not that of an FMMU, so it is scrambled; the plan sets the FMMUs" in notes
    assert "SyncManager" not in notes


def test_a_refused_object_is_named_with_its_command(tmp_path: Path) -> None:
    segment = segment_of(read_eni(write_eni(tmp_path)))
    path = write_eni(tmp_path, ("<Index>8448</Index>", "<Index>8449</Index>"))
    with (
        pytest.raises(SdoAbort, match=r"0x2101:00 = 05 \(ENI .*bus\.xml:\d+ late\)"),
        cat.Machine(path, target=segment) as machine,
        machine.loop(),
    ):
        pass


def test_a_variable_has_the_place_of_its_own_pdo(tmp_path: Path) -> None:
    """The same object is in two PDOs."""
    pdo = (
        '<TxPdo Sm="3"><Index>#x1a01</Index><Name>Second</Name><Entry><Index>#x6041</Index>'
        "<SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Status word</Name>"
        "<DataType>UINT</DataType></Entry></TxPdo></ProcessData>"
    )
    variable = (
        "<Variable><Name>Drive.Second.Status word</Name><DataType>UINT</DataType>"
        "<BitSize>16</BitSize><BitOffs>64</BitOffs></Variable></Inputs>"
    )
    path = write_eni(
        tmp_path,
        ("</ProcessData>", pdo),
        ("</Inputs>", variable),
        ("<Pdo>6656</Pdo>", "<Pdo>6656</Pdo><Pdo>6657</Pdo>"),
        ("<BitStart>16</BitStart><BitLength>48", "<BitStart>16</BitStart><BitLength>64"),
    )
    with (
        cat.Machine(path, target=segment_of(read_eni(path))) as machine,
        machine.loop() as loop,
    ):
        bits = {each.name: each.number.bit_offset for each in loop.plan.cycle.input_columns}
        assert bits["Second.Status word"] - bits["Inputs.Status word"] == 48
        assert machine.variables["Drive.Second.Status word"] == 0
