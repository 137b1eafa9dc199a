"""A port of a ring that is closed during a measurement."""

from __future__ import annotations

import pytest

from catenary.errors import ClockError, ResponseTimeout
from catenary.procedure.exchange import Procedure, Reply, Request
from catenary.procedure.open_ring import as_line
from catenary.procedure.station import Station
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import AL_STATUS, DL_CONTROL, DL_STATUS

STATION = Station(5, 0x1006)
BEFORE = 0x0107_0001  # alias enabled, the FIFO of power-up, alien frames destroyed
CLOSED_1 = 3 << 10
TEMPORARY = 2


class Controller:
    """Owner of a DL control register. Its port 1 opens again after `patience` requests."""

    def __init__(self, patience: int = 100) -> None:
        self.control, self.patience, self.seen = BEFORE, patience, []  # type: ignore[var-annotated]
        self.hesitates = 0  # number of reads of DL status before the port is closed

    def answer(self, request: Request) -> Reply:
        register = request.address >> 16
        if request.command is EcatCommand.FPWR:
            assert register == DL_CONTROL.address
            self.control = DL_CONTROL.unpack(request.data)
            self.seen.append(self.control)
            return Reply(request.data, 1)
        self.patience -= 1
        if register == DL_CONTROL.address:
            return Reply(DL_CONTROL.pack(self.control), 1)
        assert register == DL_STATUS.address
        self.hesitates -= 1
        closed = self.control & CLOSED_1 == CLOSED_1 and self.patience > 0 and self.hesitates < 0
        return Reply(DL_STATUS.pack(0x0400 if closed else 0x0800), 1)


def play(procedure: Procedure[int], controller: Controller) -> int:
    replies: list[Reply] | None = None
    try:
        while True:
            step = next(procedure) if replies is None else procedure.send(replies)
            replies = [controller.answer(each) for each in step] if isinstance(step, list) else []
    except StopIteration as stop:
        return int(stop.value)


def seven() -> Procedure[int]:
    yield []
    return 7


def silent() -> Procedure[int]:
    yield []
    raise ResponseTimeout(f"no {AL_STATUS.name}")


def test_the_port_is_closed_during_the_procedure() -> None:
    controller = Controller()
    assert play(as_line(STATION, 1, seven()), controller) == 7
    assert controller.seen == [BEFORE | CLOSED_1 | TEMPORARY, BEFORE]


def test_the_port_opens_again_if_the_measurement_fails() -> None:
    controller = Controller()
    with pytest.raises(ResponseTimeout):
        play(as_line(STATION, 1, silent()), controller)
    assert controller.seen[-1] == BEFORE


def test_a_port_that_opened_early_invalidates_the_measurement() -> None:
    controller = Controller(patience=3)
    with pytest.raises(ClockError, match="did not stay closed"):
        play(as_line(STATION, 1, seven()), controller)
    assert controller.seen[-1] == BEFORE


def test_a_port_that_cannot_be_closed_is_an_error() -> None:
    controller = Controller(patience=0)
    with pytest.raises(
        ClockError, match="port 1, the second end of the ring, cannot be closed"
    ) as e:
        play(as_line(STATION, 1, seven()), controller)
    assert "processor" not in e.value.hint
    assert "use a line" in e.value.hint
    assert controller.seen[-1] == BEFORE


def test_a_port_may_close_slowly() -> None:
    controller = Controller()
    controller.hesitates = 3
    assert play(as_line(STATION, 1, seven()), controller) == 7
