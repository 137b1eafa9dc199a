"""Temporary operation of a ring as a line, for measurements, ETG.1000.4 §6.2.

The port at the second end of the ring is closed (register 0x0100). Frames then turn back there
and pass every port.
"""

from __future__ import annotations

from typing import TypeVar

from catenary.errors import CatenaryError, ClockError
from catenary.procedure.exchange import Procedure, after, read, write
from catenary.procedure.station import Station, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.dl import DlStatus, Loop
from catenary.wire.register import DL_CONTROL, DL_STATUS

T = TypeVar("T")

TEMPORARY = 1 << 1  # the settings expire after about a second, even if the program is killed
LOOPS = 8  # first bit of the loop settings, for port 0
POLLS, PAUSE = 10, 1e-3  # polls, and [s] between them: a port closes at the end of a frame


def as_line(station: Station, port: int, procedure: Procedure[T]) -> Procedure[T]:
    """Run a procedure while a port is closed, then open the port again.

    Args:
        station: The device at the second end of the ring.
        port: The port to close.
        procedure: The procedure to run.

    Raises:
        ClockError: The port cannot be closed, or it opened before the procedure ended. The
            measurement is then invalid.
    """
    [reply] = yield [read(EcatCommand.FPRD, station.address, DL_CONTROL)]
    before = DL_CONTROL.unpack(answered(reply, station, "DL control"))
    closed = before | Loop.CLOSED << LOOPS + 2 * port
    yield from _write(station, closed | TEMPORARY)
    try:
        yield from _await_closed(station, port)
        result = yield from procedure
    except CatenaryError:
        yield from _write(station, before & ~TEMPORARY)
        raise
    still_closed = yield from _is_closed(station, port)
    yield from _write(station, before & ~TEMPORARY)
    if not still_closed:
        raise ClockError(
            f"{station}: port {port}, the second end of the ring, did not stay closed while the "
            "delays were measured",
            hint="it opens automatically after a second: reserve a processor core for the program",
        )
    return result


def _await_closed(station: Station, port: int) -> Procedure[None]:
    for _ in range(POLLS):
        if (yield from _is_closed(station, port)):
            return
        yield after(PAUSE)
    raise ClockError(
        f"{station}: port {port}, the second end of the ring, cannot be closed: DL control "
        "(0x0100) was written, but DL status (0x0110) still shows an open loop",
        hint="its controller lacks loop control, so delays cannot be measured in this ring: "
        "put another device at the second end, or use a line with one interface",
    )


def _is_closed(station: Station, port: int) -> Procedure[bool]:
    [reply] = yield [read(EcatCommand.FPRD, station.address, DL_STATUS)]
    status = DlStatus.from_word(DL_STATUS.unpack(answered(reply, station, "DL status")))
    return status.ports[port].loop_closed


def _write(station: Station, control: int) -> Procedure[None]:
    [reply] = yield [write(EcatCommand.FPWR, station.address, DL_CONTROL, control)]
    answered(reply, station, "DL control")
