"""Choice of a device's OpMode, and the PDOs that the mode assigns (ETG.2000, `Dc/OpMode`)."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import zip_longest
from typing import TYPE_CHECKING

from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, Direction, OpMode
from catenary.wire.clock import Activation

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import DistributedClock, WrittenPdo

SYNC_BY_ECAT = 0x0300  # AssignActivate: cyclic operation and SYNC0, controlled by EtherCAT


def choose_mode(device: DeviceDescription, request: DistributedClock) -> OpMode:
    """Return the OpMode with the requested name.

    Without a name, return the first mode that starts SYNC0, otherwise the first that starts SYNC1.
    If no mode starts either signal, return one with SYNC0 in every period. ETG.2000 makes the first
    mode the default, but this mode often has no SYNC signals (hpm_ECAT_CIA402.xml: SM-Synchron).

    Args:
        device: Device.
        request: Clock request.

    Raises:
        ConfigurationError: The device has no OpMode with this name.
    """
    if request.op_mode is not None:
        return _named_mode(device, request.op_mode)
    for starts in (starts_sync0, starts_sync):
        for mode in device.op_modes:
            if starts(mode.assign_activate):
                return mode
    return OpMode(assign_activate=SYNC_BY_ECAT)


def starts_sync0(assign_activate: int) -> bool:
    """Return True if SYNC0 runs. Otherwise, shifts are meaningless (pollen_Orbita2d.bin: 1.9 s)."""
    return assign_activate & SYNC_BY_ECAT == SYNC_BY_ECAT


def starts_sync(assign_activate: int) -> bool:
    """Return True if SYNC0 or SYNC1 runs. SYNC1 alone: 0x0500, robert-burger/libethercat#21."""
    signals = Activation(assign_activate >> 8)
    running = Activation.CYCLIC_OPERATION in signals
    return running and bool(signals & (Activation.SYNC0 | Activation.SYNC1))


def chosen_pdos(
    device: DeviceDescription,
    pdos: Iterable[WrittenPdo],
    clock: DistributedClock | None,
    direction: Direction,
) -> tuple[WrittenPdo, ...]:
    """Return the PDOs that the application specified; without them, those of the OpMode.

    Args:
        device: Device.
        pdos: PDOs of the application, of both directions.
        clock: Clock request; None without clocks.
        direction: Direction of the PDOs.

    Raises:
        ConfigurationError: The device has no OpMode with the requested name.
    """
    given = tuple(pdo for pdo in pdos if pdo.direction is direction)
    return given or _mode_pdos(device, clock, direction)


def _mode_pdos(
    device: DeviceDescription, request: DistributedClock | None, direction: Direction
) -> tuple[WrittenPdo, ...]:
    """Return the PDOs that the named OpMode assigns in one direction; empty if it assigns none.

    Without a name, the device keeps its assignment: an ESI file in the library of the user must not
    change the process data of a program that does not choose a mode. A PDO with oversampling is
    assigned once per sample, with consecutive indices.

    Args:
        device: Device.
        request: Clock request; None without clocks.
        direction: Direction of the PDOs.

    Raises:
        ConfigurationError: The device has no OpMode with the requested name.
    """
    from catenary.plan.request import WrittenPdo

    if request is None or request.op_mode is None:
        return ()
    mode = choose_mode(device, request)
    written = [
        WrittenPdo(index, None, each.sync_manager, copies, source=mode.source)
        for each in mode.assignments
        for index, copies in zip_longest(
            each.pdos, each.oversampling[: len(each.pdos)], fillvalue=1
        )
    ]
    return tuple(each for each in written if each.direction is direction)


def _named_mode(device: DeviceDescription, name: str) -> OpMode:
    """Return the mode with a name. Many files name a mode "DC" and describe it "DC-Synchron"."""
    wanted = name.casefold()
    for mode in device.op_modes:
        if mode.name.casefold() == wanted:
            return mode
    for mode in device.op_modes:
        if mode.description.casefold() == wanted:
            return mode
    known = ", ".join(repr(mode.name) for mode in device.op_modes)
    where = device.esi or "its EEPROM"
    raise ConfigurationError(
        f"{device}: {where} has no OpMode {name!r}; it has {known or 'none'}",
        hint="choose one of these" * bool(known)
        or "use the values of its ESI file: main.scan(esi=FILE), or "
        "cat.DistributedClock(assign_activate=..., sync0=...)",
    )
