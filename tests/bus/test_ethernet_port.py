"""EthernetPort and EthernetBridge: failures of their threads, of a loop and of the TAP."""

from __future__ import annotations

import sys
import threading
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from catenary.bus.ethernet_bridge import EthernetBridge
from catenary.bus.ethernet_port import EthernetPort
from catenary.bus.mac_table import PER_PORT_MAX, MacTable
from catenary.bus.pending import Pending
from catenary.bus.procedure_run import Task
from catenary.errors import CatenaryError, LoopError, ResponseTimeout, TapError
from catenary.model.device import MailboxLayout
from catenary.procedure.mailbox_channel import MailboxChannel
from catenary.procedure.station import Station
from catenary.wire.sii import MailboxProtocol
from tests.ethernet_wire import SECONDS, Wire
from tests.virtual.ethernet_frames import ARP_REQUEST


class Device:
    """A device with a mailbox, without a segment."""

    position, in_boot = 3, False
    channel = MailboxChannel(
        Station(3, 0x1004), MailboxLayout(0x1000, 128, 0x1080, 128, MailboxProtocol.EOE)
    )


class Main:
    """Fails with the given errors in turn. Then no message moves."""

    is_open = True

    def __init__(self, *errors: Exception) -> None:
        self.errors = list(errors)
        self.attempts = 0
        self.quiet = threading.Event()  # set after all errors

    def request(self, procedure: Any) -> Pending[Any]:
        procedure.close()
        self.attempts += 1
        if self.errors:
            raise self.errors.pop(0)
        self.quiet.set()
        return _done()


def _done() -> Pending[Any]:
    def nothing() -> Iterator[Any]:
        yield from ()
        return False  # type: ignore[return-value]

    pending: Pending[Any] = Pending(Task(nothing()))  # type: ignore[arg-type]
    pending.task.start(0)
    pending.finish()
    return pending


def port_of(main: Main, reports: list[Counter[str]]) -> EthernetPort:
    return EthernetPort(
        Device(),
        main,
        lambda *_: True,
        threading.BoundedSemaphore(1),
        lambda new, error: reports.append(new),
    )


def test_waiting_frames_do_not_shorten_the_pause_after_a_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("catenary.bus.ethernet_port.RETRY_PAUSE", SECONDS)
    failed = threading.Event()
    main = Main(ResponseTimeout("no answer"))
    port = EthernetPort(
        Device(), main, lambda *_: True, threading.BoundedSemaphore(1), lambda *_: failed.set()
    )
    port.start()
    assert failed.wait(SECONDS)
    for _ in range(3):
        port.send(ARP_REQUEST)
    assert not main.quiet.wait(0.1)
    port.close()  # does not wait for the end of the pause
    assert main.attempts == 1


def test_the_end_of_a_loop_is_not_a_failure() -> None:
    reports: list[Counter[str]] = []
    main = Main(LoopError("the loop ended"))
    port = port_of(main, reports)
    port.start()
    assert main.quiet.wait(SECONDS)
    port.close()
    assert port.error is None
    assert not port.counts.dropped
    assert not reports


def test_a_failure_without_frames_is_reported_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.bus.ethernet_port.RETRY_PAUSE", 0.0)
    main = Main(*[ResponseTimeout("no answer")] * 5)
    port = port_of(main, [])
    port.start()
    assert main.quiet.wait(SECONDS)
    port.close()
    assert port.counts.dropped == {"the device does not answer": 1}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_unexpected_end_of_the_thread_is_shown() -> None:
    port = port_of(Main(ZeroDivisionError("a fault")), [])
    port.start()
    port._thread.join(SECONDS)
    assert "ended: ZeroDivisionError('a fault')" in str(port.error)
    port.close()


def test_statistics_are_a_copy() -> None:
    port = port_of(Main(), [])
    before = port.counts
    port.send(b"short")
    assert not before.dropped
    assert port.counts.dropped == {"too short or too long for an Ethernet frame": 1}


class Deleted(Wire):
    """An interface that was deleted."""

    def wait(self, seconds: float | None = None) -> bool:
        return True

    def read(self) -> bytes | None:
        raise TapError("the interface wire was deleted")


def test_a_deleted_interface_is_shown_and_reported() -> None:
    reported = threading.Event()

    def report(sub: Device, new: Counter[str], error: CatenaryError | None) -> None:
        assert sub is device
        assert new == {"TAP interface down or deleted": 1}
        reported.set()

    device = Device()
    with EthernetBridge(Main(), [device], Deleted(), report=report) as bridge:
        assert reported.wait(SECONDS)
        assert bridge.errors == {3: "the interface wire was deleted"}


def test_several_threads_change_a_table() -> None:
    table: MacTable[str] = MacTable()
    failures: list[BaseException] = []

    def learn(port: str) -> None:
        try:
            for number in range(20_000):
                table.learn(bytes((2, ord(port))) + (number % 50).to_bytes(4, "big"), port)
        except BaseException as error:
            failures.append(error)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=learn, args=(port,)) for port in "abc"]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
    finally:
        sys.setswitchinterval(interval)
    assert not failures
    assert len(table) == 3 * PER_PORT_MAX
