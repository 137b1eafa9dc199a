"""Frames of a cycle, made from its units, with templates and expected counters. ETG.1000.4 §5.4.

A device adds to a logical datagram's working counter: LRD 1, LWR 1, LRW 1 for a read and 2 for
a write (ETG.1000.4 table 14), once per datagram, regardless of its number of FMMUs.

Frames are matched by an index of 7 bits (core/_frames.pyx). An index is used again after 128
frames. At most 32 frames may therefore be sent in one cycle. With `exact_matching` each frame also
carries the cycle number, and 128 frames are possible.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from catenary.errors import ConfigurationError
from catenary.plan.clocks import ClockChoice
from catenary.plan.cycle import Copy, DatagramKind, DatagramPlan, FramePlan
from catenary.plan.layout import UnitLayout
from catenary.plan.mailboxes import MailboxArea
from catenary.wire.datagram import HEADER_SIZE as DATAGRAM_HEADER
from catenary.wire.datagram import OVERHEAD, Datagram, EcatCommand
from catenary.wire.frame import HEADER_SIZE, MAXIMUM_PAYLOAD, encode_frame, wire_time_ns
from catenary.wire.register import (
    AL_STATUS,
    SYSTEM_TIME_DIFFERENCE,
    SYSTEM_TIME_LOW,
    Register,
)

CYCLE_NUMBER_SIZE = OVERHEAD + 4  # bytes of a datagram with a number of 32 bits
FRAMES_PER_CYCLE_MAX = 32  # an index is used again after at least four cycles
EXACT_FRAMES_MAX = 128  # all indices, 0x00 to 0x7F
FRAMES_MAX = 1024  # of all dividers and phases together
ACYCLIC_GUARD = 0.1  # share of the period without acyclic frames: keeps the next cycle punctual


@dataclass(frozen=True, slots=True)
class _Piece:
    """Datagram before it has a place in a frame. Offsets count from the start of its data."""

    kind: DatagramKind
    command: EcatCommand
    address: int
    length: int
    expected_counter: int
    sync_unit: int
    outputs: tuple[Copy, ...] = ()
    inputs: tuple[Copy, ...] = ()
    divider: int = 1
    phase: int = 0

    @property
    def turn(self) -> tuple[int, int]:
        """Divider and phase of the cycles in which the datagram is sent."""
        return self.divider, self.phase

    @property
    def size(self) -> int:
        return OVERHEAD + self.length


def make_frames(
    units: Sequence[UnitLayout],
    device_count: int,
    clocks: ClockChoice | None = None,
    mailboxes: MailboxArea | None = None,
    *,
    exact_matching: bool = False,
) -> tuple[FramePlan, ...]:
    """Return the cyclic frames of all dividers and phases, in the order they are sent.

    Frame 0 begins with the BRD of AL status, which every device answers. It also carries the time.
    Units with a divider have their own frames, so that the other cycles do not carry them.

    Args:
        units: Units of the layout, in order.
        device_count: Number of devices on the segment.
        clocks: Distributed clocks; None if no device uses them.
        mailboxes: Mailbox bits; None if they are not exchanged.
        exact_matching: True if every frame carries the cycle number.

    Raises:
        ConfigurationError: One cycle needs more frames than the indices can identify, or all
            cycles together need more than FRAMES_MAX.
    """
    pieces = [_al_status(device_count), *_of_clocks(clocks)]
    for number, unit in enumerate(units):
        pieces.extend(_of_unit(unit, number))
    pieces.extend(_of_mailboxes(mailboxes))
    room = MAXIMUM_PAYLOAD - (CYCLE_NUMBER_SIZE if exact_matching else 0)
    batches = _batches(pieces, room)
    if exact_matching:
        batches = [[*batch, _cycle_number(batch[0])] for batch in batches]
    frames = tuple(_frame(batch) for batch in batches)
    _check_count(frames, exact_matching)
    return frames


def frames_per_cycle(frames: Sequence[FramePlan]) -> int:
    """Return an upper bound of the frames in one cycle: the busiest phase of each divider."""
    return _per_cycle(frames, lambda frame: 1)


def cyclic_wire_time_ns(frames: Sequence[FramePlan]) -> int:
    """Return an upper bound of the wire time of the frames in one cycle [ns]."""
    return _per_cycle(frames, lambda frame: wire_time_ns(len(frame.template)))


def acyclic_wire_time_ns(cyclic_ns: int, period_ns: int) -> int:
    """Return the wire time of one cycle that is left for acyclic frames [ns]; 0 if there is none.

    ACYCLIC_GUARD, a share of the period, is kept free.

    Args:
        cyclic_ns: Wire time of the cyclic frames [ns].
        period_ns: Period [ns].

    Raises:
        ConfigurationError: The cyclic frames alone do not fit into the period.
    """
    if cyclic_ns > period_ns:
        raise ConfigurationError(
            f"the cyclic frames take {cyclic_ns / 1e3:g} us at 100 Mbit/s; the period is "
            f"{period_ns / 1e3:g} us",
            hint="use a longer period, fewer objects, or exchange devices less often (divider=...)",
        )
    return max(period_ns - cyclic_ns - round(ACYCLIC_GUARD * period_ns), 0)


def check_return(cyclic_ns: int, period_ns: int, deadline_ns: int) -> None:
    """Raise ConfigurationError if the cyclic frames cannot be back by the collect deadline."""
    if cyclic_ns > deadline_ns:
        raise ConfigurationError(
            f"period={period_ns * 1e-9:g} s is too short: the cyclic frames take "
            f"{cyclic_ns / 1e3:g} us at 100 Mbit/s, and must be back {deadline_ns / 1e3:g} us "
            "after the cycle start",
            hint="use a longer period, fewer objects, a divider for some devices (divider=...), "
            "or a later deadline, Scheduling(collect_deadline=...)",
        )


def _per_cycle(frames: Sequence[FramePlan], weight: Callable[[FramePlan], int]) -> int:
    sums: Counter[tuple[int, int]] = Counter()
    for frame in frames:
        sums[frame.divider, frame.phase] += weight(frame)
    fullest: dict[int, int] = {}
    for (divider, _), total in sums.items():
        fullest[divider] = max(fullest.get(divider, 0), total)
    return sum(fullest.values())


def _check_count(frames: Sequence[FramePlan], exact_matching: bool) -> None:
    limit = EXACT_FRAMES_MAX if exact_matching else FRAMES_PER_CYCLE_MAX
    busiest = frames_per_cycle(frames)
    if busiest <= limit and len(frames) <= FRAMES_MAX:
        return
    if busiest <= limit:
        raise ConfigurationError(
            f"too many frames for all dividers and phases: {len(frames)}; the limit is "
            f"{FRAMES_MAX}",
            hint="exchange fewer devices with dividers (divider=...)",
        )
    more = "" if exact_matching else f"; Scheduling(exact_matching=True) allows {EXACT_FRAMES_MAX}"
    raise ConfigurationError(
        f"too many frames in one cycle: {busiest}; the limit is {limit}, because an index has 7 "
        f"bits{more}",
        hint="map fewer objects, or exchange some devices less often (divider=...)",
    )


def _cycle_number(first: _Piece) -> _Piece:
    """Return the last datagram of a frame: a NOP, which passes every device unchanged."""
    return _Piece(
        DatagramKind.CYCLE_NUMBER,
        EcatCommand.NOP,
        0,
        CYCLE_NUMBER_SIZE - OVERHEAD,
        expected_counter=0,
        sync_unit=-1,
        divider=first.divider,
        phase=first.phase,
    )


def _al_status(device_count: int) -> _Piece:
    address = AL_STATUS.address << 16
    return _Piece(
        DatagramKind.AL_STATUS, EcatCommand.BRD, address, AL_STATUS.size, device_count, sync_unit=-1
    )


def _of_clocks(clocks: ClockChoice | None) -> list[_Piece]:
    """Return the datagrams of the clocks.

    They carry the link's time to the reference clock if it follows the link, and the reference's
    time to all other clocks. They also read the difference of one device, another one in each
    cycle.

    Times have four bytes: the loop of a controller compares four, IgH sends four, and a 32-bit
    clock would refuse eight. A broadcast read of all differences would OR sign-magnitude numbers.
    """
    if clocks is None:
        return []
    station = clocks.reference.station_address
    pieces = [_clock_piece(EcatCommand.FRMW, station, SYSTEM_TIME_LOW, clocks.listeners)]
    if clocks.follow == "main":
        pieces.insert(0, _clock_piece(EcatCommand.FPWR, station, SYSTEM_TIME_LOW, 1))
    if clocks.followers:
        first = clocks.followers[0].station_address
        pieces.append(_clock_piece(EcatCommand.FPRD, first, SYSTEM_TIME_DIFFERENCE, 1))
    return pieces


def _clock_piece(
    command: EcatCommand, station: int, register: Register[int], expected_counter: int
) -> _Piece:
    address = station | register.address << 16
    return _Piece(
        DatagramKind.CLOCK, command, address, register.size, expected_counter, sync_unit=-1
    )


def _of_mailboxes(area: MailboxArea | None) -> list[_Piece]:
    """Return the datagram of the mailboxes. It has no sync unit, so a cycle without it is good."""
    if area is None or not area.devices:
        return []
    inputs = (Copy(0, area.input_offset, area.size),)
    return [
        _Piece(
            DatagramKind.PROCESS_DATA,
            EcatCommand.LRD,
            area.logical_start,
            area.size,
            len(area.devices),
            sync_unit=-1,
            inputs=inputs,
        )
    ]


def _of_unit(unit: UnitLayout, number: int) -> list[_Piece]:
    """Return the datagrams of a unit: one LRW if its devices allow it, otherwise LWR and LRD."""
    outputs = _Piece(
        DatagramKind.PROCESS_DATA,
        EcatCommand.LWR,
        unit.logical_start,
        unit.output_size,
        unit.output_devices,
        number,
        outputs=(Copy(0, unit.output_offset, unit.output_size),),
        divider=unit.divider,
        phase=unit.phase,
    )
    inputs = replace(
        outputs,
        command=EcatCommand.LRD,
        address=unit.logical_start + unit.output_size,
        length=unit.input_size,
        expected_counter=unit.input_devices,
        outputs=(),
        inputs=(Copy(0, unit.input_offset, unit.input_size),),
    )
    if not (unit.logical_read_write and outputs.length and inputs.length):
        return [piece for piece in (outputs, inputs) if piece.length]
    both = replace(
        outputs,
        command=EcatCommand.LRW,
        length=outputs.length + inputs.length,
        expected_counter=2 * unit.output_devices + unit.input_devices,
        inputs=(Copy(unit.output_size, unit.input_offset, unit.input_size),),
    )
    return [both]


def _batches(pieces: Sequence[_Piece], room: int) -> list[list[_Piece]]:
    """Return the datagrams of each frame. Each is in the first frame of its cycles that has room.

    Args:
        pieces: Datagrams in order.
        room: Bytes in an empty frame.
    """
    batches: list[list[_Piece]] = []
    for piece in pieces:
        for batch in batches:
            fits = sum(p.size for p in batch) + piece.size <= room
            if fits and piece.turn == batch[0].turn:
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
    return FramePlan(encode_frame(datagrams), tuple(plans), batch[0].divider, batch[0].phase)


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
