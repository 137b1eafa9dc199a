"""Procedures while a cycle runs: an acyclic queue of a few frames, one step per millisecond."""

from __future__ import annotations

import threading
from collections import deque

import pytest

from catenary.bus import AcyclicRunner, MainDevice
from catenary.errors import LoopError, ResponseTimeout, SdoAbort
from catenary.link import Link
from catenary.procedure.exchange import Procedure, after, read
from catenary.procedure.sdo import upload
from catenary.types import UDINT
from catenary.virtual import demo_segment
from catenary.wire.datagram import EcatCommand
from catenary.wire.frame import decode_frame
from catenary.wire.register import AL_STATUS

PERIOD_NS = 1_000_000


class AcyclicQueue:
    """Owns an acyclic queue on a virtual link. Pushed frames are sent with the next cycle."""

    def __init__(self, link: Link, *, slots: int = 64) -> None:
        self.link = link
        self.slots = slots
        self.lose: set[int] = set()
        self.pushed: list[bytes] = []
        self._queue: list[bytes] = []
        self._back: deque[bytes] = deque()

    def acyclic_push(self, frame: bytes) -> bool:
        if len(self._queue) >= self.slots:
            return False
        self._queue.append(frame)
        self.pushed.append(frame)
        return True

    def acyclic_pop(self) -> bytes | None:
        return self._back.popleft() if self._back else None

    def now(self) -> int:
        return self.link.now()

    def cycle(self) -> None:
        first = len(self.pushed) - len(self._queue)
        for number, frame in enumerate(self._queue, start=first):
            if number not in self.lose:
                self.link.send(frame)
        self._queue.clear()
        self.link.wait_until(self.link.now() + PERIOD_NS, False)
        while (frame := self.link.receive()) is not None:
            self._back.append(frame)


def settle(queue: AcyclicQueue, runner: AcyclicRunner, cycles: int = 5000) -> int:
    for number in range(cycles):
        if not runner.busy:
            return number
        runner.step()
        queue.cycle()
    raise AssertionError(f"still busy after {cycles} cycles")


def test_an_upload_takes_one_step_per_cycle() -> None:
    with MainDevice(demo_segment()) as main:
        [drive, *_] = main.scan().drives
        queue = AcyclicQueue(main.link)
        runner = AcyclicRunner(queue)
        task = runner.submit(upload(drive.channel, 0x1000, 0))
        cycles = settle(queue, runner)
        assert UDINT.decode(task.result()) & 0xFFFF == 402
        assert 3 <= cycles <= 12
        assert runner.counts.sent <= cycles


def test_many_procedures_share_the_frame_of_a_cycle() -> None:
    with MainDevice(demo_segment()) as main:
        subs = main.scan()
        queue = AcyclicQueue(main.link)
        runner = AcyclicRunner(queue)
        tasks = [runner.submit(_state(sub.station.address)) for sub in subs]
        settle(queue, runner)
        assert [task.result() for task in tasks] == [2] * 6
        [frame] = queue.pushed
        assert len(decode_frame(frame).datagrams) == 6
        assert all(datagram.index >= 0x80 for datagram in decode_frame(frame).datagrams)


def test_procedures_on_one_mailbox_take_turns() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        queue = AcyclicQueue(main.link)
        runner = AcyclicRunner(queue)
        places = [(0x1000, 0), (0x1018, 1), (0x1018, 2), (0x5FFF, 0), (0x1008, 0)]
        tasks = [runner.submit(upload(drive.channel, *place)) for place in places]
        settle(queue, runner)
        assert tasks[1].result() == UDINT.encode(drive.identity.vendor)
        assert tasks[2].result() == UDINT.encode(drive.identity.product)
        assert tasks[4].result() == b"Catenary virtual servo 1"
        with pytest.raises(SdoAbort):
            tasks[3].result()
        assert drive.channel.dropped == 0


def test_a_full_queue_delays_but_loses_nothing() -> None:
    with MainDevice(demo_segment()) as main:
        subs = main.scan()
        queue = AcyclicQueue(main.link, slots=0)
        runner = AcyclicRunner(queue)
        task = runner.submit(_state(subs[0].station.address))
        for _ in range(5):
            runner.step()
            queue.cycle()
        assert not task.done
        queue.slots = 1
        settle(queue, runner)
        assert task.result() == 2


def test_lost_frames_are_repeated_or_recovered() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        queue = AcyclicQueue(main.link)
        queue.lose = {0, 2, 4, 7}
        runner = AcyclicRunner(queue)
        task = runner.submit(upload(drive.channel, 0x1018, 1))
        settle(queue, runner)
        assert task.result() == UDINT.encode(drive.identity.vendor)
        assert runner.counts.lost >= 3


def test_procedures_on_a_lost_segment_end_in_time() -> None:
    segment = demo_segment()
    with MainDevice(segment) as main:
        drive = main.scan()[2]
        segment.unplug()
        queue = AcyclicQueue(main.link)
        runner = AcyclicRunner(queue)
        task = runner.submit(upload(drive.channel, 0x1018, 1))
        assert settle(queue, runner) < 2000
        with pytest.raises(ResponseTimeout, match="device 2"):
            task.result()


def test_a_blocking_call_in_the_loops_thread_raises_at_once() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        queue = AcyclicQueue(main.link)
        with (
            main.attached(AcyclicRunner(queue)),
            pytest.raises(RuntimeError, match="in the loop's thread"),
        ):
            drive.sdo.read(0x1000)
        assert queue.pushed == []
        assert drive.sdo.read(0x1000)  # the loop has ended


def test_a_scan_is_refused_while_a_loop_runs() -> None:
    with MainDevice(demo_segment()) as main:
        main.scan()
        with (
            main.attached(AcyclicRunner(AcyclicQueue(main.link))),
            pytest.raises(RuntimeError, match="a loop runs on this MainDevice"),
        ):
            main.scan()


def test_another_thread_reads_while_the_loop_runs() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        queue = AcyclicQueue(main.link)
        runner = AcyclicRunner(queue)
        found: list[int] = []
        with main.attached(runner):
            thread = threading.Thread(
                target=lambda: found.append(drive.sdo.read(0x1018, 1, type=UDINT))
            )
            thread.start()
            while thread.is_alive():  # each step is a cycle of virtual time
                runner.step()
                queue.cycle()
                thread.join(0.001)
        assert found == [drive.identity.vendor]


def test_closing_ends_waiting_calls() -> None:
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        runner = AcyclicRunner(AcyclicQueue(main.link))
        failures: list[BaseException] = []

        def ask() -> None:
            try:
                runner.run(upload(drive.channel, 0x1000, 0))
            except LoopError as error:
                failures.append(error)

        thread = threading.Thread(target=ask)
        thread.start()
        while not runner.busy:
            thread.join(0.001)
        runner.close()
        thread.join(10.0)
        assert len(failures) == 1
        with pytest.raises(LoopError, match="loop ended"):
            runner.submit(upload(drive.channel, 0x1000, 0))


def test_pauses_use_the_clock_of_the_queue() -> None:
    with demo_segment().open_link() as link:
        queue = AcyclicQueue(link)
        runner = AcyclicRunner(queue)

        def waits() -> Procedure[str]:
            yield after(0.020)
            return "done"

        task = runner.submit(waits())
        assert 19 <= settle(queue, runner) <= 22
        assert task.result() == "done"


def _state(station: int) -> Procedure[int]:
    [reply] = yield [read(EcatCommand.FPRD, station, AL_STATUS)]
    return AL_STATUS.unpack(reply.data)


def test_a_starting_loop_waits_for_running_procedures() -> None:
    """Only one thread uses the link. A running procedure finishes first; a later one is queued."""
    with MainDevice(demo_segment()) as main:
        drive = main.scan()[2]
        queue = AcyclicQueue(main.link)
        runner = AcyclicRunner(queue)
        talking, go_on = threading.Event(), threading.Event()
        order: list[str] = []

        def talks() -> Procedure[None]:
            yield [read(EcatCommand.FPRD, drive.station.address, AL_STATUS)]
            talking.set()
            go_on.wait(60.0)
            yield [read(EcatCommand.FPRD, drive.station.address, AL_STATUS)]
            order.append("talked")

        first = threading.Thread(target=main.converse, args=(talks(),))
        first.start()
        assert talking.wait(60.0)
        late: list[int] = []
        second = threading.Thread(target=lambda: late.append(drive.sdo.read(0x1018, 1, type=UDINT)))
        second.start()  # waits for the first one on the blocking runner, or starts later
        threading.Timer(0.02, go_on.set).start()
        with main.attached(runner):
            order.append("attached")
            while second.is_alive():
                runner.step()
                queue.cycle()
                second.join(0.001)
        first.join()
        assert order == ["talked", "attached"]
        assert late == [drive.identity.vendor]


def test_without_a_queue_procedures_are_refused_while_a_loop_runs() -> None:
    with MainDevice(demo_segment()) as main:
        main.scan()
        blocking = main.runner
        with (
            main.attached(AcyclicRunner(AcyclicQueue(main.link))),
            pytest.raises(RuntimeError, match="a loop uses the link"),
        ):
            blocking.run(_state(0x1001))
