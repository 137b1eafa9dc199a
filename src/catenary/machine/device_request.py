"""Requests for the `start_up` lists of a machine file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import UNSET

from catenary.bus import SubDevice
from catenary.drive.modules import chosen_modules
from catenary.errors import ConfigurationError
from catenary.machine.file import MachineFile
from catenary.machine.references import data_type, object_of
from catenary.machine.schema import StartUpTable
from catenary.model.module import ConfiguredModule
from catenary.plan.request import DeviceRequest, ImageLayout, RequestTables, Views
from catenary.plan.start_up_object import StartUp
from catenary.toml_lines import KeyPath
from catenary.types import Octets


def start_up_objects(file: MachineFile, number: int) -> list[StartUp]:
    """Return the start-up objects of a device of the file.

    Args:
        file: the machine file.
        number: number of the [[device]] table, from 0.

    Raises:
        MachineFileError: An object, a type or a value is not valid.
    """
    device = file.tables.device[number]
    path: KeyPath = ("device", number, "start_up")
    return [_start_up(file, table, (*path, i)) for i, table in enumerate(device.start_up)]


def _start_up(file: MachineFile, table: StartUpTable, path: KeyPath) -> StartUp:
    index, subindex = object_of(file, (*path, "object"), table.object)
    options: dict[str, Any] = {
        name: getattr(table, name)
        for name in ("before_mapping", "verify", "complete_access")
        if getattr(table, name) is not UNSET
    }
    value: bool | int | float | str | bytes = table.value
    if table.type is not UNSET:
        options["type"] = kind = data_type(file, (*path, "type"), table.type)
        if isinstance(kind, Octets) and isinstance(value, str):
            with file.located((*path, "value")):
                value = kind.parse(value)
    with file.located((*path, "value")):
        return StartUp(index, subindex, value, **options)


def device_modules(
    file: MachineFile, number: int, sub: SubDevice
) -> tuple[ConfiguredModule, ...] | None:
    """Return the modules of a device of the file; None without the key `modules`.

    Args:
        file: the machine file.
        number: number of the [[device]] table, from 0.
        sub: the device.

    Raises:
        MachineFileError: A slot does not accept a module, or no ESI was used for the device.
    """
    given = file.tables.device[number].modules
    if given is UNSET:
        return None
    path: KeyPath = ("device", number, "modules")
    try:
        return chosen_modules(sub, given)
    except ConfigurationError as error:
        raise file.error(path, error.message, hint=error.hint) from error


class StartUpRequest:
    """Request with the start-up objects and modules of one device, without process data.

    It also states whether the device may be absent.
    """

    def __init__(
        self,
        sub: SubDevice,
        objects: Sequence[StartUp],
        modules: tuple[ConfiguredModule, ...] | None = None,
        *,
        required: bool,
        divider: int,
    ) -> None:
        self.subs = (sub,)
        self._request = DeviceRequest(
            objects=tuple(objects), required=required, divider=divider, modules=modules
        )

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the request of the device, by position."""
        return {self.subs[0].position: self._request}

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return empty tables."""
        return RequestTables()

    def bind(self, views: Views) -> None:
        """Do nothing, since the request has no arrays."""
