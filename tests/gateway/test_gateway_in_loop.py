"""The gateway beside a running loop, in virtual time: transfers, and the policy of axes."""

from __future__ import annotations

import dataclasses
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from catenary.virtual import Servo
from tests.gateway.line import CONTENT, Line
from tests.gateway.tool import COE, ERROR, FOE, SOE, Aborted, Tool

ENABLED = 0x08000022
DISABLE_VOLTAGE, CSV = bytes(2), b"\x09"


class Beside:
    """Runs a tool in a thread while this thread iterates the loop."""

    def __init__(self, line: Line, loop: cat.Loop) -> None:
        self.line, self.loop = line, loop

    def run(self, work: Callable[[Tool], object], *, address: int = 0x1002) -> object:
        results: list[object] = []

        def use() -> None:
            try:
                with self.line.tool(address=address) as tool:
                    results.append(work(tool))
            except Exception as error:
                results.append(error)

        thread = threading.Thread(target=use)
        thread.start()
        for _ in self.loop:
            if not thread.is_alive():
                break
        thread.join()
        [result] = results
        if isinstance(result, Exception):
            raise result
        return result


@pytest.fixture(autouse=True)
def long_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long for the client: its thread and the loop in virtual time share the processor."""
    monkeypatch.setattr("catenary.gateway.lease.LEASE_IDLE", 30.0)


@pytest.fixture
def beside(line: Line) -> Iterator[Beside]:
    """Yield a loop with the enabled axes of both servos."""
    with cat.Loop(line.arm(), period=1e-3) as loop:
        yield Beside(line, loop)
        assert loop.timing.counters["lost"] == 0
        assert [servo.drive_state() for servo in line.servos] == ["OPERATION ENABLED"] * 2


def test_reads_pass_while_the_axes_are_enabled(beside: Beside) -> None:
    assert len(beside.run(Tool.object_list)) > 60
    assert beside.run(lambda tool: tool.read_file("log")) == CONTENT
    assert len(beside.run(lambda tool: tool.upload(0x2100))) == 2048
    assert beside.run(lambda tool: tool.upload(0x6041))[0] & 0x6F == 0x27


def test_a_harmless_write_passes(beside: Beside) -> None:
    beside.run(lambda tool: tool.download(0x6065, 0, struct.pack("<I", 5000)))
    assert beside.run(lambda tool: tool.upload(0x6065)) == struct.pack("<I", 5000)
    [event] = beside.line.writes
    assert event.time > 0
    assert event.result == "done"


DANGEROUS: dict[str, Callable[[Tool], object]] = {
    "controlword": lambda tool: tool.download(0x6040, 0, DISABLE_VOLTAGE),
    "controlword, segments": lambda tool: tool.begin_download(0x6040, 0, 2),
    "controlword, complete": lambda tool: tool.download(0x6040, 0, bytes(2), complete=True),
    "mode": lambda tool: tool.download(0x6060, 0, CSV),
    "other axis": lambda tool: tool.download(0x6840, 0, DISABLE_VOLTAGE),
    "target": lambda tool: tool.download(0x607A, 0, bytes(4)),
    "assignment": lambda tool: tool.download(0x1C12, 0, bytes(1)),
    "assignment, complete": lambda tool: tool.begin_download(0x1C12, 0, 4, complete=True),
    "RxPDO": lambda tool: tool.download(0x1600, 0, bytes(1)),
    "TxPDO": lambda tool: tool.download(0x1A00, 0, bytes(1)),
    "file": lambda tool: tool.write_file("app", bytes(500)),
    "SoE": lambda tool: tool.ask(SOE, bytes(10)),
    "RxPDO over CoE": lambda tool: tool.ask(COE, struct.pack("<H", 5 << 12) + bytes(8)),
}


@pytest.mark.parametrize("write", DANGEROUS.values(), ids=DANGEROUS.keys())
def test_a_dangerous_write_is_refused(beside: Beside, write: Callable[[Tool], object]) -> None:
    with pytest.raises(Aborted) as caught:
        beside.run(write)
    assert (caught.value.kind, caught.value.code) in (
        (COE, ENABLED),
        (FOE, 0x8002),
        (ERROR, 4),
    )
    assert beside.line.gateway.counts.refused == 1
    assert beside.line.writes == []


def test_it_passes_when_the_axes_are_disabled(line: Line) -> None:
    arm = line.arm()
    with cat.Loop(arm, period=1e-3, enable=False) as loop:
        beside = Beside(line, loop)
        beside.run(lambda tool: tool.write_file("app", CONTENT))
        assert line.servos[0].store.files["app"] == CONTENT
        arm.enable()
        with pytest.raises(Aborted):
            beside.run(lambda tool: tool.write_file("app", CONTENT))


def test_a_transfer_ends_when_an_axis_is_enabled(line: Line) -> None:
    """The check of the first message does not count for the rest of a transfer."""
    arm = line.arm()
    with cat.Loop(arm, period=1e-3, enable=False) as loop:
        beside = Beside(line, loop)
        with line.tool() as tool:
            beside.run(lambda _: tool.begin_download(0x6060, 0, 1))
            arm.enable()
            with pytest.raises(Aborted) as caught:
                beside.run(lambda _: tool.segment(CSV, last=True))
            assert caught.value.code == ENABLED
    [event] = line.writes
    assert "enabled" in event.result


def test_an_axis_that_the_loop_does_not_know(line: Line) -> None:
    """A program controls a drive by its process data. The statusword of the device decides."""
    servo: Servo = line.servos[0]
    words = cat.ProcessData(line.main.subs[1])
    with cat.Loop(words, period=1e-3) as loop:
        beside = Beside(line, loop)
        for word in (0x06, 0x07, 0x0F):
            words["Controlword"] = word
            loop.run_for(0.05)
        assert servo.drive_state() == "OPERATION ENABLED"
        with pytest.raises(Aborted) as caught:
            beside.run(lambda tool: tool.download(0x6060, 0, CSV))
        assert caught.value.code == ENABLED
        words["Controlword"] = 0
        loop.run_for(0.05)
        beside.run(lambda tool: tool.download(0x6060, 0, CSV))
    [event] = line.writes
    assert event.index == 0x6060


def test_an_enabled_axis_of_another_device_counts(line: Line) -> None:
    other = cat.Drives([line.main.subs[2]], counts_per_turn=2**20, velocity_limit=100.0)
    with cat.Loop(other, period=1e-3) as loop:
        beside = Beside(line, loop)
        for write in (
            lambda tool: tool.download(0x6060, 0, CSV),
            lambda tool: tool.download(0x1C12, 0, bytes(1)),
            lambda tool: tool.write_file("app", CONTENT),
        ):
            with pytest.raises(Aborted):
                beside.run(write)
        other.disable()
        loop.run_for(0.1)
        beside.run(lambda tool: tool.download(0x6060, 0, CSV))
    [event] = line.writes
    assert event.index == 0x6060


def test_a_new_mailbox_releases_the_former_one(line: Line) -> None:
    """The ticket of a transfer must not block the mailbox, for example that of PRE-OP in BOOT."""
    with cat.Loop(line.arm(), period=1e-3, enable=False) as loop:
        beside = Beside(line, loop)
        sub = line.main.subs[1]
        former = sub.channel
        with line.tool() as tool:
            beside.run(lambda _: tool.begin_download(0x6065, 0, 4))
            assert len(former.turns) == 1
            sub.channel = dataclasses.replace(former, turns=deque())
            assert beside.run(lambda _: tool.upload(0x1018, 4)) == bytes(4)
            assert len(former.turns) == 0
    [event] = line.writes
    assert event.result == "not completed: the device has another mailbox now"


def test_before_during_and_after_a_loop(line: Line) -> None:
    with line.tool() as tool:
        assert tool.upload(0x1018, 4) == bytes(4)
        with cat.Loop(line.arm(), period=1e-3) as loop:
            assert Beside(line, loop).run(lambda _: tool.upload(0x1018, 4)) == bytes(4)
        assert tool.upload(0x1018, 4) == bytes(4)
