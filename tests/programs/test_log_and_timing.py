"""Programs that read the log and the timing of a loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from catenary.loop import Loop
from catenary.virtual import Segment, Servo

RunProgram = Callable[[str, Segment | str], Mapping[str, object]]


def test_log_to_pandas(run_program: RunProgram, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    names = run_program("log_to_pandas", Segment([Servo(name="shoulder"), Servo(name="elbow")]))
    shoulder = names["shoulder"]
    assert isinstance(shoulder, pandas.DataFrame)
    assert "shoulder.actual.position" in shoulder
    assert not any("elbow" in name for name in shoulder)
    assert shoulder.index[0] == pytest.approx(0.5)
    error = shoulder["shoulder.actual.position"] - 0.1 * np.sin(shoulder.index)
    assert np.abs(error).max() < 1e-3
    table = pandas.read_csv(tmp_path / "run.csv")
    assert table["time"].iloc[-1] == pytest.approx(1.0, abs=0.01)


def test_timing_verdict(run_program: RunProgram, capsys: pytest.CaptureFixture[str]) -> None:
    names = run_program("timing_verdict", Segment([Servo()]))
    loop = names["loop"]
    assert isinstance(loop, Loop)
    assert loop.timing.counters["uncommitted"] == 20
    printed = capsys.readouterr().out
    assert "uncommitted: the program wrote no new targets in time" in printed
    assert "the body took up to 20000 us of a period of 1000 us" in printed
