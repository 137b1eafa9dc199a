"""Recording from a share to a file: lost cycles are counted, and every file is complete."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import cast

import numpy as np
import pytest

import catenary as cat
from catenary import record
from catenary.errors import RecordingError, ShareError, WorkingCounterError
from catenary.plan.sink import Incident
from catenary.record.cdr import Rows
from catenary.share.layout import EVENT_COUNT
from catenary.share.reader import Reader
from tests.record.beside import DEADLINE, has_bytes, recorder, shared_loop, until
from tests.share.names import own_name


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("record") as name:
        yield name


def test_a_recording_equals_the_rows_of_the_share(name: str, tmp_path: Path) -> None:
    with shared_loop(name) as shared, cat.attach(name) as reader:
        with record.Recorder(reader, tmp_path / "x.mcap") as recorder:
            shared.run(300)
            assert recorder.take() > 0
            assert recorder.take() == 0
            shared.run(50)
        rows, lost = reader.rows(0)
    back = record.read(tmp_path / "x.mcap")
    assert (lost, back.lost, recorder.lost, recorder.ended) == (0, 0, 0, "stopped")
    assert len(back) == len(rows) == recorder.cycles
    for field in back.layout.fields:
        assert np.array_equal(back[field.name], rows[field.name], equal_nan=field.dtype == "<f8")
    assert back.axes == reader.layout.axes
    assert back.unit("velocity") == "rad/s"
    assert (back.layout.clock, back.period) == ("virtual", 1e-3)


def test_inputs_and_outputs_are_recorded_by_name(name: str, tmp_path: Path) -> None:
    segment = cat.Segment(
        [cat.virtual.Coupler(), cat.virtual.DigitalOutputs(), cat.virtual.AnalogInputs()]
    )
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        lamps, gauges = cat.Outputs(subs[1]), cat.Inputs(subs[2])
        with (
            cat.Share(name) as share,
            cat.Loop(lamps, gauges, period=1e-3, sink=share) as loop,
            record.Recorder(name, tmp_path / "x.mcap"),
        ):
            for cycle in loop:
                lamps.bits[:] = cycle.number % 2
                if cycle.number == 20:
                    break
    back = record.read(tmp_path / "x.mcap")
    own = [field.name for field in back.layout.fields if field.name in lamps.names]
    assert own == list(lamps.names)
    assert set(back[own[0]][-10:]) == {0, 1}
    assert not back.axes


def test_events_are_recorded(name: str, tmp_path: Path) -> None:
    segment = cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name) as share:
            with suppress(WorkingCounterError), cat.Loop(arm, period=1e-3, sink=share) as loop:
                recorder = record.Recorder(name, tmp_path / "x.mcap")
                for cycle in loop:
                    if cycle.number == 10:
                        segment.plug(2)  # disconnects the last device
                    assert cycle.number < 100
            recorder.close()
    back = record.read(tmp_path / "x.mcap")
    assert back.ended == "the loop ended"
    assert "WorkingCounterError" in [event.kind for event in back.events]
    assert all(event.number >= 10 for event in back.events)
    assert not back["flags"][-1] & 1  # the last cycle was not complete


def test_overwritten_cycles_are_counted_and_reported(name: str, tmp_path: Path) -> None:
    with (
        shared_loop(name, history=0.064) as shared,
        record.Recorder(name, tmp_path / "x.mcap") as recorder,
    ):
        shared.run(50)
        recorder.take()
        shared.run(500)
    back = record.read(tmp_path / "x.mcap")
    numbers = back["number"].astype(int)
    gaps = np.diff(numbers) - 1
    assert recorder.lost == back.lost == gaps.sum() > 300
    [event] = [event for event in back.events if event.kind == "CyclesLost"]
    assert event.details == {"cycles": back.lost}
    before = int(np.flatnonzero(gaps)[0])
    assert numbers[before] < event.number < numbers[before + 1]
    assert back.time[before] < event.time - back.start_ns * 1e-9 < back.time[before + 1]


class Overtaken:
    """A reader whose loop overwrites some rows while they are copied."""

    def __init__(self, reader: Reader, gone: set[int]) -> None:
        self._reader = reader
        self._gone = gone

    def rows(self, after: int) -> tuple[Rows, int]:
        rows, lost = self._reader.rows(after)
        left = rows[~np.isin(rows["number"], list(self._gone))]
        return left, lost + int(left["number"][-1]) - int(rows["number"][0]) + 1 - len(left)

    def __getattr__(self, name: str) -> object:
        return getattr(self._reader, name)


def test_each_gap_is_reported_at_its_place(name: str, tmp_path: Path) -> None:
    with shared_loop(name) as shared, cat.attach(name) as reader:
        shared.run(10)
        first = reader.number
        gone = {*range(first + 21, first + 31), *range(first + 41, first + 46)}
        overtaken = cast(Reader, Overtaken(reader, gone))
        with record.Recorder(overtaken, tmp_path / "x.mcap"):
            shared.run(100)
    back = record.read(tmp_path / "x.mcap")
    said = [(e.number, e.details["cycles"]) for e in back.events if e.kind == "CyclesLost"]
    assert said == [(first + 30, 10), (first + 45, 5)]
    assert back.lost == 15
    times = {n: t for n, t in zip(back["number"].tolist(), back.time.tolist(), strict=True)}
    for event in back.events:
        at = event.time - back.start_ns * 1e-9
        assert at == pytest.approx(times[event.number + 1] - back.period, abs=1e-6)


def test_overwritten_events_are_counted_and_reported(name: str, tmp_path: Path) -> None:
    with shared_loop(name) as shared, record.Recorder(name, tmp_path / "x.mcap"):
        for number in range(EVENT_COUNT + 44):
            shared.share.report(Incident("Emergency", f"the {number}th", 1.0))
    back = record.read(tmp_path / "x.mcap")
    assert len(back.events) == 1 + EVENT_COUNT
    assert (back.events[0].kind, back.events[0].details) == ("EventsLost", {"events": 44})


def test_a_loop_that_ends_during_close_is_not_reported_as_ended(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A loop that ends after the last read has cycles that the recorder has not read."""
    with shared_loop(name) as shared, cat.attach(name) as reader:
        recorder = record.Recorder(reader, tmp_path / "x.mcap")
        take = recorder.take

        def take_and_end() -> int:
            taken = take()
            shared.loop.__exit__(None, None, None)
            return taken

        monkeypatch.setattr(recorder, "take", take_and_end)
        recorder.close()
        assert recorder.cycles < reader.number
        assert recorder.ended == "stopped"


def test_cycles_before_the_start_do_not_count_as_lost(name: str, tmp_path: Path) -> None:
    with shared_loop(name, history=0.064) as shared:
        shared.run(500)
        with record.Recorder(name, tmp_path / "x.mcap") as recorder:
            shared.run(10)
    back = record.read(tmp_path / "x.mcap")
    assert recorder.lost == 0
    assert 60 <= len(back) <= 80
    assert set(np.diff(back["number"].astype(int))) == {1}


def test_the_recording_ends_with_the_loop(name: str, tmp_path: Path) -> None:
    with shared_loop(name) as shared, recorder(name, tmp_path / "x.mcap") as child:
        shared.run(200)
        shared.loop.__exit__(None, None, None)
        said, errors = child.communicate(timeout=DEADLINE)
    assert (child.returncode, errors) == (0, "")
    assert said.endswith("cycles, none lost; the loop ended\n")
    assert record.read(tmp_path / "x.mcap").ended == "the loop ended"


WRITER = """
import sys
import catenary as cat
from tests.record.beside import shared_loop

with shared_loop(sys.argv[1]) as shared:
    shared.run(1000)
    print("shared", flush=True)
    sys.stdin.readline()
"""


def test_the_recording_ends_when_the_loop_is_killed(name: str, tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "shared\n"
        with recorder(name, tmp_path / "x.mcap") as child:
            writer.kill()
            writer.wait(DEADLINE)
            said, errors = child.communicate(timeout=DEADLINE)
    assert (child.returncode, errors) == (0, "")
    assert said.endswith("none lost; the process of the loop died\n")
    assert len(record.read(tmp_path / "x.mcap")) > 1000
    with pytest.raises(ShareError, match="is stale"):
        record.Recorder(name, tmp_path / "late.mcap")
    with record.Recorder(name, tmp_path / "late.mcap", stale=True) as late:
        late.run()
    assert late.ended == "the process of the loop died"
    assert np.array_equal(
        record.read(tmp_path / "late.mcap")["position"],
        record.read(tmp_path / "x.mcap")["position"],
    )


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_the_recording_ends_on_a_signal(name: str, tmp_path: Path, kind: signal.Signals) -> None:
    path = tmp_path / "x.mcap"
    with shared_loop(name) as shared, recorder(name, path) as child:
        shared.run(2000)
        assert until(has_bytes(path, 50_000))
        child.send_signal(kind)
        said, errors = child.communicate(timeout=DEADLINE)
    assert (child.returncode, errors) == (0, "")
    assert said.endswith("; stopped\n")
    assert record.read(path).ended == "stopped"


def test_the_recording_ends_after_its_duration(name: str, tmp_path: Path) -> None:
    with shared_loop(name) as shared:
        shared.run(10)
        with record.Recorder(name, tmp_path / "x.mcap") as recorder:
            recorder.run(seconds=0.05)  # no cycle in this time
    assert record.read(tmp_path / "x.mcap").ended == "stopped"


def test_a_reopened_loop_needs_a_new_recording(name: str, tmp_path: Path) -> None:
    """It may have other axes and other fields, and its cycle numbers start at 1 again."""
    segment = cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.Servo()])
    with cat.MainDevice(segment) as main, cat.Share(name) as share:
        drives = main.scan().drives
        for axes in (1, 2):
            arm = cat.Drives(drives[:axes], counts_per_turn=2**20, velocity_limit=100.0)
            with cat.Loop(arm, period=1e-3, sink=share) as loop:
                recorder = record.Recorder(name, tmp_path / f"{axes}.mcap")
                for cycle in loop:
                    if cycle.number == 20:
                        break
            with recorder:
                recorder.run()
            assert recorder.ended == "the loop ended"
            assert len(record.read(tmp_path / f"{axes}.mcap").axes) == axes


def test_without_a_share_no_file_is_created(tmp_path: Path) -> None:
    with pytest.raises(ShareError, match="no share 'nobody-here'"):
        record.Recorder("nobody-here", tmp_path / "x.mcap")
    assert not (tmp_path / "x.mcap").exists()


def test_the_error_names_the_missing_extra(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [each for each in sys.modules if each.partition(".")[0] == "mcap"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "mcap", None)
    with (
        shared_loop(name),
        pytest.raises(RecordingError, match="need mcap, which is not") as caught,
    ):
        record.Recorder(name, tmp_path / "x.mcap")
    assert caught.value.hint == "pip install 'catenary[log]'"
    assert not (tmp_path / "x.mcap").exists()


def test_the_package_is_imported_without_the_extra() -> None:
    script = (
        "import sys, catenary.record; print(*{'mcap', 'matplotlib', 'zstandard'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, "")
