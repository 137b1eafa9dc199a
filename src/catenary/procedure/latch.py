"""Set-up and reading of the latch inputs of a device: see `wire/latch.py`."""

from __future__ import annotations

from catenary.errors import ConfigurationError
from catenary.procedure.exchange import Procedure
from catenary.procedure.registers import read_register, write_register
from catenary.procedure.station import Station
from catenary.wire.clock import CyclicUnit
from catenary.wire.latch import (
    BLOCK,
    BLOCK_SIZE,
    LatchControl,
    Latched,
    decode_latched,
)
from catenary.wire.register import CYCLIC_UNIT_CONTROL, LATCH0_CONTROL, LATCH1_CONTROL

CONTROLS = (LATCH0_CONTROL, LATCH1_CONTROL)
OF_PDI = (CyclicUnit.LATCH0_BY_PDI, CyclicUnit.LATCH1_BY_PDI)


def set_up(
    station: Station, number: int, control: LatchControl, clock_bits: int
) -> Procedure[Latched]:
    """Set the mode of a latch input, and return its status and times before.

    Reading the times acknowledges old events.

    Args:
        station: The device.
        number: Number of the input, 0 or 1.
        control: Mode of both edges.
        clock_bits: Width of the clock of the device.

    Raises:
        ConfigurationError: The application of the device controls this input.
        RegisterError: The device refuses an access.
    """
    register = CYCLIC_UNIT_CONTROL
    unit = CyclicUnit(
        register.unpack((yield from read_register(station, register.address, register.size)))
    )
    if unit & OF_PDI[number]:
        raise ConfigurationError(
            f"{station}: its application controls LATCH{number} (0x0980 = 0x{int(unit):02X}, bit "
            f"{4 + number})",
            hint="use objects of the device for its time stamps; or clear this bit with the low "
            "byte of DistributedClock(assign_activate=...), if the manual permits it",
        )
    old = yield from read(station, number, clock_bits)
    chosen = CONTROLS[number]
    yield from write_register(station, chosen.address, chosen.pack(int(control)))
    return old


def read(station: Station, number: int, clock_bits: int) -> Procedure[Latched]:
    """Read and acknowledge the events of a latch input.

    Args:
        station: The device.
        number: Number of the input, 0 or 1.
        clock_bits: Width of the clock of the device.

    Raises:
        RegisterError: The device refuses the access.
    """
    data = yield from read_register(station, BLOCK, BLOCK_SIZE)
    return decode_latched(data, number, clock_bits)
