"""Both ENI files of the shared data, compared with an independent reading by ElementTree."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from catenary.errors import MachineFileError
from catenary.esi.eni import EniDevice, EniFile, read_eni
from catenary.esi.eni.checks import check_commands
from catenary.esi.eni.places import place_variables
from catenary.model.device import Direction

FILES = ("rocos_eni.xml", "murr_VarioX_eni.xml")


@pytest.fixture(params=FILES)
def files(request: pytest.FixtureRequest, shared_data: Path) -> tuple[EniFile, Element]:
    path = shared_data / "eni" / request.param
    config = ElementTree.parse(path).getroot().find("Config")
    assert config is not None
    return read_eni(path), config


def text(element: Element, path: str) -> str:
    found = element.find(path)
    assert found is not None
    return (found.text or "").strip()


def number(element: Element, path: str, default: int = 0) -> int:
    found = element.find(path)
    if found is None:
        return default
    digits = (found.text or "").strip()
    return int(digits[2:], 16) if digits.startswith("#x") else int(digits)


def devices(files: tuple[EniFile, Element]) -> Iterator[tuple[EniDevice, Element]]:
    eni, config = files
    slaves = config.findall("Slave")
    assert len(slaves) == len(eni.devices)
    return zip(eni.devices, slaves, strict=True)


def test_every_element_is_known(files: tuple[EniFile, Element]) -> None:
    eni, _ = files
    assert [each.message for each in eni.warnings if "unknown" in each.message] == []


def test_devices_have_the_identities_of_the_xml(files: tuple[EniFile, Element]) -> None:
    for device, slave in devices(files):
        assert device.name == text(slave, "Info/Name")
        assert device.station_address == number(slave, "Info/PhysAddr")
        assert device.position == (0x10000 - number(slave, "Info/AutoIncAddr")) % 0x10000
        assert device.identity == tuple(
            number(slave, f"Info/{tag}")
            for tag in ("VendorId", "ProductCode", "RevisionNo", "SerialNo")
        )


def test_commands_are_those_of_the_xml(files: tuple[EniFile, Element]) -> None:
    for device, slave in devices(files):
        elements = slave.findall("InitCmds/InitCmd")
        assert len(device.commands) == len(elements) > 0
        for command, element in zip(device.commands, elements, strict=True):
            _same_command(command, element)
    eni, config = files
    elements = config.findall("Master/InitCmds/InitCmd")
    assert len(eni.commands) == len(elements) == 12
    for command, element in zip(eni.commands, elements, strict=True):
        _same_command(command, element)
        assert command.before_slave


def _same_command(command: object, element: Element) -> None:
    from catenary.esi.eni import RegisterCommand

    assert isinstance(command, RegisterCommand)
    assert command.transitions == tuple(each.text for each in element.findall("Transition"))
    assert command.comment == text(element, "Comment")
    assert command.command == number(element, "Cmd")
    assert (command.device, command.offset) == (number(element, "Adp"), number(element, "Ado"))
    data = element.findtext("Data")
    given = bytes(number(element, "DataLength")) if data is None else bytes.fromhex(data)
    assert command.data == given
    assert command.count == (number(element, "Cnt") if element.find("Cnt") is not None else None)
    assert command.retries == number(element, "Retries")
    validate = element.find("Validate")
    assert (command.validation is None) == (validate is None)
    if validate is not None and command.validation is not None:
        assert command.validation.data == bytes.fromhex(text(validate, "Data"))
        mask = validate.findtext("DataMask")
        assert mask is None or command.validation.mask == bytes.fromhex(mask)
        assert round(command.validation.timeout * 1e3) == number(validate, "Timeout")


def test_coe_commands_are_those_of_the_xml(files: tuple[EniFile, Element]) -> None:
    for device, slave in devices(files):
        elements = slave.findall("Mailbox/CoE/InitCmds/InitCmd")
        found = [each.download for each in device.requests if each.download is not None]
        assert len(found) == len(elements)
        for download, element in zip(found, elements, strict=True):
            assert download.index == number(element, "Index")
            assert download.subindex == number(element, "SubIndex")
            assert download.data == bytes.fromhex(text(element, "Data"))
            assert download.complete_access == (element.get("CompleteAccess") == "1")
            assert download.fixed == (element.get("Fixed") == "1")
        others = slave.findall("Mailbox/EoE/InitCmds/InitCmd")
        assert len(device.requests) == len(elements) + len(others)


def test_pdos_are_those_of_the_xml(files: tuple[EniFile, Element]) -> None:
    for device, slave in devices(files):
        elements = [
            each
            for part in slave.findall("ProcessData")
            for each in part
            if each.tag in ("RxPdo", "TxPdo")
        ]
        assert [
            (
                number(each, "Index"),
                [
                    (number(e, "Index"), number(e, "SubIndex"), number(e, "BitLen"))
                    for e in each.findall("Entry")
                ],
            )
            for each in elements
        ] == [
            (pdo.index, [(e.index, e.subindex, e.bit_length) for e in pdo.entries])
            for pdo in device.pdos
        ]
        for manager in device.sync_managers:
            place = f"ProcessData/Sm{manager.index}"
            assert manager.start == number(slave, f"{place}/StartAddress")
            indices = [int(each.text or "") for each in slave.findall(f"{place}/Pdo")]
            assert [pdo.index for pdo in manager.pdos] == indices


def test_every_variable_is_placed_at_the_entry_with_its_name(
    files: tuple[EniFile, Element],
) -> None:
    eni, config = files
    placed = place_variables(eni)
    assert placed.left_out == {}
    elements = [
        (direction, each)
        for tag, direction in (("Inputs", Direction.INPUT), ("Outputs", Direction.OUTPUT))
        for each in config.findall(f"ProcessImage/{tag}/Variable")
    ]
    assert len(placed.placed) == len(elements) >= 10
    for found, (direction, element) in zip(placed.placed, elements, strict=True):
        assert found.variable.name == text(element, "Name")
        assert found.variable.data_type == text(element, "DataType") == found.entry.type
        assert found.variable.bit_length == number(element, "BitSize")
        assert found.variable.bit_offset == number(element, "BitOffs")
        assert found.variable.direction is direction
        assert found.variable.name.endswith(found.entry.name)


def test_mailboxes_clocks_and_ports_are_those_of_the_xml(
    files: tuple[EniFile, Element],
) -> None:
    for device, slave in devices(files):
        box = slave.find("Mailbox")
        assert (device.mailbox is None) == (box is None)
        if box is not None and device.mailbox is not None:
            assert (device.mailbox.send_start, device.mailbox.send_length) == (
                number(box, "Send/Start"),
                number(box, "Send/Length"),
            )
            assert (device.mailbox.receive_start, device.mailbox.receive_length) == (
                number(box, "Recv/Start"),
                number(box, "Recv/Length"),
            )
            protocols = [each.text for each in box.findall("Protocol")]
            assert list(device.mailbox.protocols) == protocols
        assert device.clock is not None
        assert device.clock.reference == bool(number(slave, "DC/ReferenceClock"))
        assert round(device.clock.sync0 * 1e9) == number(slave, "DC/CycleTime0")
        assert round(device.clock.shift * 1e9) == number(slave, "DC/ShiftTime")
        port = slave.find("PreviousPort")
        expected = None if port is None else (number(port, "PhysAddr"), text(port, "Port"))
        assert device.previous == expected


def test_the_image_and_the_cycle_are_those_of_the_xml(files: tuple[EniFile, Element]) -> None:
    eni, config = files
    assert eni.image_sizes == (
        number(config, "ProcessImage/Inputs/ByteSize"),
        number(config, "ProcessImage/Outputs/ByteSize"),
    )
    assert eni.cycle_time == pytest.approx(number(config, "Cyclic/CycleTime") * 1e-6)
    assert [each.command for each in eni.cyclic] == [
        number(each, "Cmd") for each in config.findall("Cyclic/Frame/Cmd")
    ]


def test_the_commands_that_can_be_run(shared_data: Path) -> None:
    check_commands(read_eni(shared_data / "eni" / FILES[0]))
    murr = read_eni(shared_data / "eni" / FILES[1])
    assert murr.encrypted
    with pytest.raises(MachineFileError, match="EoE is not supported"):
        check_commands(murr)
    check_commands(murr, ["EoE"])
