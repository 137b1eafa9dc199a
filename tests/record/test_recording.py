"""Reading a recording or a part of it, and its properties."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from catenary import record
from catenary.record.file import RecordingFile
from tests.record.made import make_event, make_layout, make_rows

COUNT = 4000


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "x.mcap"
    layout = make_layout(4)
    file = RecordingFile(path, layout)
    rows = make_rows(layout, COUNT)
    for start in range(0, COUNT, 100):
        file.write(rows[start : start + 100])
    file.write_event(make_event(1500))
    file.finish({"ended": "the loop ended", "cycles": COUNT, "lost": 0})
    return path


@pytest.mark.parametrize(
    ("start", "end", "first", "last"),
    [
        (0.0, np.inf, 1, COUNT),
        (1.0, 2.0, 1001, 2001),
        (0.0, 0.0, 1, 1),
        (3.9, 100.0, 3901, COUNT),
        (1.2345, 1.2345, 0, 0),
    ],
)
def test_a_part_is_read_by_its_seconds(
    path: Path, start: float, end: float, first: int, last: int
) -> None:
    whole, part = record.read(path), record.read(path, start=start, end=end)
    assert np.array_equal(part.rows, whole.rows[first - 1 : last] if first else whole.rows[:0])
    assert (part.ended, part.lost) == ("the loop ended", 0)
    assert (
        part.time.tolist() == (whole.time[first - 1 : last] if first else whole.time[:0]).tolist()
    )
    at = 1500 * 1e-3 - 1e-3
    assert len(part.events) == (1 if start <= at <= end else 0)


def test_the_properties_of_a_recording(path: Path) -> None:
    recording = record.read(path)
    assert (recording.name, recording.period) == ("cell-1", 1e-3)
    assert recording.axes == ("joint0", "joint1", "joint2", "joint3")
    assert len(recording) == COUNT
    assert recording.time[0] == 0.0
    assert recording.time[-1] == pytest.approx((COUNT - 1) * 1e-3)
    assert recording["velocity"].shape == (COUNT, 4)
    assert [recording.unit(field) for field in ("torque", "flags", "no")] == ["N·m", "", ""]


def test_the_error_for_an_unknown_field_lists_the_fields(path: Path) -> None:
    with pytest.raises(KeyError, match=r"no field 'speed'; its fields are number, .*velocity"):
        record.read(path)["speed"]


@pytest.mark.parametrize("part", [{"start": np.nan}, {"start": np.inf}, {"end": np.nan}])
def test_an_invalid_part_is_refused(path: Path, part: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be valid times"):
        record.read(path, **part)


def test_a_missing_file_raises_file_not_found() -> None:
    with pytest.raises(FileNotFoundError):
        record.read("/nowhere/x.mcap")


def test_a_part_from_zero_includes_events_before_the_first_cycle(tmp_path: Path) -> None:
    layout = make_layout(0)
    file = RecordingFile(tmp_path / "x.mcap", layout)
    file.write_event(make_event(1))
    file.write(make_rows(layout, 1000, first=501))
    file.finish({})
    whole = record.read(tmp_path / "x.mcap")
    assert (len(whole), len(whole.events)) == (1000, 1)
    part = record.read(tmp_path / "x.mcap", start=0.25)
    assert (part["number"][0], len(part.events)) == (751, 0)
    assert len(record.read(tmp_path / "x.mcap", end=0.25).events) == 1
