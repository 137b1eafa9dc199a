"""A ring that is a line while something is measured: the port at its second end is closed, register
0x0100, ETG.1000.4 §6.2, so that frames turn round there and come back through every port."""

from __future__ import annotations

from typing import TypeVar

from catenary.errors import CatenaryError, ClockError
from catenary.procedure.exchange import Procedure, read, write
from catenary.procedure.station import Station, answered
from catenary.wire.datagram import Command
from catenary.wire.dl import DlStatus, Loop
from catenary.wire.register import DL_CONTROL, DL_STATUS

T = TypeVar("T")

TEMPORARY = 1 << 1  # the loops return to what they were after about a second: also if we are killed
LOOPS = 8  # the first bit of port 0's


def as_line(station: Station, port: int, procedure: Procedure[T]) -> Procedure[T]:
    """Runs `procedure` with a port closed, and opens it again. ClockError where that took longer
    than the device keeps it closed: what was measured then counts for nothing."""
    [reply] = yield [read(Command.FPRD, station.address, DL_CONTROL)]
    before = DL_CONTROL.unpack(answered(reply, station, "DL control"))
    closed = before | Loop.CLOSED << LOOPS + 2 * port
    yield from _write(station, closed | TEMPORARY)
    try:
        result = yield from procedure
    except CatenaryError:
        yield from _write(station, before & ~TEMPORARY)
        raise
    [reply] = yield [read(Command.FPRD, station.address, DL_STATUS)]
    status = DlStatus.from_word(DL_STATUS.unpack(answered(reply, station, "DL status")))
    yield from _write(station, before & ~TEMPORARY)
    if not status.ports[port].loop_closed:
        raise ClockError(
            f"{station}: port {port}, the second end of the ring, did not stay closed while the "
            "delays were measured",
            hint="it does so for a second: give the program a processor of its own",
        )
    return result


def _write(station: Station, control: int) -> Procedure[None]:
    [reply] = yield [write(Command.FPWR, station.address, DL_CONTROL, control)]
    answered(reply, station, "DL control")
