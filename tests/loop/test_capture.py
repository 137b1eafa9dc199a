"""`Loop(capture=...)`: files around errors and stopped axes, and none without a cause."""

from __future__ import annotations

import contextlib
import logging
import re
import threading
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.capture import SdoTransfer, StateReached, read_timeline
from catenary.errors import CatenaryError, DriveError
from catenary.realtime import VirtualClock
from catenary.virtual import Segment, Servo
from catenary.wire.capture import decode_capture
from tests.link.dissector import dissect

EVENT = cat.StopPolicy(on_axis_stopped="event")


def two_servos() -> Segment:
    return Segment([Servo(), Servo()], clock="virtual")


def arm_of(main: cat.MainDevice) -> cat.Drives:
    return cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=10.0)


def hold(loop: cat.Loop, arm: cat.Drives, cycles: int) -> None:
    """Run the loop for a number of cycles."""
    for count, _ in enumerate(loop, start=1):
        arm.target.position[:] = arm.actual.position
        if count >= cycles:
            return


def files_of(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


def file_in(notes: list[str]) -> Path:
    """Return the file that the notes of an error name."""
    [path] = re.findall(r"before: (\S+\.pcapng)$", "\n".join(notes), re.MULTILINE)
    return Path(path)


def failed(main: cat.MainDevice, folder: Path) -> Path:
    """Run a loop with an SDO transfer, and raise an error in it. Return the file of its capture."""
    arm = arm_of(main)

    def work() -> None:
        with cat.Loop(arm, capture=folder) as loop:
            hold(loop, arm, 10)
            request = main.subs[0].sdo.request(0x1008)
            hold(loop, arm, 100)
            assert request.done
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError) as caught:
        work()
    return file_in(caught.value.__notes__)


def test_an_error_names_the_capture_of_its_frames(tmp_path: Path, tshark: str) -> None:
    folder = tmp_path / "made" / "here"
    servos = [Servo(), Servo()]
    with cat.MainDevice(Segment(servos, clock="virtual")) as main:
        arm = arm_of(main)
        failed_ns = 0

        def work() -> None:
            nonlocal failed_ns
            with cat.Loop(arm, capture=folder) as loop:
                hold(loop, arm, 100)
                failed_ns = main.link.now()
                servos[0].inject_fault(0x2310)
                hold(loop, arm, 100)

        with pytest.raises(DriveError) as caught:
            work()
    path = file_in(caught.value.__notes__)
    packets = decode_capture(path.read_bytes()).packets
    assert files_of(folder) == [path]
    assert "-DriveError" in path.name
    assert packets[0].time_ns < failed_ns - 100_000_000
    assert packets[-1].time_ns > failed_ns
    rows = dissect(tshark, path, "frame.packet_flags_direction", "ecat.idx", "_ws.malformed")
    assert len(rows) == len(packets)
    assert {int(row[0], 0) for row in rows} == {1, 2}
    assert {row[2] for row in rows} == {""}


def test_the_capture_shows_the_bring_up_and_the_way_down(tmp_path: Path) -> None:
    with cat.MainDevice(two_servos()) as main:
        path = failed(main, tmp_path)
    timeline = read_timeline(path)
    states = [
        str(event.content).split()[0]
        for event in timeline.events
        if isinstance(event.content, StateReached)
    ]
    assert states.index("SAFE-OP") < states.index("OP") < len(states) - 1
    assert states[-1] == "PRE-OP"
    assert timeline.complete
    assert not any(summary.master.lost for summary in timeline.masters)


def test_cyclic_and_acyclic_frames_are_in_the_capture(tmp_path: Path) -> None:
    with cat.MainDevice(two_servos()) as main:
        path = failed(main, tmp_path)
    packets = decode_capture(path.read_bytes()).packets
    indices = {packet.data[17] for packet in packets[len(packets) // 2 :]}
    assert any(index < 0x80 for index in indices)
    timeline = read_timeline(path)
    [transfer] = [
        event.content
        for event in timeline.events
        if isinstance(event.content, SdoTransfer) and event.content.index == 0x1008
    ]
    assert transfer.succeeded


def test_an_error_before_op_is_captured(tmp_path: Path) -> None:
    segment = two_servos()
    with cat.MainDevice(segment) as main:
        arm = arm_of(main)
        segment.unplug()
        with pytest.raises(CatenaryError) as caught, cat.Loop(arm, capture=tmp_path):
            pass
        assert main.link is not None
    path = file_in(caught.value.__notes__)
    assert files_of(tmp_path) == [path]
    assert len(decode_capture(path.read_bytes()).packets) > 0


def test_a_loop_that_ends_well_writes_no_file_and_returns_the_link(tmp_path: Path) -> None:
    with cat.MainDevice(two_servos()) as main:
        arm, link = arm_of(main), main.link
        with cat.Loop(arm, capture=str(tmp_path)) as loop:
            assert main.link is not link
            hold(loop, arm, 20)
        assert main.link is link
        assert len(main.scan()) == 2
    assert files_of(tmp_path) == []


def test_an_interrupt_is_not_an_error(tmp_path: Path) -> None:
    with cat.MainDevice(two_servos()) as main:
        arm = arm_of(main)
        with pytest.raises(KeyboardInterrupt), cat.Loop(arm, capture=tmp_path):
            raise KeyboardInterrupt
    assert files_of(tmp_path) == []


def test_without_the_option_nothing_records() -> None:
    with cat.MainDevice(two_servos()) as main:
        arm, link = arm_of(main), main.link
        loop = cat.Loop(arm).open()
        assert main.link is link
        assert "catenary capture" not in {each.name for each in threading.enumerate()}
        loop.close()
        with pytest.raises(ZeroDivisionError) as caught, cat.Loop(arm):
            raise ZeroDivisionError
    assert not hasattr(caught.value, "__notes__")


def test_a_stopped_axis_is_logged_with_its_file(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with cat.MainDevice(two_servos()) as main:
        arm = arm_of(main)
        with (
            caplog.at_level(logging.WARNING, logger="catenary"),
            cat.Loop(arm, stop=EVENT, capture=tmp_path) as loop,
        ):
            for cycle in loop:
                arm.target.position[:] = [0.0, np.nan]
                if cycle.number == 200:
                    break
    [path] = files_of(tmp_path)
    [line] = [each.message for each in caplog.records if "frames from" in each.message]
    assert line.startswith("axis 1 Catenary virtual servo stopped: ")
    assert line.endswith(str(path))
    assert "axis-1-Catenary-virtual-servo-stopped" in path.name


def test_a_stopped_axis_of_a_loop_in_real_time_is_written_while_it_runs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    written = threading.Event()

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            written.set()

    handler = Handler()
    logging.getLogger("catenary").addHandler(handler)
    try:
        segment = Segment([Servo(), Servo()], clock="monotonic")
        options = cat.CaptureOptions(folder=tmp_path, after=0.05)
        stop = cat.StopPolicy(on_axis_stopped="event", lost_limit=1000)
        with cat.MainDevice(segment) as main:
            arm = arm_of(main)
            loop_options = dict(period=4e-3, stop=stop, priority=None, watchdog=0.0)
            with cat.Loop(arm, capture=options, **loop_options) as loop:  # type: ignore[arg-type]
                for cycle in loop:
                    arm.target.position[:] = [0.0, np.nan]
                    if written.is_set() or cycle.number == 2000:
                        break
                assert written.is_set()
                [path] = files_of(tmp_path)
                assert decode_capture(path.read_bytes()).cut == 0
    finally:
        logging.getLogger("catenary").removeHandler(handler)
    assert files_of(tmp_path) == [path]


def test_lost_frames_in_the_background_name_their_file(tmp_path: Path) -> None:
    segment = two_servos()
    with cat.MainDevice(segment) as main:
        arm = arm_of(main)
        loop = cat.Loop(arm, capture=tmp_path).open()
        loop.run_in_background()
        segment.unplug()
        with pytest.raises(CatenaryError):
            loop.wait(arm.move_to(0.1), timeout=30.0)
        with contextlib.suppress(CatenaryError):  # `wait` may have raised the error of the move
            loop.close()
    assert loop.error is not None
    assert files_of(tmp_path) == [file_in(loop.error.__notes__)]


def test_each_network_has_its_own_file(tmp_path: Path) -> None:
    clock = VirtualClock()
    with (
        cat.MainDevice(Segment([Servo()], clock=clock)) as left,
        cat.MainDevice(Segment([Servo()], clock=clock)) as right,
    ):
        arms = [arm_of(left), arm_of(right)]
        with pytest.raises(ZeroDivisionError) as caught, cat.Loop(*arms, capture=tmp_path):
            raise ZeroDivisionError
    assert len(files_of(tmp_path)) == 2
    assert sorted(re.findall(r"\S+\.pcapng$", "\n".join(caught.value.__notes__), re.M)) == [
        str(path) for path in files_of(tmp_path)
    ]
