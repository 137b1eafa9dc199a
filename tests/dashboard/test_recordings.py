"""Recordings as a source: windows without a lost sample or peak; large, broken and other files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from catenary.dashboard import recordings as module
from catenary.dashboard.frames import DECIMATED, FULL, Frame
from catenary.dashboard.recordings import Folder, Progress, Window
from catenary.errors import RecordingError
from catenary.record.file import RecordingFile
from tests.record.made import make_event, make_layout, make_rows

SIGNALS = ["position[0]", "torque[1]", "number"]


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    layout = make_layout(2)
    rows = make_rows(layout, 6000)
    rows["torque"][2345, 1] = 99.0
    rows["position"][100:200, 0] = np.nan
    file = RecordingFile(tmp_path / "arm.mcap", layout)
    file.write(rows)
    file.write_event(make_event(5000))
    file.finish({"ended": "the loop ended", "lost": 0})
    return Folder(tmp_path)


def full(frame: Frame | Progress) -> np.ndarray:
    """Return time and signals, (1 + signals, rows)."""
    assert isinstance(frame, Frame)
    assert frame.kind == FULL
    return np.frombuffer(frame.body, "<f8").reshape(1 + frame.signals, frame.rows)


def bounds(frame: Frame | Progress) -> tuple[np.ndarray, np.ndarray]:
    """Return the times, and minimum and maximum of each signal, (signals, 2, rows)."""
    assert isinstance(frame, Frame)
    assert frame.kind == DECIMATED
    times = np.frombuffer(frame.body, "<f8", frame.rows)
    pairs = np.frombuffer(frame.body, "<f4", offset=8 * frame.rows)
    return times, pairs.reshape(frame.signals, 2, frame.rows)


def whole(folder: Folder, request: Window) -> Frame:
    """Return the frame of a window after all its steps."""
    for _ in range(1000):
        answer = folder.open("arm.mcap").window(request)
        if isinstance(answer, Frame):
            return answer
        assert 0.0 <= answer.progress < 1.0
    raise AssertionError("no progress")


def test_files_are_listed_and_described(folder: Folder) -> None:
    assert [file["name"] for file in folder.files()] == ["arm.mcap"]
    about = folder.open("arm.mcap").describe()
    assert about["duration"] == pytest.approx(5.999)
    assert about["ended"] == "the loop ended"
    assert [event["kind"] for event in about["events"]] == ["DeviceLost"]
    assert about["events"][0]["time"] == pytest.approx(4.999)
    assert about["layout"]["axes"] == ("joint0", "joint1")


def test_a_small_window_has_every_cycle(folder: Folder) -> None:
    rows = make_rows(make_layout(2), 6000)
    _, position, _, number = full(folder.open("arm.mcap").window(Window(SIGNALS, 2.0, 2.5)))
    assert number.tolist() == list(range(2001, 2502))
    assert np.array_equal(position, rows["position"][2000:2501, 0])


def test_a_decimated_window_keeps_every_peak(folder: Folder) -> None:
    times, values = bounds(folder.open("arm.mcap").window(Window(SIGNALS, 0.0, 9.0, points=50)))
    assert values.shape == (3, 2, 50)
    assert (np.diff(times) > 0).all()
    assert values[1, 1].max() == 99.0
    assert (values[2, 0, 0], values[2, 1, -1]) == (1, 6000)


def test_a_large_window_is_read_in_steps(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    request = Window(SIGNALS, 0.0, 9.0, points=40)
    monkeypatch.setattr(module, "WINDOW_BYTES", 1000)
    monkeypatch.setattr(module, "STEP", 1e-9)
    assert isinstance(folder.open("arm.mcap").window(request), Progress)
    monkeypatch.setattr(module, "STEP", 0.02)
    _, values = bounds(whole(folder, request))
    assert values[1, 1].max() == 99.0
    assert (values[2, 0, 0], values[2, 1, -1]) == (1, 6000)


def test_the_cache_is_bounded(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WINDOW_BYTES", 1000)
    monkeypatch.setattr(module, "CACHED", 16)
    monkeypatch.setattr(module, "STEP", 99.0)
    recording = folder.open("arm.mcap")
    for start in range(5):
        assert isinstance(recording.window(Window(SIGNALS, start, start + 0.7)), Frame)
        assert 0 < len(recording._extremes) <= 16
    with pytest.raises(ValueError, match="too long"):
        recording.window(Window(SIGNALS, 0.0, 9.0))


@pytest.mark.parametrize(
    "request_",
    [
        Window(["nothing"], 0.0, 1.0),
        Window(["position[7]"], 0.0, 1.0),
        Window([], 0.0, 1.0),
        Window(SIGNALS, 0.0, 1.0, points=0),
        Window(SIGNALS, 0.0, float("nan")),
        Window(SIGNALS, 2.0, 1.0),
    ],
)
def test_invalid_windows_are_refused(folder: Folder, request_: Window) -> None:
    with pytest.raises(ValueError, match=r"signal|points|finite|before"):
        folder.open("arm.mcap").window(request_)


def test_a_window_outside_of_the_recording_is_empty(folder: Folder) -> None:
    frame = folder.open("arm.mcap").window(Window(SIGNALS, 50.0, 60.0))
    assert isinstance(frame, Frame)
    assert frame.rows == 0


@pytest.mark.parametrize("name", ["../arm.mcap", "no.mcap", "/etc/passwd", "text.txt", "link.mcap"])
def test_only_recordings_of_the_folder_can_be_opened(tmp_path: Path, name: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "arm.mcap").write_bytes(b"x")
    (inner / "text.txt").write_bytes(b"x")
    (inner / "link.mcap").symlink_to(tmp_path / "arm.mcap")
    with pytest.raises(RecordingError, match="there is no recording"):
        Folder(inner).open(name)
    assert Folder(inner).files() == []


def test_a_broken_file_is_an_error(folder: Folder, tmp_path: Path) -> None:
    (tmp_path / "bad.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(range(256)) * 40)
    with pytest.raises(RecordingError):
        folder.open("bad.mcap")
