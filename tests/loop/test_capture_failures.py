"""`Loop(capture=...)`: bounds, refusals, and failures of the capture itself."""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import CatenaryError, ConfigurationError
from catenary.link import Link, Recorder
from catenary.link.frame_memory import FrameMemory
from catenary.loop.frame_capture import FrameCapture, Mark, free_path
from catenary.virtual import Segment, Servo
from tests.loop.test_capture import arm_of, files_of, two_servos


def test_the_number_of_files_is_bounded(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    options = cat.CaptureOptions(folder=tmp_path, files=1)
    with cat.MainDevice(two_servos()) as main:
        arm = arm_of(main)
        with cat.Loop(arm, capture=options) as loop:
            capture = loop.networks[0].session.capture
            assert capture is not None
            capture.files.append(tmp_path / "earlier.pcapng")
            capture.fail(error := ValueError("made by the test"))
    assert files_of(tmp_path) == []
    assert error.__notes__ == ["no capture of the frames: CaptureOptions.files=1"]


def test_a_full_disk_does_not_replace_the_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> tuple[int, int]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FrameMemory, "write", refused)
    with cat.MainDevice(two_servos()) as main:
        arm = arm_of(main)
        with pytest.raises(ZeroDivisionError) as caught, cat.Loop(arm, capture=tmp_path):
            raise ZeroDivisionError
    [note] = caught.value.__notes__
    assert note == f"no capture of the frames in {tmp_path}: No space left on device"


def test_a_failure_of_the_capture_does_not_hide_the_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> tuple[int, int]:
        raise ValueError("made by the test")

    monkeypatch.setattr(FrameMemory, "write", broken)
    segment = two_servos()
    with cat.MainDevice(segment) as main:
        arm, link = arm_of(main), main.link
        segment.unplug()
        with pytest.raises(CatenaryError) as caught, cat.Loop(arm, capture=tmp_path):
            pass
        assert main.link is link
    assert "while leaving: made by the test" in caught.value.__notes__


def test_a_recorder_that_cannot_be_used_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(_: object, link: Link) -> None:
        links.append(link)
        raise RuntimeError("made by the test")

    links: list[Link] = []
    monkeypatch.setattr(cat.MainDevice, "replace_link", refused)
    with cat.MainDevice(two_servos()) as main:
        arm, link = arm_of(main), main.link
        before = len(os.listdir("/proc/self/fd"))
        with pytest.raises(RuntimeError, match="made by the test"):
            cat.Loop(arm, capture=tmp_path).open()
        assert len(os.listdir("/proc/self/fd")) == before
        assert main.link is link
    assert isinstance(links[0], Recorder)
    assert links[0].closed
    assert "catenary capture" not in {each.name for each in threading.enumerate()}


def test_axes_that_stop_again_and_again_have_several_files(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    options = cat.CaptureOptions(folder=tmp_path, before=1.0, after=0.5)
    with cat.MainDevice(Segment([Servo()], clock="monotonic")) as main:
        capture = FrameCapture(options, main)
        capture._ended.set()
        capture._thread.join()  # this test does its work
        now_ns = main.link.now()
        times = [now_ns - age for age in (10_000_000_000, 9_500_000_000, 1_000_000_000)]
        capture._marks.extend(Mark(time_ns, "axis stopped") for time_ns in times)
        ends = []
        while (to_ns := capture._due()) is not None:
            capture._write(to_ns)
            ends.append(to_ns)
        capture.end()
    assert ends == [times[0] + 1_500_000_000, times[2] + 500_000_000]
    assert len(capture.files) == 2
    assert sorted(capture.files) == files_of(tmp_path)
    assert "frames from 1.500 s after: " in caplog.text  # there are no frames before


@pytest.mark.parametrize(
    "wrong",
    [
        {"before": -1.0},
        {"after": float("inf")},
        {"memory": 1000},
        {"memory": 1 << 40},
        {"files": 0},
    ],
)
def test_impossible_options_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        cat.CaptureOptions(folder="x", **wrong)  # type: ignore[arg-type]


def test_a_capture_that_is_not_a_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    with cat.MainDevice(two_servos()) as main:
        arm = arm_of(main)
        with pytest.raises(TypeError, match="must be a folder"):
            cat.Loop(arm, capture=True)  # type: ignore[arg-type]
        link = main.link
        with pytest.raises(ConfigurationError, match="cannot be made"):
            cat.Loop(arm, capture=tmp_path / "file").open()
        assert main.link is link


def test_names_are_never_reused(tmp_path: Path) -> None:
    paths = []
    for _ in range(3):
        paths.append(free_path(tmp_path, "eth0", "axis 1/2 stopped"))
        paths[-1].touch()
    assert len(set(paths)) == 3
    assert all(re.fullmatch(r"[\w.-]+\.pcapng", path.name) for path in paths)


def test_an_error_after_the_end_is_not_kept(tmp_path: Path) -> None:
    """A loop that cannot be opened again reports its error to the ended capture."""
    folder = tmp_path / "captures"
    with cat.MainDevice(two_servos()) as main:
        loop = cat.Loop(arm_of(main), capture=folder)
        with loop:
            capture = loop.networks[0].session.capture
        folder.rmdir()
        folder.write_text("a file")
        with pytest.raises(ConfigurationError):
            loop.open()
    assert capture is not None
    assert capture._error is None
