"""Machine from an ENI file: identities, commands, process data, variables and clocks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from msgspec import UNSET

from catenary.bus import SubDevice
from catenary.drive import ProcessData
from catenary.errors import ConfigurationError, IdentityError, MachineFileError
from catenary.esi.eni import EniFile, read_eni
from catenary.esi.eni.checks import check_commands
from catenary.esi.eni.own_registers import left_out, vendor_commands
from catenary.esi.eni.places import place_variables
from catenary.esi.eni.settings import REVISION_WORD, SERIAL_WORD, checked_words, with_eni
from catenary.link import LinkSource
from catenary.loop import ClockOptions
from catenary.machine.by_name import ByName
from catenary.machine.comparison import Comparison, compare
from catenary.machine.eni.comparison import compare_plan
from catenary.machine.eni.requests import channel_names, clock, make_process_data
from catenary.machine.found import MachineParts, raise_differences
from catenary.machine.schema import DeviceTable, IdentityTable
from catenary.machine.variables import Variables
from catenary.model.device import Direction
from catenary.target import MainDevice

DEFAULT_PERIOD = 1e-3  # [s], of a file without a cycle time


class EniMachine:
    """Machine that an ENI describes. Implements `machine.MachineDescription`."""

    def __init__(self, path: str | Path, without: Sequence[str] = ()) -> None:
        """Read the file.

        Args:
            path: the file.
            without: mailbox protocols whose commands are left out, such as "EoE".

        Raises:
            MachineFileError: The file cannot be read, a value is faulty, or Catenary cannot run a
                command.
        """
        self._eni = read_eni(path)
        check_commands(self._eni, without)
        self._without = tuple(without)
        self._names = device_names(self._eni)

    @property
    def name(self) -> str:
        """Path of the file."""
        return self._eni.path

    def source(self) -> LinkSource:
        """Raise MachineFileError: an ENI names no interface."""
        raise MachineFileError(
            "an ENI names no network interface",
            path=self._eni.path,
            hint='give it: cat.Machine("bus.xml", target="eth0")',
        )

    def find(self, main: MainDevice, *, passive: bool) -> MachineParts:
        """Check the identities, bring the devices to PRE-OP, and make the process data.

        The register commands of the transition IP run in the scan. A plan is made, to report its
        differences from the file before a loop starts.

        Args:
            main: the open MainDevice.
            passive: True to compare the identities before any device is changed.
        """
        eni, tables = self._eni, device_tables(self._eni)
        if passive:
            found = compare(tables, main.passive_scan())
            raise_differences(Path(eni.path), found)
            _check_masked(eni, found)
        else:
            self._refuse_kernel_master()
        subs = main.scan(
            strict=False, esi=False, settings=partial(with_eni, eni=eni, without=self._without)
        )
        found = compare(tables, subs)
        raise_differences(Path(eni.path), found)
        _check_masked(eni, found)
        parts = self._parts({each.name: each.found for each in found if each.found is not None})
        for sub in parts.subs.values():
            if sub.error is not None:
                raise sub.error
        plan = main.plan(*parts.requests, period=eni.cycle_time or DEFAULT_PERIOD)
        notes = (
            *map(str, eni.warnings),
            *_identity_notes(eni, found),
            *left_out(eni, self._without),
            *compare_plan(eni, plan, [sub.description for sub in main.subs]),
        )
        return replace(parts, notes=notes)

    def loop_options(self, parts: MachineParts) -> dict[str, Any]:
        """Return the period and the reference clock of the file for a loop."""
        if not parts.process_data:
            raise MachineFileError(
                "no device has process data, so there is nothing to exchange", path=self._eni.path
            )
        options: dict[str, Any] = {}
        if self._eni.cycle_time is not None:
            options["period"] = self._eni.cycle_time
        uses_clocks = any(clock(device) is not None for device in self._eni.devices)
        for device in self._eni.devices:
            if uses_clocks and device.clock is not None and device.clock.reference:
                reference = parts.subs[self._names[device.position]]
                options["clocks"] = ClockOptions(reference=reference)
        return options

    def _parts(self, subs: Mapping[str, SubDevice]) -> MachineParts:
        placed = place_variables(self._eni)
        by_device = placed.by_device()
        data: dict[str, ProcessData] = {}
        values: dict[str, tuple[ProcessData, str]] = {}
        left = dict(placed.left_out)
        for device in self._eni.devices:
            name = self._names[device.position]
            if not any(device.managers(direction) for direction in Direction):
                continue
            named = channel_names(device.name, by_device.get(device.position, ()))
            data[name] = made = make_process_data(device, subs[name], named)
            for short, each in named.items():
                full = each.variable.name
                if full in values:
                    left[f"{full} (output)"] = "an input has the same name; use `process_data`"
                else:
                    values[full] = made, short
        table = {each.variable.name: each.variable for each in reversed(placed.placed)}
        return MachineParts(
            subs=ByName("device", subs, {}),
            process_data=ByName("process data", data, {}),
            requests=tuple(data.values()),
            variables=Variables(values, table, left),
        )

    def _refuse_kernel_master(self) -> None:
        """Raise ConfigurationError for register commands, which the IgH master cannot send."""
        for device in self._eni.devices:
            for command in vendor_commands(device):
                raise ConfigurationError(
                    f"{command.source}: {device.name}: the IgH kernel master cannot send the "
                    f"command to register {command}",
                    hint="use a network interface as the target",
                )


def device_names(eni: EniFile) -> list[str]:
    """Return a unique name for each device: that of the file, with its position if needed."""
    count = Counter(device.name for device in eni.devices)
    numbered = [f"{device.name} {device.position}" for device in eni.devices]
    names = [
        device.name if count[device.name] == 1 else each
        for device, each in zip(eni.devices, numbered, strict=True)
    ]
    return names if len(set(names)) == len(names) else numbered


def device_tables(eni: EniFile) -> list[DeviceTable]:
    """Return the devices with the identities to check.

    Vendor and product are always checked, revision and serial number only if a command of the file
    compares all of their bits.
    """
    tables = []
    for name, device in zip(device_names(eni), eni.devices, strict=True):
        validations = checked_words(device.commands).items()
        checked = {word for word, each in validations if not each.is_masked}
        identity = device.identity
        tables.append(
            DeviceTable(
                name=name,
                position=device.position,
                identity=IdentityTable(
                    vendor=identity.vendor,
                    product=identity.product,
                    revision=identity.revision if REVISION_WORD in checked else UNSET,
                    serial=identity.serial if SERIAL_WORD in checked else UNSET,
                ),
            )
        )
    return tables


def _check_masked(eni: EniFile, found: Sequence[Comparison[SubDevice]]) -> None:
    """Raise IdentityError for a revision without the bits that a command of the file compares."""
    for device, each in zip(eni.devices, found, strict=False):
        validation = checked_words(device.commands).get(REVISION_WORD)
        if validation is None or each.found is None:
            continue
        revision = each.found.identity.revision
        if validation.is_masked and not validation.accepts(revision.to_bytes(4, "little")):
            data, mask = (
                int.from_bytes(part, "little") for part in (validation.data, validation.mask)
            )
            raise IdentityError(
                f'{eni.path}: device "{each.name}": expected revision 0x{data:08X} under mask '
                f"0x{mask:08X}, found 0x{revision:08X}",
                position=device.position,
                expected=device.identity,
                found=each.found.identity,
                hint="export the ENI with the revision of the device, or without this comparison",
            )


def _identity_notes(eni: EniFile, found: Sequence[Comparison[SubDevice]]) -> list[str]:
    """Return notes on additional devices, and on other revisions."""
    notes = [f"{eni.path}: {each.fault}" for each in found if each.verdict == "unknown"]
    for device, each in zip(eni.devices, found, strict=False):
        if each.found is not None and each.found.identity.revision != device.identity.revision:
            notes.append(
                f"{device.source}: {device.name}: the ENI has revision "
                f"0x{device.identity.revision:08X}, the device "
                f"0x{each.found.identity.revision:08X}; the file does not require it"
            )
    return notes
