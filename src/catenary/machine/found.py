"""Devices of a machine that were found, and the drives and process data made from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from catenary.bus import SubDevice
from catenary.drive import Copies, Drives
from catenary.drive.process_data import ProcessData
from catenary.errors import CatenaryError, IdentityError, SegmentError
from catenary.loop.devices import LoopRequest
from catenary.machine.by_name import ByName
from catenary.machine.comparison import Comparison, expected_identity
from catenary.machine.copies import make_copies
from catenary.machine.esi_files import check_esi_files
from catenary.machine.file import MachineFile
from catenary.machine.requests import (
    devices_of,
    make_device_requests,
    make_drives,
    make_process_data,
)
from catenary.machine.variables import Variables


@dataclass(frozen=True, slots=True)
class MachineParts:
    """Devices, drives and process data by name, and all requests for a loop."""

    subs: ByName[SubDevice] = field(default_factory=lambda: ByName("device", {}, {}))
    drives: ByName[Drives] = field(default_factory=lambda: ByName("drives", {}, {}))
    process_data: ByName[ProcessData] = field(default_factory=lambda: ByName("data", {}, {}))
    copies: Copies | None = None  # None: none, or not all of their devices are present
    requests: tuple[LoopRequest, ...] = ()
    variables: Variables = field(default_factory=lambda: Variables({}, {}, {}))  # of an ENI
    notes: tuple[str, ...] = ()  # warnings about an ENI, and its differences from the plan


def raise_differences(path: Path, found: Sequence[Comparison[SubDevice]]) -> None:
    """Raise an error for the first difference between file and segment, if there is one.

    The other differences are notes of the error. Unknown and absent devices are not differences.

    Args:
        path: the file with the expected devices.
        found: comparisons of the devices.

    Raises:
        IdentityError: A device has another identity, or two devices have the same alias.
        SegmentError: A required device is missing.
    """
    errors = [_error(path, each) for each in found if each.verdict in ("different", "missing")]
    if errors:
        for other in errors[1:]:
            errors[0].add_note(f"also: {other}")
        raise errors[0]


def _error(path: Path, found: Comparison[SubDevice]) -> CatenaryError:
    text = f'{path}: device "{found.name}": {found.fault}'
    if found.found is None or found.expected is None:
        return SegmentError(text, hint=found.cause)
    return IdentityError(
        text,
        position=found.found.position,
        expected=expected_identity(found.expected),
        found=found.found.identity,
        hint=found.cause,
    )


def make_found(file: MachineFile, found: Sequence[Comparison[SubDevice]]) -> MachineParts:
    """Make the drives, process data and requests of the devices that were found.

    Args:
        file: the machine file.
        found: comparisons of the devices.

    Raises:
        CatenaryError: A device of the file did not reach PRE-OP.
        MachineFileError: A table requests an object or axis that its device does not have, an
            option is not valid, or the ESI file of a device does not describe it.
    """
    subs = {each.name: each.found for each in found if each.verdict == "same" and each.found}
    for sub in subs.values():
        if sub.error is not None:
            raise sub.error
    check_esi_files(file, subs)
    absent = {each.name: each.fault for each in found if each.verdict == "absent"}
    present, missing = _roles(file, "drives", file.tables.drives, absent)
    drives = {role: make_drives(file, role, subs) for role in present}
    present, missing_data = _roles(file, "process_data", file.tables.process_data, absent)
    data = {role: make_process_data(file, role, subs) for role in present}
    copies = make_copies(file, subs)
    return MachineParts(
        subs=ByName("device", subs, absent),
        drives=ByName("drives", drives, missing),
        process_data=ByName("process data", data, missing_data),
        copies=copies,
        requests=(
            *drives.values(),
            *data.values(),
            *([] if copies is None else [copies]),
            *make_device_requests(file, subs),
        ),
    )


def _roles(
    file: MachineFile, kind: str, tables: Mapping[str, object], absent: Mapping[str, str]
) -> tuple[list[str], dict[str, str]]:
    """Return the roles whose devices are all present, and the reason for each other role."""
    reasons = {
        role: f'device "{name}": {absent[name]}'
        for role in tables
        for name in devices_of(file, kind, role)
        if name in absent
    }
    return [role for role in tables if role not in reasons], reasons
