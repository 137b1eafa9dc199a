"""Reading of the registers of all devices by position. Nothing is written.

Registers whose content changes by itself are left out: times, states of transfers, watchdog states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from catenary.errors import ResponseTimeout
from catenary.procedure.exchange import Procedure, read
from catenary.procedure.station import Station, answered
from catenary.wire import register
from catenary.wire.al import STATE_MASK, AlState
from catenary.wire.datagram import EcatCommand
from catenary.wire.dl import DlControl
from catenary.wire.features import Information, decode_information
from catenary.wire.register_names import AnyRegister

Blocks: TypeAlias = dict[int, bytes]  # by address

HEAD = (
    *(register.INFORMATION, register.STATION_ADDRESS, register.STATION_ALIAS),
    *(register.DL_CONTROL, register.DL_STATUS, register.AL_STATUS, register.AL_STATUS_CODE),
)
COMMON = (
    *(register.PDI_CONTROL, register.ESC_CONFIGURATION, register.PDI_CONFIGURATION),
    *(register.SYNC_LATCH_CONFIGURATION, register.PDI_EXTENDED_CONFIGURATION),
    *(register.ERROR_COUNTERS, register.WATCHDOG_DIVIDER, register.WATCHDOG_TIME_PDI),
    register.WATCHDOG_TIME_PROCESS_DATA,
)
CLOCK = (
    *(register.RECEIVE_TIMES, register.SYSTEM_TIME_OFFSET, register.SYSTEM_TIME_DELAY),
    *(register.SPEED_COUNTER_START, register.SYSTEM_TIME_DIFFERENCE_FILTER),
    *(register.SPEED_COUNTER_FILTER, register.ASSIGN_ACTIVATE, register.SYNC_PULSE_LENGTH),
    *(register.SYNC_CYCLE_TIMES, register.LATCH0_CONTROL, register.LATCH1_CONTROL),
)
# In fields of their own; not among the blocks
OWN = (
    *(register.STATION_ADDRESS, register.STATION_ALIAS),
    *(register.AL_STATUS, register.AL_STATUS_CODE),
)
PDI_WATCHDOG = 0x02  # bit of DL status: the watchdog of the processor has not expired
_STATUS = 5  # offset of a SyncManager's status, which depends on the last transfer
REQUESTS_MAX = 512  # per step, so that a long segment does not need thousands of buffers


@dataclass(frozen=True, slots=True)
class Present:
    """Registers of one device as they are, read by its position."""

    rank: int  # position
    station_address: int
    alias: int
    al_status: int
    al_status_code: int
    blocks: Mapping[int, bytes]

    @property
    def state(self) -> AlState | None:
        """EtherCAT state; None for a value that the standard does not define."""
        state = self.al_status & STATE_MASK
        return AlState(state) if state in tuple(AlState) else None

    @property
    def information(self) -> Information:
        """Type and capabilities of the controller."""
        return decode_information(self.blocks[register.INFORMATION.address])

    @property
    def dl_status(self) -> int:
        """DL status word."""
        return int.from_bytes(self.blocks[register.DL_STATUS.address], "little")

    @property
    def answers_to_alias(self) -> bool:
        """True if the device also answers to its alias, as to a station address."""
        data = self.blocks.get(register.DL_CONTROL.address, bytes(4))
        control = DlControl.from_word(int.from_bytes(data, "little"))
        return bool(self.alias) and control.alias_enabled


def read_present(device_count: int) -> Procedure[tuple[Present, ...]]:
    """Read the registers of all devices, in the order in which a frame passes them.

    Args:
        device_count: Number of devices.

    Raises:
        ResponseTimeout: Frames were lost, or a device did not answer.
    """
    heads = yield from _read_all([HEAD] * device_count)
    for rank, blocks in enumerate(heads):
        _check(rank, blocks)
    rest = yield from _read_all([_further(blocks) for blocks in heads])
    return tuple(_present(rank, {**heads[rank], **rest[rank]}) for rank in range(device_count))


def _check(rank: int, blocks: Blocks) -> None:
    for needed in (register.INFORMATION, register.DL_STATUS, *OWN[:3]):
        if needed.address not in blocks:
            raise ResponseTimeout(
                f"device {rank}: {needed} cannot be read (working counter 0)",
                hint="a device was switched off or unplugged: check the cables, then try again",
            )


def _further(head: Blocks) -> tuple[AnyRegister, ...]:
    information = decode_information(head[register.INFORMATION.address])
    fmmus = min(information.fmmu_count, register.FMMU_COUNT)
    managers = min(information.sync_manager_count, register.SYNC_MANAGER_COUNT)
    return (
        *COMMON,
        *(register.fmmu(k) for k in range(fmmus)),
        *(register.sync_manager(k) for k in range(managers)),
        *(CLOCK if information.supports_clocks else ()),
    )


def _read_all(wanted: Sequence[Sequence[AnyRegister]]) -> Procedure[list[Blocks]]:
    """Read registers by position. A register that a device does not have is omitted."""
    found: list[Blocks] = [{} for _ in wanted]
    places = [(rank, each) for rank, registers in enumerate(wanted) for each in registers]
    for first in range(0, len(places), REQUESTS_MAX):
        part = places[first : first + REQUESTS_MAX]
        replies = yield [read(EcatCommand.APRD, -rank, each) for rank, each in part]
        for (rank, each), reply in zip(part, replies, strict=True):
            if reply.lost or reply.working_counter:
                found[rank][each.address] = answered(reply, Station(rank, 0), str(each))
    return found


def _present(rank: int, blocks: Blocks) -> Present:
    address, alias, al_status, code = (
        int.from_bytes(blocks.pop(each.address, b"\0\0"), "little") for each in OWN
    )
    links = blocks[register.DL_STATUS.address]
    blocks[register.DL_STATUS.address] = bytes((links[0] & ~PDI_WATCHDOG, *links[1:]))
    for k in range(register.SYNC_MANAGER_COUNT):
        place = register.sync_manager(k).address
        if place in blocks:
            data = blocks[place]
            blocks[place] = data[:_STATUS] + b"\0" + data[_STATUS + 1 :]
    return Present(rank, address, alias, al_status, code, dict(sorted(blocks.items())))
