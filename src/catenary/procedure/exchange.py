"""What a conversation says to its runner: datagrams to exchange, or a time to let pass.

A procedure is a generator: it yields a list of `Request`s and is resumed with the list of their
`Reply`s, in the same order; or it yields `after(seconds)` and is resumed with an empty list when
the time has passed. It never sleeps, retries or touches a link: its runner does. Its `return`
value is the result. It knows the time from its replies alone (`Reply.time_ns`, the link's clock),
which is how deadlines are kept without a clock.

    def read_al_status(station):
        [reply] = yield [read(EcatCommand.FPRD, station, AL_STATUS)]
        return AL_STATUS.unpack(reply.data)
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple, TypeAlias, TypeVar

from catenary.wire.datagram import EcatCommand
from catenary.wire.register import Register


class Request(NamedTuple):
    """One datagram to send.

    `repeatable`: a lost one may be sent again without harm. The runner repeats it; one that is not
    repeatable comes back as a lost reply, and the procedure recovers by the standard's own means.
    """

    command: EcatCommand
    address: int  # 32 bits as on the wire: ADP | ADO << 16, or the logical address
    data: bytes
    repeatable: bool
    alone: bool = False


class Reply(NamedTuple):
    data: bytes
    working_counter: int
    lost: bool = False  # no answer, or a repeatable request without one after all its repeats
    time_ns: int = 0  # when it was back, or given up; the link's clock


class After(NamedTuple):
    seconds: float


Step: TypeAlias = list[Request] | After
T = TypeVar("T")
V = TypeVar("V", int, bytes)
Procedure: TypeAlias = Generator[Step, list[Reply], T]


def after(seconds: float) -> After:
    """Let time pass on the link's clock [s]."""
    return After(seconds)


def physical(station: int, address: int) -> int:
    """The 32-bit address of a physical access: ADP in the low, ADO in the high word."""
    return (station & 0xFFFF) | (address & 0xFFFF) << 16


def read(command: EcatCommand, station: int, register: Register[V]) -> Request:
    """Reads one register; `station` is a station address, a negative position or 0 (broadcast)."""
    return Request(command, physical(station, register.address), bytes(register.size), True)


def write(
    command: EcatCommand, station: int, register: Register[V], value: V, *, repeatable: bool = True
) -> Request:
    """Writes one register."""
    return Request(command, physical(station, register.address), register.pack(value), repeatable)


def read_memory(station: int, address: int, size: int, *, repeatable: bool) -> Request:
    """Reads a device's memory by its station address (FPRD)."""
    return Request(EcatCommand.FPRD, physical(station, address), bytes(size), repeatable)


def write_memory(station: int, address: int, data: bytes, *, repeatable: bool) -> Request:
    """Writes a device's memory by its station address (FPWR)."""
    return Request(EcatCommand.FPWR, physical(station, address), data, repeatable)
