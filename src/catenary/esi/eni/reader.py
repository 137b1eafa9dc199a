"""Reader of ENI files (ETG.2100)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Never

from catenary.errors import EsiError, MachineFileError
from catenary.esi.document import Limits, open_document
from catenary.esi.eni.commands import read_address, read_register_commands
from catenary.esi.eni.devices import read_devices
from catenary.esi.eni.fields import WARNINGS_MAX, Fields
from catenary.esi.eni.known import CONFIG
from catenary.esi.eni.values import EniCyclicCommand, EniDevice, EniFile, Variable
from catenary.esi.source import EsiWarning
from catenary.esi.xml import Element, find_elements
from catenary.model.device import Direction
from catenary.wire.datagram import EcatCommand

ROOT, ENCRYPTED_ROOT = "EtherCATConfig", "EncryptedEtherCATConfig"
ENI_LIMITS = Limits(file_size=64 << 20, elements=1_000_000, tree_elements=1_000_000)
MICROSECOND = 1e-6
EXPORT = "export the ENI again from the configurator (TwinCAT, EC-Engineer ...)"


def is_eni(path: str | Path) -> bool:
    """Return True if the name of a file ends in ".xml"."""
    return Path(path).suffix.lower() == ".xml"


def read_root(path: str | Path) -> Element:
    """Return the tree of an XML file.

    Raises:
        MachineFileError: The file cannot be read, is not XML, has a document type, or is too large.
    """
    try:
        document = open_document(path, ENI_LIMITS)
        found = list(find_elements(document, frozenset({""}), limits=ENI_LIMITS))
    except EsiError as error:
        raise MachineFileError(
            error.reason, path=error.file, line=error.line, hint=error.hint
        ) from None
    return found[0].element


def read_eni(path: str | Path) -> EniFile:
    """Read an ENI file.

    An encrypted file is read if its content is plain text, with a warning.

    Args:
        path: The file.

    Raises:
        MachineFileError: The file cannot be read, is not an ENI, or a value is missing or faulty.
            The error names file, line and element.
    """
    name = str(path)
    root = read_root(path)
    if root.tag not in (ROOT, ENCRYPTED_ROOT):
        raise MachineFileError(
            f"the root is {root.tag}, not {ROOT}",
            path=name,
            line=root.line,
            key=root.tag,
            hint="an ESI file describes one device; an ENI describes a bus",
        )
    fields = Fields(name, encrypted=root.tag == ENCRYPTED_ROOT)
    config = root.find("Config")
    if config is None or not config.children:
        _refuse_empty(fields, root)
    if fields.encrypted:
        fields.warn(root, f"the root is {ENCRYPTED_ROOT}, but the content is plain; it is read")
    fields.check_known(config, CONFIG)
    master = config.find("Master")
    devices = read_devices(config, fields)
    image = config.find("ProcessImage")
    variables = _variables(image, fields)
    sizes = _size(image, "Inputs", fields), _size(image, "Outputs", fields)
    fields.warnings += islice(_contradictions(devices, variables, sizes), WARNINGS_MAX)
    return EniFile(
        path=name,
        encrypted=fields.encrypted,
        commands=read_register_commands(master, fields) if master is not None else (),
        devices=devices,
        cycle_time=_cycle_time(config, fields),
        cyclic=_cyclic(config, fields),
        variables=variables,
        image_sizes=sizes,
        warnings=tuple(fields.warnings),
    )


def _refuse_empty(fields: Fields, root: Element) -> Never:
    if fields.encrypted:
        fields.refuse(root, "the content is encrypted; there is no readable Config")
    fields.refuse(root, f"{root.tag} has no Config", hint=EXPORT)


def _cycle_time(config: Element, fields: Fields) -> float | None:
    """Return the shortest cycle time [s]; None if the file gives none."""
    times = []
    for cyclic in config.all("Cyclic"):
        if cyclic.find("CycleTime") is not None:
            time = fields.number(cyclic, "CycleTime")
            if not time:
                fields.refuse(cyclic, "the cycle time is 0", tag="CycleTime")
            times.append(time)
    if len(set(times)) > 1:
        fields.warn(config, f"{len(times)} cyclic tasks; the shortest, {min(times)} us, is used")
    return min(times) * MICROSECOND if times else None


def _cyclic(config: Element, fields: Fields) -> tuple[EniCyclicCommand, ...]:
    return tuple(
        _cyclic_command(element, fields)
        for cyclic in config.all("Cyclic")
        for frame in cyclic.all("Frame")
        for element in frame.all("Cmd")
    )


def _cyclic_command(element: Element, fields: Fields) -> EniCyclicCommand:
    command = fields.number(element, "Cmd", bits=8)
    if command not in list(EcatCommand):
        fields.refuse(element, f"{command} is not a command of EtherCAT", tag="Cmd")
    data = fields.data(element, "Data")
    return EniCyclicCommand(
        command=command,
        address=read_address(element, fields, command),
        length=fields.number(element, "DataLength", bits=16) if data is None else len(data),
        states=tuple(each.text.strip() for each in element.all("State")),
        count=None if element.find("Cnt") is None else fields.number(element, "Cnt", bits=16),
        input_offset=fields.number(element, "InputOffs", default=0),
        output_offset=fields.number(element, "OutputOffs", default=0),
        comment=fields.text(element, "Comment"),
        source=fields.source(element),
    )


def _variables(image: Element | None, fields: Fields) -> tuple[Variable, ...]:
    found: dict[tuple[Direction, str], Variable] = {}
    for tag, direction in (("Inputs", Direction.INPUT), ("Outputs", Direction.OUTPUT)):
        part = None if image is None else image.find(tag)
        for element in () if part is None else part.all("Variable"):
            variable = _variable(element, direction, fields)
            if (direction, variable.name) in found:
                fields.warn(element, f"variable {variable.name!r} occurs twice; the first is used")
                continue
            found[direction, variable.name] = variable
    return tuple(found.values())


def _variable(element: Element, direction: Direction, fields: Fields) -> Variable:
    return Variable(
        name=fields.text(element, "Name", required=True),
        direction=direction,
        data_type=fields.text(element, "DataType"),
        bit_length=fields.number(element, "BitSize"),
        bit_offset=fields.number(element, "BitOffs"),
        source=fields.source(element),
    )


def _contradictions(
    devices: Sequence[EniDevice], variables: Sequence[Variable], sizes: tuple[int, int]
) -> Iterator[EsiWarning]:
    """Yield lengths of devices other than those of their PDOs, and variables outside the image."""
    for device in devices:
        for direction in Direction:
            bits = sum(part.bit_length for part in device.image(direction))
            lengths = [manager.bit_length for manager in device.managers(direction)]
            if not sum(lengths) <= bits <= sum(-(-length // 8) * 8 for length in lengths):
                yield EsiWarning(
                    device.source,
                    f"{device.name}: {bits} bits of {direction.noun}, but its PDOs have "
                    f"{sum(lengths)}; the PDOs are used",
                )
    ends = {Direction.INPUT: sizes[0], Direction.OUTPUT: sizes[1]}
    for each in variables:
        size = ends[each.direction]
        if size and each.bit_offset + each.bit_length > 8 * size:
            yield EsiWarning(
                each.source,
                f"variable {each.name!r} ends after the {size} bytes of the {each.direction.noun}",
            )


def _size(image: Element | None, tag: str, fields: Fields) -> int:
    part = None if image is None else image.find(tag)
    return 0 if part is None else fields.number(part, "ByteSize", default=0)
