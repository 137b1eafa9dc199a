"""Interface between a procedure and its runner: datagrams to exchange, or a time to wait.

A procedure is a generator. It yields a list of requests and is resumed with the list of replies, in
the same order. To wait, it yields `after(seconds)` and is resumed with an empty list after that
time. It neither sleeps nor accesses a link; its runner does, and also repeats lost requests. The
`return` value is the result. The only clock is the time in the replies (`Reply.time_ns`, the link's
clock).

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

    If the request is lost and `repeatable`, the runner sends it again. Otherwise the procedure
    receives a lost reply and recovers as the standard specifies. A request with `alone` gets a
    separate frame.
    """

    command: EcatCommand
    address: int  # 32 bits as on the wire: ADP | ADO << 16, or the logical address
    data: bytes
    repeatable: bool
    alone: bool = False


class Reply(NamedTuple):
    """The reply to one request."""

    data: bytes
    working_counter: int
    lost: bool = False  # no answer; for a repeatable request, not even after all repetitions
    time_ns: int = 0  # time of its arrival or timeout, on the link's clock


class After(NamedTuple):
    """A step that waits on the link's clock."""

    seconds: float


Step: TypeAlias = list[Request] | After
T = TypeVar("T")
V = TypeVar("V", int, bytes)
Procedure: TypeAlias = Generator[Step, list[Reply], T]


def after(seconds: float) -> After:
    """Return the step that waits for `seconds` on the link's clock [s]."""
    return After(seconds)


def physical(station: int, address: int) -> int:
    """Return the 32-bit address of a physical access: ADP in the low, ADO in the high word.

    Args:
        station: Station address, negative position, or 0 for a broadcast.
        address: Address in the device's memory.
    """
    return (station & 0xFFFF) | (address & 0xFFFF) << 16


def read(command: EcatCommand, station: int, register: Register[V]) -> Request:
    """Return the request to read one register.

    Args:
        command: The command, such as FPRD.
        station: Station address, negative position, or 0 for a broadcast.
        register: The register.
    """
    return Request(command, physical(station, register.address), bytes(register.size), True)


def write(
    command: EcatCommand, station: int, register: Register[V], value: V, *, repeatable: bool = True
) -> Request:
    """Return the request to write one register.

    Args:
        command: The command, such as FPWR.
        station: Station address, negative position, or 0 for a broadcast.
        register: The register.
        value: The value to write.
        repeatable: True if a lost request may be sent again.
    """
    return Request(command, physical(station, register.address), register.pack(value), repeatable)


def read_memory(station: int, address: int, size: int, *, repeatable: bool) -> Request:
    """Return the request to read a device's memory by its station address (FPRD).

    Args:
        station: The station address.
        address: Address of the first byte.
        size: Number of bytes.
        repeatable: True if a lost request may be sent again.
    """
    return Request(EcatCommand.FPRD, physical(station, address), bytes(size), repeatable)


def write_memory(station: int, address: int, data: bytes, *, repeatable: bool) -> Request:
    """Return the request to write a device's memory by its station address (FPWR).

    Args:
        station: The station address.
        address: Address of the first byte.
        data: The bytes to write.
        repeatable: True if a lost request may be sent again.
    """
    return Request(EcatCommand.FPWR, physical(station, address), data, repeatable)
