"""The log as an array, a pandas table and a CSV file."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

from catenary.log import Log

DTYPE = np.dtype(
    [("time", "<f8"), ("number", "<u8"), ("flags", "<u4"), ("arm.actual.position", "<f8")]
)


def log(cycles: int = 4) -> Log:
    rows = np.zeros(cycles, DTYPE)
    rows["time"] = np.arange(cycles) * 1e-3
    rows["number"] = np.arange(cycles) + 7
    rows["arm.actual.position"] = np.nan
    return Log(rows)


def test_the_log_is_an_array() -> None:
    assert np.asarray(log())["number"].tolist() == [7, 8, 9, 10]
    assert np.asarray(log()).dtype == log().dtype == DTYPE
    assert np.array(log(), copy=True).shape == (4,)
    assert len(log()) == 4
    assert [int(row["number"]) for row in log()] == [7, 8, 9, 10]


def test_a_field_a_cycle_and_a_part() -> None:
    assert log()["time"][-1] == pytest.approx(3e-3)
    assert log()[-1]["number"] == 10
    part = log()[-2:]
    assert isinstance(part, Log)
    assert part["number"].tolist() == [9, 10]
    assert log()[log()["number"] < 9]["number"].tolist() == [7, 8]
    assert log()[[0, 3]]["number"].tolist() == [7, 10]


def test_a_missing_field_or_cycle_is_an_error() -> None:
    with pytest.raises(ValueError, match="lunch"):
        log()["lunch"]
    with pytest.raises(IndexError):
        log()[4]


def test_the_repr_is_a_summary() -> None:
    assert repr(log()) == "Log(4 cycles, 0 to 0.003 s, 1 axes)"
    assert repr(log(0)) == "Log(0 cycles)"
    assert log().axes == ("arm",)


def test_to_csv(tmp_path: Path) -> None:
    log().to_csv(tmp_path / "log.csv")
    with (tmp_path / "log.csv").open(newline="") as file:
        head, first, *rest = csv.reader(file)
    assert head == list(DTYPE.names or ())
    assert first == ["0.0", "7", "0", "nan"]
    assert len(rest) == 3


def test_to_pandas_has_the_time_as_its_index() -> None:
    pytest.importorskip("pandas")
    table = log().to_pandas()
    assert table.index.name == "time [s]"
    assert table.index.tolist() == pytest.approx([0.0, 1e-3, 2e-3, 3e-3])
    assert list(table.columns) == ["number", "flags", "arm.actual.position"]
    assert table["number"].dtype == np.uint64


def test_the_error_without_pandas_has_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"pip install pandas; to_csv .* work without it"):
        log().to_pandas()
