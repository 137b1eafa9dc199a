"""Units → the frames of a cycle, with templates and expected counters. ETG.1000.4 §5.4.

A device adds to a logical datagram's working counter: LRD 1, LWR 1, LRW 1 for a read and 2 for
a write (ETG.1000.4 table 14), once per datagram however many FMMUs it has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from catenary.plan.clocks import ClockChoice
from catenary.plan.cycle import Copy, DatagramKind, DatagramPlan, FramePlan
from catenary.plan.layout import UnitLayout
from catenary.plan.mailboxes import MailboxArea
from catenary.wire.datagram import HEADER_SIZE as DATAGRAM_HEADER
from catenary.wire.datagram import OVERHEAD, Command, Datagram
from catenary.wire.frame import HEADER_SIZE, MAXIMUM_PAYLOAD, encode_frame
from catenary.wire.register import (
    AL_STATUS,
    SYSTEM_TIME_DIFFERENCE,
    SYSTEM_TIME_LOW,
    Register,
)


@dataclass(frozen=True, slots=True)
class _Piece:
    """A datagram before it has a place in a frame. Offsets count from its data."""

    kind: DatagramKind
    command: Command
    address: int
    length: int
    expected_counter: int
    sync_unit: int
    outputs: tuple[Copy, ...] = ()
    inputs: tuple[Copy, ...] = ()
    every: int = 1
    phase: int = 0

    @property
    def size(self) -> int:
        return OVERHEAD + self.length


def make_frames(
    units: Sequence[UnitLayout],
    device_count: int,
    clocks: ClockChoice | None = None,
    mailboxes: MailboxArea | None = None,
) -> tuple[FramePlan, ...]:
    """The frames of one cycle, in the order they are sent. Frame 0 begins with the BRD of AL
    status, which every device answers, and carries the time. What is not exchanged in every cycle
    rides in frames of its own, so that the other cycles do not carry it."""
    pieces = [_al_status(device_count), *_of_clocks(clocks)]
    for number, unit in enumerate(units):
        for piece in _of_unit(unit, number):
            pieces.append(replace(piece, every=unit.every, phase=unit.phase))
    pieces.extend(_of_mailboxes(mailboxes))
    return tuple(_frame(batch) for batch in _batches(pieces))


def _al_status(device_count: int) -> _Piece:
    address = AL_STATUS.address << 16
    return _Piece(
        DatagramKind.AL_STATUS, Command.BRD, address, AL_STATUS.size, device_count, sync_unit=-1
    )


def _of_clocks(clocks: ClockChoice | None) -> list[_Piece]:
    """Our time to the reference clock, if it follows us; its time to all others; and one device's
    difference, another one's each cycle: the core turns the address.

    Four bytes of time are what the loop of a controller compares, and what IgH sends; a 32-bit
    clock would refuse eight. A broadcast read of all differences would or sign-magnitude numbers.
    """
    if clocks is None:
        return []
    station = clocks.reference.station_address
    pieces = [_clock_piece(Command.FRMW, station, SYSTEM_TIME_LOW, clocks.listeners)]
    if clocks.follow == "main":
        pieces.insert(0, _clock_piece(Command.FPWR, station, SYSTEM_TIME_LOW, 1))
    if clocks.followers:
        first = clocks.followers[0].station_address
        pieces.append(_clock_piece(Command.FPRD, first, SYSTEM_TIME_DIFFERENCE, 1))
    return pieces


def _clock_piece(
    command: Command, station: int, register: Register[int], expected_counter: int
) -> _Piece:
    address = station | register.address << 16
    return _Piece(
        DatagramKind.CLOCK, command, address, register.size, expected_counter, sync_unit=-1
    )


def _of_mailboxes(area: MailboxArea | None) -> list[_Piece]:
    """Belongs to no sync unit: a cycle is good without it."""
    if area is None or not area.devices:
        return []
    inputs = (Copy(0, area.input_offset, area.size),)
    return [
        _Piece(
            DatagramKind.PROCESS_DATA,
            Command.LRD,
            area.logical_start,
            area.size,
            len(area.devices),
            sync_unit=-1,
            inputs=inputs,
        )
    ]


def _of_unit(unit: UnitLayout, number: int) -> list[_Piece]:
    out_size, in_size = unit.output_size, unit.input_size
    if unit.logical_read_write and out_size and in_size:
        return [
            _Piece(
                DatagramKind.PROCESS_DATA,
                Command.LRW,
                unit.logical_start,
                out_size + in_size,
                2 * unit.output_devices + unit.input_devices,
                number,
                outputs=(Copy(0, unit.output_offset, out_size),),
                inputs=(Copy(out_size, unit.input_offset, in_size),),
            )
        ]
    pieces = []
    if out_size:
        outputs = (Copy(0, unit.output_offset, out_size),)
        pieces.append(
            _Piece(
                DatagramKind.PROCESS_DATA,
                Command.LWR,
                unit.logical_start,
                out_size,
                unit.output_devices,
                number,
                outputs=outputs,
            )
        )
    if in_size:
        inputs = (Copy(0, unit.input_offset, in_size),)
        pieces.append(
            _Piece(
                DatagramKind.PROCESS_DATA,
                Command.LRD,
                unit.logical_start + out_size,
                in_size,
                unit.input_devices,
                number,
                inputs=inputs,
            )
        )
    return pieces


def _batches(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    """Pieces by frame: each goes into the first frame of its cycles with room."""
    batches: list[list[_Piece]] = []
    for piece in pieces:
        for batch in batches:
            together = (piece.every, piece.phase) == (batch[0].every, batch[0].phase)
            if together and sum(p.size for p in batch) + piece.size <= MAXIMUM_PAYLOAD:
                batch.append(piece)
                break
        else:
            batches.append([piece])
    return batches


def _frame(batch: Sequence[_Piece]) -> FramePlan:
    plans = []
    offset = HEADER_SIZE
    for piece in batch:
        plans.append(_placed(piece, offset))
        offset += piece.size
    datagrams = [Datagram(piece.command, piece.address, bytes(piece.length)) for piece in batch]
    return FramePlan(encode_frame(datagrams), tuple(plans), batch[0].every, batch[0].phase)


def _placed(piece: _Piece, offset: int) -> DatagramPlan:
    data = offset + DATAGRAM_HEADER
    return DatagramPlan(
        kind=piece.kind,
        command=int(piece.command),
        offset=offset,
        length=piece.length,
        expected_counter=piece.expected_counter,
        sync_unit=piece.sync_unit,
        outputs=tuple(Copy(data + c.frame_offset, c.image_offset, c.size) for c in piece.outputs),
        inputs=tuple(Copy(data + c.frame_offset, c.image_offset, c.size) for c in piece.inputs),
    )
