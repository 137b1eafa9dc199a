"""Set-up and reading of the latch inputs of a device: see `wire/latch.py`."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.errors import ConfigurationError
from catenary.procedure.exchange import Procedure
from catenary.procedure.registers import read_register, write_register
from catenary.procedure.station import Station
from catenary.wire.clock import CyclicUnit
from catenary.wire.latch import (
    TIMES_SIZE,
    LatchControl,
    LatchStatus,
    decode_times,
)
from catenary.wire.register import (
    CYCLIC_UNIT_CONTROL,
    LATCH0_CONTROL,
    LATCH0_STATUS,
    LATCH0_TIME_POSITIVE,
    LATCH1_CONTROL,
    LATCH1_STATUS,
    LATCH1_TIME_POSITIVE,
)

CONTROLS = (LATCH0_CONTROL, LATCH1_CONTROL)
STATUSES = (LATCH0_STATUS, LATCH1_STATUS)
TIMES = (LATCH0_TIME_POSITIVE, LATCH1_TIME_POSITIVE)  # the first register of each input
OF_PDI = (CyclicUnit.LATCH0_BY_PDI, CyclicUnit.LATCH1_BY_PDI)


@dataclass(frozen=True, slots=True)
class Latched:
    """Level of a latch input, and the times of its last edges [ns]."""

    active: bool
    rising_ns: int
    falling_ns: int


def set_up(
    station: Station, number: int, control: LatchControl, clock_bits: int
) -> Procedure[Latched]:
    """Set the mode of a latch input, and return its level and times before.

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
    """Read the level and the times of a latch input. This acknowledges its events.

    The other input is not read, because that would acknowledge its events too.

    Args:
        station: The device.
        number: Number of the input, 0 or 1.
        clock_bits: Width of the clock of the device.

    Raises:
        RegisterError: The device refuses an access.
    """
    [status] = yield from read_register(station, STATUSES[number].address, 1)
    data = yield from read_register(station, TIMES[number].address, TIMES_SIZE)
    rising, falling = decode_times(data, clock_bits)
    return Latched(bool(status & LatchStatus.PIN), rising, falling)
