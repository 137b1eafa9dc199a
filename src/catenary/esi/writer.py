"""ESI file (ETG.2000) of one device, from what the device itself reports.

The file contains identity, SyncManagers, FMMUs, PDOs, mailbox, clock modes and EEPROM. It has no
object dictionary. Texts of the vendor, such as units, are not in the device.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from catenary.esi.mailbox import PROTOCOLS
from catenary.model.device import DeviceDescription, Direction, MailboxLayout, OpMode, SyncManager
from catenary.model.process_data import Entry, Pdo
from catenary.types import by_index
from catenary.wire.sii import Sii
from catenary.wire.sii_categories import FmmuUse, SyncManagerUse

VERSION = "1.6"
USES = {
    SyncManagerUse.MAILBOX_OUT: "MBoxOut",
    SyncManagerUse.MAILBOX_IN: "MBoxIn",
    SyncManagerUse.OUTPUTS: "Outputs",
    SyncManagerUse.INPUTS: "Inputs",
}
FMMUS = {FmmuUse.OUTPUTS: "Outputs", FmmuUse.INPUTS: "Inputs", FmmuUse.MAILBOX_STATE: "MBoxState"}
TAGS = {Direction.OUTPUT: "RxPdo", Direction.INPUT: "TxPdo"}
TYPES = {1: "BOOL", 8: "USINT", 16: "UINT", 32: "UDINT", 64: "ULINT"}  # of unknown types, by bits
CONFIG_BYTES, BOOTSTRAP = 14, slice(0x28, 0x30)  # of the EEPROM: words 0 to 6, 0x14 to 0x17
FIRST_PRINTABLE = " "

Element = ElementTree.Element


def esi_text(device: DeviceDescription, sii: Sii, image: bytes) -> str:
    """Return the ESI file of a device as text.

    Args:
        device: Description of the device.
        sii: Decoded EEPROM.
        image: EEPROM as read.
    """
    root = Element("EtherCATInfo", Version=VERSION)
    vendor = ElementTree.SubElement(root, "Vendor")
    _add(vendor, "Id", _number(device.identity.vendor))
    _add(vendor, "Name", f"vendor 0x{device.identity.vendor:08X}")
    descriptions = ElementTree.SubElement(root, "Descriptions")
    group = ElementTree.SubElement(ElementTree.SubElement(descriptions, "Groups"), "Group")
    _add(group, "Type", device.group or "Devices")
    _add(group, "Name", device.group or "Devices")
    devices = ElementTree.SubElement(descriptions, "Devices")
    devices.append(_device(device, sii, image))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'


def _device(device: DeviceDescription, sii: Sii, image: bytes) -> Element:
    element = Element("Device", Physics=_physics(device))
    identity = device.identity
    numbers = {"ProductCode": identity.product, "RevisionNo": identity.revision}
    kind = {name: _number(value) for name, value in numbers.items()}
    _add(element, "Type", device.order or f"0x{identity.product:08X}", **kind)
    _add(element, "Name", device.name)
    _add(element, "GroupType", device.group or "Devices")
    for use in sii.fmmus:
        if use in FMMUS:
            _add(element, "Fmmu", FMMUS[FmmuUse(use)])
    element.extend(_sync_manager(each) for each in device.sync_managers)
    for direction, pdos in _pdos(device):
        element.extend(_pdo(direction, each) for each in pdos)
    if device.mailbox is not None:
        element.append(_mailbox(device.mailbox))
    if device.op_modes:
        clocks = ElementTree.SubElement(element, "Dc")
        clocks.extend(_op_mode(each) for each in device.op_modes)
    eeprom = ElementTree.SubElement(element, "Eeprom")
    _add(eeprom, "ByteSize", str(len(image)))
    _add(eeprom, "ConfigData", image[:CONFIG_BYTES].hex().upper())
    if any(image[BOOTSTRAP]):
        _add(eeprom, "BootStrap", image[BOOTSTRAP].hex().upper())
    return element


def _pdos(device: DeviceDescription) -> Iterable[tuple[Direction, tuple[Pdo, ...]]]:
    return (Direction.OUTPUT, device.output_pdos), (Direction.INPUT, device.input_pdos)


def _physics(device: DeviceDescription) -> str:
    """Return a letter for each port. The device does not report the kind of its ports."""
    last = max((n for n, is_open in enumerate(device.open_ports) if is_open), default=0)
    return "Y" * max(last + 1, 2)


def _sync_manager(manager: SyncManager) -> Element:
    element = Element(
        "Sm",
        DefaultSize=str(manager.length),
        StartAddress=_number(manager.start),
        ControlByte=_number(manager.control),
        Enable=str(int(manager.enabled)),
    )
    element.text = USES.get(manager.use, "Outputs")
    return element


def _pdo(direction: Direction, pdo: Pdo) -> Element:
    flags = {"Fixed": pdo.fixed, "Mandatory": pdo.mandatory}
    attributes = {name: "1" for name, value in flags.items() if value}
    if pdo.sync_manager is not None:
        attributes["Sm"] = str(pdo.sync_manager)
    element = Element(TAGS[direction], attributes)
    _add(element, "Index", _number(pdo.index))
    _add(element, "Name", pdo.name or f"PDO 0x{pdo.index:04X}")
    for excluded in sorted(pdo.excludes):
        _add(element, "Exclude", _number(excluded))
    element.extend(map(_entry, pdo.entries))
    return element


def _entry(entry: Entry) -> Element:
    element = Element("Entry")
    _add(element, "Index", _number(entry.index))
    if entry.index:
        _add(element, "SubIndex", str(entry.subindex))
    _add(element, "BitLen", str(entry.bit_length))
    if entry.index:
        _add(element, "Name", entry.name or f"0x{entry.index:04X}:{entry.subindex:02X}")
        _add(element, "DataType", _type(entry))
    return element


def _type(entry: Entry) -> str:
    """Return the name of the data type; for an unknown one, a type of the same length."""
    try:
        name = by_index(entry.data_type).name
    except ValueError:
        name = ""
    if name:
        return name
    bits = entry.bit_length
    return TYPES.get(bits) or (f"BIT{bits}" if bits < 8 else f"ARRAY [0..{bits // 8 - 1}] OF BYTE")


def _mailbox(mailbox: MailboxLayout) -> Element:
    element = Element("Mailbox", DataLinkLayer="1")
    flags = {
        "SdoInfo": mailbox.sdo_information,
        "PdoAssign": mailbox.pdo_assign,
        "PdoConfig": mailbox.pdo_configuration,
        "CompleteAccess": mailbox.complete_access,
    }
    for tag, protocol in PROTOCOLS.items():
        if protocol in mailbox.protocols:
            given = {name: str(int(value)) for name, value in flags.items() if value}
            element.append(Element(tag, given if tag == "CoE" else {}))
    return element


def _op_mode(mode: OpMode) -> Element:
    element = Element("OpMode")
    _add(element, "Name", mode.name or "DC")
    if mode.description:
        _add(element, "Desc", mode.description)
    _add(element, "AssignActivate", _number(mode.assign_activate))
    _add(element, "CycleTimeSync0", str(mode.sync0_ns), Factor=str(mode.sync0_factor))
    _add(element, "ShiftTimeSync0", str(mode.shift_ns))
    _add(element, "CycleTimeSync1", str(mode.sync1_ns), Factor=str(mode.sync1_factor))
    _add(element, "ShiftTimeSync1", str(mode.sync1_shift_ns))
    return element


def _add(parent: Element, tag: str, text: str, **attributes: str) -> None:
    child = ElementTree.SubElement(parent, tag, attributes)
    child.text = "".join(c if c >= FIRST_PRINTABLE and c.isprintable() else "?" for c in text)


def _number(value: int) -> str:
    return f"#x{value:X}"
