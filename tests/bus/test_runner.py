"""The blocking runner on a bad cable: lost, late, duplicate, corrupt and alien frames."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.bus import BlockingRunner, MainDevice
from catenary.errors import CatenaryError
from catenary.procedure.exchange import Procedure, after, read
from catenary.types import VISIBLE_STRING
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import AL_STATUS, DL_STATUS
from tests.bus.links import Echo, meddled

ALIEN = b"\xff" * 6 + b"\x02" * 6 + b"\x08\x00" + bytes(46)  # IPv4


def small_segment() -> Segment:
    return Segment([Coupler(), Servo(name="Elbow"), DigitalOutputs()])


def bring_up_and_ask(main: MainDevice) -> str:
    return main.scan()[1].sdo.read(0x1008, 0, type=VISIBLE_STRING)


def test_loss_of_every_seventh_frame() -> None:
    link = meddled(small_segment(), lambda k, frame: [] if k % 7 == 3 else [frame])
    with MainDevice(link) as main:
        assert bring_up_and_ask(main) == "Elbow"
        assert main.counts.lost > 5


@settings(max_examples=25, deadline=None)
@given(st.sets(st.integers(0, 400), max_size=30))
def test_loss_of_any_frames(lost: set[int]) -> None:
    link = meddled(small_segment(), lambda k, frame: [] if k in lost else [frame])
    # An error is allowed only after several consecutive losses.
    with contextlib.suppress(CatenaryError), MainDevice(link) as main:
        assert bring_up_and_ask(main) == "Elbow"


def test_duplicate_alien_and_corrupt_frames_are_only_counted() -> None:
    def meddle(k: int, frame: bytes) -> list[bytes]:
        spoiled = frame[:20] + bytes([frame[20] ^ 0x40]) + frame[21:]
        return [ALIEN, frame[:17], spoiled, frame, frame]

    with MainDevice(meddled(small_segment(), meddle)) as main:
        assert bring_up_and_ask(main) == "Elbow"
        counts = main.counts
        assert counts.alien > 100
        assert counts.stale > 100
        assert counts.lost == 0


def test_a_flood_of_alien_frames_does_not_extend_a_deadline() -> None:
    link = meddled(small_segment(), lambda k, frame: [ALIEN] * 10_000)
    with MainDevice(link) as main, pytest.raises(CatenaryError):
        main.scan()


class Halting(Echo):
    """Link of a program that is halted beyond any deadline at each reading of the clock."""

    def now(self) -> int:
        self._now += 200_000_000
        return self._now


def test_answers_received_while_the_program_was_halted_are_not_lost() -> None:
    def asks() -> Procedure[bool]:
        [reply] = yield [read(EcatCommand.BRD, 0, AL_STATUS)]
        return reply.lost

    runner = BlockingRunner(Halting())
    assert runner.run_all([asks() for _ in range(200)]) == [False] * 200
    assert runner.counts.lost == 0


def test_many_procedures_share_frames() -> None:
    with MainDevice(Segment([DigitalOutputs() for _ in range(50)])) as main:
        main.scan()
        runner = BlockingRunner(main.link)
        states = runner.run_all([_state(0x1001 + k) for k in range(50)])
        assert states == [2] * 50
        assert runner.counts.sent == 1


def test_other_procedures_finish_before_an_error_is_raised() -> None:
    finished: list[str] = []

    def fails() -> Procedure[None]:
        yield [read(EcatCommand.BRD, 0, AL_STATUS)]
        raise ValueError("first")

    def goes_on() -> Procedure[None]:
        yield after(0.5)
        yield [read(EcatCommand.BRD, 0, DL_STATUS)]
        finished.append("second")

    with pytest.raises(ValueError, match="first"):
        BlockingRunner(Echo()).run_all([fails(), goes_on()])
    assert finished == ["second"]


def test_an_interrupt_ends_the_procedures() -> None:
    ended: list[bool] = []

    def interrupted() -> Procedure[None]:
        try:
            yield [read(EcatCommand.BRD, 0, AL_STATUS)]
            raise KeyboardInterrupt
        finally:
            ended.append(True)

    def waits() -> Procedure[None]:
        try:
            yield after(100.0)
        finally:
            ended.append(True)

    with pytest.raises(KeyboardInterrupt):
        BlockingRunner(Echo()).run_all([waits(), interrupted()])
    assert ended == [True, True]


def test_time_passes_on_the_links_clock() -> None:
    link = Echo()

    def waits() -> Procedure[str]:
        yield after(2.5)
        return "done"

    assert BlockingRunner(link).run(waits()) == "done"
    assert 2.5e9 <= link.now() < 2.6e9


def _state(station: int) -> Procedure[int]:
    [reply] = yield [read(EcatCommand.FPRD, station, AL_STATUS)]
    return AL_STATUS.unpack(reply.data)
