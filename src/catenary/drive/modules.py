"""The option `modules` of process-data requests: modules in the slots of a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from catenary.bus import SubDevice
from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription
from catenary.model.module import ConfiguredModule
from catenary.plan.modules import with_requested_modules

Modules: TypeAlias = Sequence[str | int | None]  # per slot: name, type or ident; None: empty


def chosen_modules(sub: SubDevice, modules: Modules | None) -> tuple[ConfiguredModule, ...] | None:
    """Return the modules of the option; None without the option.

    Args:
        sub: Modular device, scanned with its ESI file.
        modules: Value of the option.

    Raises:
        ConfigurationError: No ESI was used for the device, or a slot does not accept a module.
        TypeError: The option is not a list of names and idents.
    """
    if modules is None:
        return None
    if sub.esi is None:
        raise ConfigurationError(
            f"{sub.description}: modules= needs the ESI file of the device",
            hint="main.scan(esi=FILE), or add the file to the library: catenary esi add FILE",
        )
    from catenary.esi.configured import expand

    return expand(sub.esi, modules)


def described(sub: SubDevice, modules: tuple[ConfiguredModule, ...] | None) -> DeviceDescription:
    """Return the description of a device with the modules of a request.

    Args:
        sub: The device.
        modules: Modules of the request; None: as scanned.
    """
    return with_requested_modules(sub.description, modules)
