"""Reader of ENI files: values with their lines, and strict refusals."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import pytest

from catenary.errors import MachineFileError
from catenary.esi.eni import Variable, read_eni
from catenary.esi.eni.checks import check_commands
from catenary.esi.eni.clocks import sync_signals
from catenary.esi.eni.own_registers import left_out, vendor_commands
from catenary.esi.eni.places import place_variables
from catenary.esi.eni.settings import with_eni
from catenary.esi.source import Source
from catenary.model.device import Direction
from tests.esi.eni_file import ENI, line_of, write_eni
from tests.plan.devices import servo


def test_a_device_has_identity_addresses_and_memory(tmp_path: Path) -> None:
    [device] = read_eni(write_eni(tmp_path)).devices
    assert (device.name, device.position, device.station_address) == ("Drive", 0, 1001)
    assert device.identity == (0x9A, 198948, 66592, 0)
    assert [(each.index, each.start, each.control) for each in device.sync_managers] == [
        (2, 0x1100, 100),
        (3, 0x1400, 32),
    ]
    assert device.mailbox is not None
    assert (device.mailbox.send_start, device.mailbox.receive_start) == (4096, 4224)


def test_a_command_has_count_retries_and_validation(tmp_path: Path) -> None:
    [device] = read_eni(write_eni(tmp_path)).devices
    check = device.commands[1]
    assert (check.transitions, check.command, check.offset, check.count) == (("PS",), 1, 1040, 1)
    assert check.retries == 3
    assert check.validation is not None
    assert check.validation.timeout == pytest.approx(0.1)
    assert check.validation.accepts(b"\xe8\x03")
    assert not check.validation.accepts(b"\xf8\x03")
    assert not check.validation.accepts(b"\xe8")


def test_coe_commands_keep_complete_access_and_transition(tmp_path: Path) -> None:
    [device] = read_eni(write_eni(tmp_path)).devices
    first, second = (each.download for each in device.requests)
    assert first is not None
    assert second is not None
    assert (first.index, first.subindex, first.data, first.complete_access) == (
        0x2000,
        1,
        b"\x11\x22",
        True,
    )
    assert second.transitions == ("SO",)


def test_a_variable_has_its_place_and_line(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    eni = read_eni(path)
    line = line_of("<Variable><Name>Drive.Inputs.Position")
    assert eni.variables[1] == Variable(
        "Drive.Inputs.Position", Direction.INPUT, "DINT", 32, 32, Source(str(path), line)
    )
    placed = place_variables(eni)
    assert [(each.entry.index, each.pdo) for each in placed.placed] == [
        (0x6041, 0x1A00),
        (0x6064, 0x1A00),
        (0x6040, 0x1600),
        (0x607A, 0x1600),
    ]
    assert "not process data" in placed.left_out["Drive.WcState"]


def test_a_variable_over_several_entries_is_left_out(tmp_path: Path) -> None:
    eni = read_eni(write_eni(tmp_path, ("<BitSize>32</BitSize>", "<BitSize>24</BitSize>")))
    assert "bits 32 to 55" in place_variables(eni).left_out["Drive.Inputs.Position"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<BitLength>48", "<BitLength>64", "Drive: 64 bits of outputs, but its PDOs have 48"),
        ("<ByteSize>6", "<ByteSize>5", "'Drive.Outputs.Target' ends after the 5 bytes of the"),
        ("<BitOffs>72", "<BitOffs>79", ""),
        ("<BitOffs>72", "<BitOffs>80", "'Drive.WcState' ends after the 10 bytes of the inputs"),
    ],
)
def test_sizes_that_contradict_each_other_are_warnings(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    warnings = read_eni(write_eni(tmp_path, (old, new))).warnings
    assert len(warnings) == bool(message)
    assert all(message in str(each) for each in warnings)


def test_clocks_come_from_the_commands(tmp_path: Path) -> None:
    [device] = read_eni(write_eni(tmp_path)).devices
    found = sync_signals(device)
    assert found is not None
    assert found.assign_activate == 0x0300
    assert (found.sync0, found.sync1, found.shift) == pytest.approx((2e-3, 0, 250e-6))


def test_the_activation_can_be_written_as_one_byte(tmp_path: Path) -> None:
    path = write_eni(tmp_path, ("<Ado>2432</Ado><Data>0003", "<Ado>2433</Ado><Data>07"))
    found = sync_signals(read_eni(path).devices[0])
    assert found is not None
    assert found.assign_activate == 0x0700


def test_timeouts_come_from_the_commands_and_are_bounded(tmp_path: Path) -> None:
    path = write_eni(
        tmp_path,
        ("<Comment>ramp</Comment><Timeout>0<", "<Comment>ramp</Comment><Timeout>9000<"),
        ("<Ado>3968</Ado><Data>01", "<Ado>288</Ado><Timeout>600000</Timeout><Data>0400"),
        ("<Transition>OI</Transition>", "<Transition>PS</Transition>"),
    )
    eni = read_eni(path)
    found = with_eni(replace(servo(0), identity=eni.devices[0].identity), eni).timeouts
    assert (found.pre_op, found.safe_op_and_op, found.mailbox_response) == (None, 60.0, 9.0)


def test_only_commands_to_other_registers_are_run(tmp_path: Path) -> None:
    eni = read_eni(write_eni(tmp_path))
    check_commands(eni)
    assert [each.offset for each in vendor_commands(eni.devices[0])] == [0x0410, 0x0410]
    [note] = left_out(eni)
    assert "0x0F80 (farewell) is not sent at OI" in note


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<VendorId>#x9a", "<VendorId>abc", r"Info 'Drive'/VendorId: 'abc' is not a number"),
        ("<VendorId>#x9a", "<VendorId>#x1FFFFFFFF", "does not fit into 32 bits"),
        ("<VendorId>#x9a</VendorId>", "", "Info has no VendorId"),
        ("<Name>Drive</Name>", "<Name> </Name>", "Info has no Name"),
        ("<Type>Outputs", "<Type>Sideways", "Type: 'Sideways' is neither"),
        ("<Pdo>5632", "<Pdo>5633", "PDO 0x1601 is not described"),
        ("<Pdo>5632</Pdo>", "<Pdo>5632</Pdo><Pdo>5632</Pdo>", "PDO 0x1600 is assigned twice"),
        ("<BitStart>0", "<BitStart>-1", "'-1' does not fit"),
        ("PS</Transition><Comment>set sm 2", "XX</Transition><Comment>set sm 2",
         "InitCmd 'set sm 2'/Transition: 'XX' is not a transition"),
        ("<Transition>IP</Transition><Comment>PDI", "<Comment>PDI", "InitCmd has no Transition"),
        ("<Data>ea03", "<Data>e8zz", "'e8zz' is not hexadecimal data"),
        ("<Data>ea03", "<Data>e80", "'e80' is not hexadecimal data"),
        ("<Data>ea03", "<Data>eax03", "'eax03' is not hexadecimal data"),
        ("<Data>ea03</Data>", "<DataLength>9999</DataLength>", "9999 bytes; at most 1486"),
        ("<Data>ea03</Data>", "<Data></Data>", "0 bytes of data"),
        ("<DataMask>f0ff", "<DataMask>f0", "2 bytes of Data and 1 of DataMask"),
        ("<Data>e003</Data>", "", "Validate has no Data"),
        ("<Cmd>5</Cmd>", "<Cmd>77</Cmd>", "77 is not a command of EtherCAT"),
        ("<Data>1122</Data>", "", "InitCmd 'ramp': a download has no Data"),
        ("<Timeout>100<", "<Timeout>600001<", "Validate/Timeout: 600001 ms; at most 600000"),
        ("<AutoIncAddr>0", "<AutoIncAddr>65534", "position 2, expected 0"),
        ("<CycleTime>2000<", "<CycleTime>0<", "the cycle time is 0"),
        ("<BitSize>16", "<BitSize>1e3", "is not a number"),
        ("<DC>", "<HotConnect/><DC>", "hot-connect groups are not supported"),
        ("<EtherCATConfig Version", "<EtherCATInfo Version", "not well-formed"),
    ],
)  # fmt: skip
def test_faulty_content_is_refused_with_line_and_element(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = write_eni(tmp_path, (old, new))
    with pytest.raises(MachineFileError, match=message) as caught:
        read_eni(path)
    assert caught.value.path == str(path)
    assert caught.value.line is not None
    assert caught.value.line > 1 or "Config" in message


def test_the_line_is_that_of_the_element(tmp_path: Path) -> None:
    path = write_eni(tmp_path, ("<DataMask>f0ff", "<DataMask>f0"))
    with pytest.raises(MachineFileError) as caught:
        read_eni(path)
    assert caught.value.line == line_of("<Validate>")


def test_another_root_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "device.xml"
    path.write_text("<EtherCATInfo><Vendor/></EtherCATInfo>")
    with pytest.raises(MachineFileError, match="root is EtherCATInfo") as caught:
        read_eni(path)
    assert "ESI" in caught.value.hint


def test_a_document_type_and_entities_are_refused(tmp_path: Path) -> None:
    path = write_eni(tmp_path, ('<?xml version="1.0"?>', '<!DOCTYPE a [<!ENTITY b "cccc">]>'))
    with pytest.raises(MachineFileError, match="document type is not allowed"):
        read_eni(path)


def test_files_that_are_no_xml_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.xml"
    for content in (b"", b"\0\1\2", gzip.compress(ENI.encode()), ENI.encode()[:-200]):
        path.write_bytes(content)
        with pytest.raises(MachineFileError, match=r"bus\.xml"):
            read_eni(path)
    with pytest.raises(MachineFileError, match="cannot be read"):
        read_eni(tmp_path / "absent.xml")
    with pytest.raises(MachineFileError, match="cannot be read"):
        read_eni(tmp_path)


def test_a_huge_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bus.xml"
    with path.open("wb") as stream:
        stream.truncate(65 << 20)
    with pytest.raises(MachineFileError, match="the limit is"):
        read_eni(path)


def test_too_many_elements_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.xml"
    path.write_text(f"<EtherCATConfig><Config>{'<Slave/>' * 100_001}</Config></EtherCATConfig>")
    with pytest.raises(MachineFileError, match="more than 100000 children"):
        read_eni(path)


def test_an_unknown_element_is_a_warning(tmp_path: Path) -> None:
    eni = read_eni(write_eni(tmp_path, ("<DC>", "<Colour>red</Colour><DC>")))
    [warning] = eni.warnings
    assert warning.message == "unknown element Config/Slave/Colour; ignored"


def encrypted(folder: Path, *replacements: tuple[str, str]) -> Path:
    """Write the file with an encrypted root."""
    path = write_eni(folder, *replacements)
    text = path.read_text().replace("EtherCATConfig", "EncryptedEtherCATConfig")
    path.write_text(text)
    return path


def test_an_encrypted_file_with_plain_content_is_read_with_a_warning(tmp_path: Path) -> None:
    eni = read_eni(encrypted(tmp_path))
    assert eni.encrypted
    assert "the content is plain" in eni.warnings[0].message


def test_scrambled_content_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MachineFileError, match="is not a number") as caught:
        read_eni(encrypted(tmp_path, ("<VendorId>#x9a", "<VendorId>q7!k")))
    assert "may be scrambled" in caught.value.hint
    path = tmp_path / "bus.xml"
    path.write_text("<EncryptedEtherCATConfig>aGVsbG8=</EncryptedEtherCATConfig>")
    with pytest.raises(MachineFileError, match="the content is encrypted"):
        read_eni(path)


def test_register_commands_of_an_encrypted_file_are_refused(tmp_path: Path) -> None:
    eni = read_eni(encrypted(tmp_path))
    with pytest.raises(MachineFileError, match="may be scrambled") as caught:
        check_commands(eni)
    assert caught.value.line == line_of("<InitCmd>", after="</Mailbox>")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<Ado>304", "<Ado>3968", "commands of the MainDevice to other registers"),
        ("PDI watchdog</Comment><Cmd>5", "PDI watchdog</Comment><Cmd>6", "FPRW is not supported"),
        ("<Adp>1001</Adp>\n     <Ado>1040", "<Adp>1002</Adp>\n     <Ado>1040",
         "Adp is 1002, but this device has 1001"),
        ("<Ado>1040</Ado><Data>ea03</Data>", "<Ado>1052</Ado><DataLength>8</DataLength>",
         "registers of the bring-up together with others: the plan sets the watchdog"),
        ("<Cmd>5</Cmd><Adp>1001</Adp>\n     <Ado>1040</Ado>",
         "<Cmd>11</Cmd><Addr>#x08000000</Addr>", "LWR is not supported"),
        ("<Ccs>1", "<Ccs>2", "Ccs 2 is not supported"),
        ("</CoE>", "</CoE><SoE><InitCmds><InitCmd><Transition>PS</Transition><OpCode>1</OpCode>"
         "<IDN>32796</IDN><Data>01</Data></InitCmd></InitCmds></SoE>",
         "P-0-0028 of drive 0: OpCode 1 is not supported"),
        ("</CoE>", "</CoE><SoE><InitCmds><InitCmd><Transition>PS</Transition><OpCode>3</OpCode>"
         "<Elements>3</Elements><IDN>2</IDN><Data>01</Data></InitCmd></InitCmds></SoE>",
         "S-0-0002 of drive 0: Elements 0x03 is not supported"),
        ("</CoE>", "</CoE><SoE><InitCmds><InitCmd><Transition>PS</Transition><OpCode>3</OpCode>"
         "<DriveNo>8</DriveNo><IDN>2</IDN><Data>01</Data></InitCmd></InitCmds></SoE>",
         "DriveNo 8 is out of range"),
    ],
)  # fmt: skip
def test_commands_that_cannot_be_run_are_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    eni = read_eni(write_eni(tmp_path, (old, new)))
    with pytest.raises(MachineFileError, match=message) as caught:
        check_commands(eni)
    assert caught.value.line


def test_soe_commands_are_read_for_their_transitions(tmp_path: Path) -> None:
    soe = (
        "</CoE><SoE><InitCmds><InitCmd><Transition>PS</Transition><OpCode>3</OpCode><DriveNo>1"
        "</DriveNo><IDN>32796</IDN><Data>0102</Data></InitCmd><InitCmd><Transition>SO</Transition>"
        "<OpCode>3</OpCode><IDN>2</IDN><Data>e803</Data><Disabled>1</Disabled></InitCmd>"
        "</InitCmds></SoE>"
    )
    eni = read_eni(write_eni(tmp_path, ("</CoE>", soe)))
    check_commands(eni)
    [device] = [each for each in eni.devices if any(r.idn is not None for r in each.requests)]
    found = replace(servo(device.position), identity=device.identity)
    [command] = with_eni(found, eni).idn_commands
    assert (command.transitions, command.number, command.drive) == (("PS",), 32796, 1)
    assert (command.data, command.element) == (b"\x01\x02", 0x40)
    assert with_eni(found, eni, ["SoE"]).idn_commands == ()


def test_protocols_can_be_left_out(tmp_path: Path) -> None:
    soe = (
        "</CoE><EoE><InitCmds><InitCmd><Transition>IP</Transition><Data>02</Data></InitCmd>"
        "</InitCmds></EoE>"
    )
    eni = read_eni(write_eni(tmp_path, ("</CoE>", soe)))
    check_commands(eni, ["EoE"])
    assert any("EoE command is left out" in note for note in left_out(eni, ["EoE"]))
    with pytest.raises(ValueError, match="choose from EoE"):
        check_commands(eni, ["CoE"])
