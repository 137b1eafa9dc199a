"""Device count, reset and station addresses, ETG.1000.4 §6.1.2 and ETG.1020 §"Start-up"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from catenary.errors import NoDeviceError, SegmentError, StateError
from catenary.procedure.al_status_poll import survey
from catenary.procedure.exchange import Procedure, Request, after, physical, read, write
from catenary.procedure.station import Deadline, Pace, Station, answered
from catenary.wire.al import AlControl, AlState
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import (
    ACTIVATION,
    AL_CONTROL,
    AL_STATUS,
    DL_STATUS,
    INFORMATION,
    SII_CONFIGURATION,
    STATION_ADDRESS,
    STATION_ALIAS,
    SYSTEM_TIME_LOW,
)
from catenary.wire.sii_interface import CONFIGURATION_FORCE

RESET_TIMEOUT = 2.0  # [s]; afterwards, devices that are not in INIT get separate requests
STATION_BASE = 0x1001  # for position 0; 0 is not an address, and small numbers are often aliases
FMMU_BLOCK = (0x0600, 256)  # all 16 FMMUs
SYNC_MANAGER_BLOCK = (0x0800, 128)  # all 16 SyncManagers


@dataclass(frozen=True, slots=True)
class StationRegisters:
    """Registers of one device, read before its EEPROM."""

    position: int
    station_address: int
    alias: int
    dl_status: int
    information: bytes  # 0x0000 to 0x0009
    system_time: bool = False  # True if it has register 0x0910; some clocks only stamp times


class Counted(NamedTuple):
    """Combined answer of all devices to one broadcast."""

    devices: int
    states: int  # the OR of all AL status words


def count() -> Procedure[Counted]:
    """Count the devices that process a broadcast. Raises NoDeviceError if none does."""
    [reply] = yield [read(EcatCommand.BRD, 0, AL_STATUS)]
    if reply.lost:
        raise NoDeviceError(
            "no device: no frame came back",
            hint="check the network port, and the cable and the power of the first device",
        )
    if reply.working_counter == 0:
        raise NoDeviceError(
            "no device: frames came back unprocessed (working counter 0)",
            hint="`lo`, a bridge or a switch echoes frames; use the port that is wired to devices",
        )
    return Counted(reply.working_counter, AL_STATUS.unpack(reply.data))


def reset(device_count: int) -> Procedure[None]:
    """Request INIT from all devices, and clear their FMMUs, SyncManagers and SYNC signals.

    Errors are acknowledged, and all EEPROMs are assigned to the MainDevice. It is not an error if a
    device does not reach INIT.

    Raises:
        SegmentError: The number of devices differs from `device_count`.
    """
    yield from _all_to(AlState.INIT, RESET_TIMEOUT)
    replies = yield [
        _clear(*FMMU_BLOCK),
        _clear(*SYNC_MANAGER_BLOCK),
        write(EcatCommand.BWR, 0, ACTIVATION, 0),
        write(EcatCommand.BWR, 0, SII_CONFIGURATION, CONFIGURATION_FORCE),
        write(EcatCommand.BWR, 0, SII_CONFIGURATION, 0),
    ]
    if replies[-1].working_counter != device_count:
        raise SegmentError(
            f"{device_count} devices were counted, "
            f"but {replies[-1].working_counter} received a broadcast",
            hint="the number of devices is not stable: check for a loose contact, then scan again",
        )


def bring_all_down(stations: Sequence[Station], state: AlState, timeout: float) -> Procedure[None]:
    """Bring all devices to a lower state by broadcast, from any state.

    Devices that do not answer are ignored, so that the others reach the state.

    Args:
        stations: The devices.
        state: The requested state.
        timeout: Longest time of each broadcast request [s]; there are at most two.

    Raises:
        StateError: A device stays in a higher state. The message names the first one.
    """
    if (yield from _all_to(state, timeout)):
        return
    for answer in (yield from survey(stations)):
        if answer.word is None or answer.word & 0x0F <= state:
            continue
        raise StateError(
            f"{answer.station} stays in state {answer.word & 0x0F}; requested state: {state}",
            position=answer.station.position,
            requested=int(state),
            actual=answer.word & 0x0F,
            code=answer.code,
            hint="its outputs may be active: switch off its power",
        )


def _all_to(state: AlState, timeout: float) -> Procedure[bool]:
    """Request a state from all devices, acknowledge errors, and return True if all reach it.

    A controller with device emulation copies AL control to AL status. The acknowledgement then
    looks like an error, so the state is requested again without it.
    """
    for control in (AlControl(state, acknowledge=True), AlControl(state)):
        if not (yield from _request_all(control.word, timeout)):
            return False
    return True


def _request_all(word: int, timeout: float) -> Procedure[bool]:
    """Write AL control until all devices accept it, then wait for the state in AL status.

    Return True if the OR of all AL status words is `word`, or `word` without bit 4. Return False if
    the reply is lost or `timeout` [s] has passed.

    A controller rejects AL control until its application has read the previous one. The working
    counter is then too small, and the request is repeated for all devices.
    """
    deadline, pace = Deadline(timeout), Pace()
    taken = False
    while True:
        control = [] if taken else [write(EcatCommand.BWR, 0, AL_CONTROL, word)]
        replies = yield [*control, read(EcatCommand.BRD, 0, AL_STATUS)]
        status = replies[-1]
        taken = taken or replies[0].working_counter >= status.working_counter
        if taken and AL_STATUS.unpack(status.data) & 0x1F in (word, word & 0x0F):
            return True
        if status.lost or deadline.passed(status):
            return False
        yield after(pace.pause())


def assign(places: Sequence[int]) -> Procedure[tuple[StationRegisters, ...]]:
    """Set the station addresses of all devices, then read their registers.

    Args:
        places: Positions of the devices, in the order in which a frame passes them.
    """
    addresses = [STATION_BASE + place for place in places]
    replies = yield [
        write(EcatCommand.APWR, -rank, STATION_ADDRESS, address)
        for rank, address in enumerate(addresses)
    ]
    for place, address, reply in zip(places, addresses, replies, strict=True):
        answered(reply, Station(place, address), "station address")
    registers = yield from read_registers(addresses)
    return tuple(
        replace(each, position=place) for each, place in zip(registers, places, strict=True)
    )


def read_registers(addresses: Sequence[int]) -> Procedure[tuple[StationRegisters, ...]]:
    """Read the registers of all devices by station address, in the order of positions."""
    per_device = 4
    replies = yield [request for address in addresses for request in _register_reads(address)]
    registers = []
    for position, address in enumerate(addresses):
        station = Station(position, address)
        mine = replies[position * per_device : (position + 1) * per_device]
        information, alias, dl_status = (answered(r, station, "registers") for r in mine[:3])
        registers.append(
            StationRegisters(
                position,
                address,
                STATION_ALIAS.unpack(alias),
                DL_STATUS.unpack(dl_status),
                information,
                system_time=mine[3].working_counter == 1,
            )
        )
    return tuple(registers)


def duplicate_aliases(registers: Sequence[StationRegisters]) -> dict[int, tuple[int, ...]]:
    """Return the aliases that several devices share, with the positions of these devices."""
    positions: dict[int, list[int]] = {}
    for device in registers:
        if device.alias:
            positions.setdefault(device.alias, []).append(device.position)
    return {alias: tuple(where) for alias, where in positions.items() if len(where) > 1}


def _register_reads(address: int) -> list[Request]:
    return [
        read(EcatCommand.FPRD, address, INFORMATION),
        read(EcatCommand.FPRD, address, STATION_ALIAS),
        read(EcatCommand.FPRD, address, DL_STATUS),
        read(EcatCommand.FPRD, address, SYSTEM_TIME_LOW),
    ]


def _clear(start: int, size: int) -> Request:
    return Request(EcatCommand.BWR, physical(0, start), bytes(size), True)
