"""While a drive moves, its files are read and written. The device answers wrongly, twice, or not
at all. Each transfer ends in time with a specific error, no cycle is lost, and the next
transfer and the objects of the device work again.
"""

import struct
from collections.abc import Callable

import pytest

import catenary as cat
from catenary.bus import Pending
from catenary.errors import CatenaryError, FoeError, MailboxError, ResponseTimeout
from catenary.types import UDINT
from catenary.virtual import Coupler, DeviceFiles, Segment, Servo
from catenary.virtual.foe.server import FileServer

ROOM = 128 - 12
CONTENT = bytes(k * 5 & 0xFF for k in range(20 * ROOM))
ACK = 4


class Line:
    """Segment of a coupler and a servo with files, and a loop that moves the servo."""

    def __init__(self, **files: object) -> None:
        contents = {"log": CONTENT}
        self.servo = Servo(files=DeviceFiles(contents=contents, **files))  # type: ignore[arg-type]
        self.segment = Segment([Coupler(), self.servo])

    def run(self, begin: Callable[[cat.bus.SubDevice], Pending[bytes] | Pending[None]]) -> object:
        """Run a transfer while the servo moves. Return its result or its error.

        Afterwards, an object and a file are read.
        """
        with cat.MainDevice(self.segment) as main:
            sub = main.scan()[1]
            arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=100.0)
            with cat.Loop(arm, period=1e-3) as loop:
                move = arm.move_by(0.5)
                transfer = self._wait(loop, begin(sub))
                serial = self._wait(loop, sub.sdo.request(0x1018, 4, type=UDINT))
                again = self._wait(loop, sub.foe.request("log"))
                loop.wait(move)
                assert loop.timing.counters["lost"] == 0
                assert self.servo.drive_state() == "OPERATION ENABLED"
        assert serial.result() == 0
        if self.servo.files is not None and not self.servo.files.busy:
            assert again.result() == CONTENT
        return transfer.error or transfer.result()

    def _wait(self, loop: cat.Loop, pending: Pending[object]) -> Pending[object]:
        for _ in loop:
            if pending.done:
                break
        return pending


Answers = Callable[[bytes, list[bytes]], list[bytes]]


@pytest.fixture
def tamper(monkeypatch: pytest.MonkeyPatch) -> Callable[[Answers], None]:
    """Return a function that changes the answers of all file servers, for one transfer."""
    honest = FileServer.serve

    def install(change: Answers) -> None:
        def serve(server: FileServer, payload: bytes) -> list[bytes]:
            return change(payload, honest(server, payload))

        monkeypatch.setattr(FileServer, "serve", serve)

    return install


def test_files_are_transferred_while_the_servo_moves() -> None:
    assert Line().run(lambda sub: sub.foe.request("log")) == CONTENT
    line = Line()
    assert line.run(lambda sub: sub.foe.request_write("new", CONTENT)) is None
    assert line.servo.store.files["new"] == CONTENT


def test_a_refused_file() -> None:
    error = Line(write_protected=("log",)).run(lambda sub: sub.foe.request_write("log", b"x"))
    assert isinstance(error, FoeError)
    assert error.code == 0x8002


def once(number: int, change: Callable[[bytes], list[bytes]]) -> Answers:
    """Return answers of which the one with this number (from 0) is changed, once."""
    seen = iter(range(1_000_000))

    def answers(_: bytes, honest: list[bytes]) -> list[bytes]:
        return change(honest[0]) if honest and next(seen) == number else honest

    return answers


WRONG = {
    "wrong packet number": (
        lambda answer: [struct.pack("<BxI", answer[0], 999) + answer[6:]],
        MailboxError,
    ),
    "other op-code": (lambda _: [struct.pack("<BxI", ACK, 7)], MailboxError),
    "unknown op-code": (lambda _: [bytes([77]) + bytes(20)], MailboxError),
    "too short": (lambda _: [b"\x03"], MailboxError),
    "no answer": (lambda _: [], ResponseTimeout),
}


@pytest.mark.parametrize(("change", "error"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_answer_ends_the_transfer_and_nothing_else(
    change: Callable[[bytes], list[bytes]],
    error: type[CatenaryError],
    tamper: Callable[[Answers], None],
) -> None:
    tamper(once(4, change))
    assert isinstance(Line().run(lambda sub: sub.foe.request("log")), error)


def test_a_flood_of_duplicates_is_dropped(tamper: Callable[[Answers], None]) -> None:
    tamper(once(4, lambda answer: [answer] * 40))
    assert Line().run(lambda sub: sub.foe.request("log")) == CONTENT


def test_duplicates_do_not_change_the_file(tamper: Callable[[Answers], None]) -> None:
    tamper(lambda _, honest: honest * 2)
    assert Line().run(lambda sub: sub.foe.request("log")) == CONTENT


def test_a_device_that_stays_busy() -> None:
    error = Line(busy=1 << 40).run(lambda sub: sub.foe.request("log"))
    assert isinstance(error, ResponseTimeout)
    assert "has been busy for 120 s" in error.message
