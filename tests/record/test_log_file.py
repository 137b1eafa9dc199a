"""The CSV file of a log as a recording, and its plot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary import record
from catenary.cli.main import main as command
from catenary.errors import RecordingError
from catenary.virtual import Segment, Servo


def written(path: Path, *, log_axes: bool = True) -> Path:
    segment = Segment([Servo(name="shoulder"), Servo(name="elbow")])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(arm, log_axes=log_axes) as loop:
            for cycle in loop:
                arm.target.position[:] = [0.1 * cycle.time, -0.1 * cycle.time]
                if cycle.number == 300:
                    break
        loop.log.to_csv(path)
    return path


def test_a_csv_file_has_the_fields_of_a_recording(tmp_path: Path) -> None:
    recording = record.read_csv(written(tmp_path / "run.csv"))
    assert (recording.name, recording.axes) == ("run", ("shoulder", "elbow"))
    assert recording.period == pytest.approx(1e-3)
    assert recording["target_position"].shape == (len(recording), 2)
    assert recording.unit("commanded_position") == "rad"
    assert recording["position"][-1] == pytest.approx(recording["target_position"][-1], abs=5e-3)
    assert recording.lost == 0
    assert np.diff(recording.time) == pytest.approx(1e-3)
    assert recording.time[0] < 0.0  # the start-up: cycle.time is 0 at the first iteration


def test_a_part_is_selected_by_cycle_time(tmp_path: Path) -> None:
    recording = record.read_csv(written(tmp_path / "run.csv"), start=0.1, end=0.2)
    assert recording.time[0] == pytest.approx(0.1, abs=1.1e-3)
    assert recording.time[-1] == pytest.approx(0.2, abs=1.1e-3)


@pytest.mark.parametrize("log_axes", [True, False])
def test_plot(tmp_path: Path, log_axes: bool, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "run.csv", log_axes=log_axes)
    assert command(["plot", str(path)]) == 0
    assert (tmp_path / "run.png").stat().st_size > 10_000
    axes = 2 if log_axes else 0
    assert f"cycles of run, {axes} axes" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "is not the CSV file of a log"),
        ("a,b\n1,2\n", "no column time, number, scheduled_ns"),
        ("time,number,scheduled_ns\n0,1\n", "line 2: 2 values for 3 columns"),
        ("time,number,scheduled_ns\n0,1,lunch\n", "'scheduled_ns' has values that are not numbers"),
        ("time,number,scheduled_ns\n0.0,1,0\n", "two cycles"),
    ],
)
def test_a_file_that_is_not_a_log_is_refused(tmp_path: Path, text: str, named: str) -> None:
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(RecordingError, match=named):
        record.read_csv(tmp_path / "x.csv")
