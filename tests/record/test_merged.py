"""One share of a merged recording, read and plotted as if it had its own file."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import msgspec
import numpy as np
import pytest

from catenary import record
from catenary.cli.main import main as catenary
from catenary.errors import RecordingError
from catenary.record.file import RecordingFile
from catenary.record.index import RecordingIndex
from tests.record.made import make_event, make_layout, make_rows

pytest.importorskip("mcap.reader", reason="needs catenary[log]")

COUNTS = {"left": 1500, "right": 900}
OFFSET = 0.25  # [s]


def write(path: Path, name: str, axes: int, count: int) -> Path:
    layout = msgspec.structs.replace(make_layout(axes), name=name)
    file = RecordingFile(path, layout)
    rows = make_rows(layout, count, first=axes)
    for part, event in ((rows[:100], 90), (rows[100:], count - 5)):
        file.write(part)
        file.write_event(make_event(event))
    file.finish({"ended": f"{name} stopped", "lost": axes})
    return path


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    return {
        name: write(tmp_path / f"{name}.mcap", name, axes, COUNTS[name])
        for axes, name in ((2, "left"), (3, "right"))
    }


@pytest.fixture
def both(files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(import_module("catenary.record.merge"), "CHUNK_SIZE", 1 << 14)
    record.merge([*files.values()], tmp_path / "both.mcap")
    return tmp_path / "both.mcap"


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize(("start", "end"), [(0.0, np.inf), (0.2, 0.3), (0.8, 9.0)])
def test_a_share_is_read_as_from_its_own_file(
    files: dict[str, Path], both: Path, name: str, start: float, end: float
) -> None:
    alone = record.read(files[name], start=start, end=end)
    found = record.read(both, start=start, end=end, share=name)
    assert np.array_equal(found.rows, alone.rows)
    assert found.layout == alone.layout
    assert (found.events, found.ended, found.lost) == (alone.events, alone.ended, alone.lost)
    assert found.time.tolist() == alone.time.tolist()
    assert len(found) > 0


def test_an_offset_moves_the_time_in_utc_only(files: dict[str, Path], tmp_path: Path) -> None:
    record.merge([files["left"], record.Source(files["right"], OFFSET)], tmp_path / "c.mcap")
    alone = record.read(files["right"])
    found = record.read(tmp_path / "c.mcap", share="right")
    assert np.array_equal(found.rows, alone.rows)
    assert found.events == alone.events
    assert found.start_ns == alone.start_ns
    moved = found.layout.utc_offset_ns - alone.layout.utc_offset_ns
    assert moved == round(OFFSET * 1e9)


@pytest.mark.parametrize("share", [None, "wrist"])
def test_the_error_names_the_shares(both: Path, share: str | None) -> None:
    with pytest.raises(RecordingError, match="left, right") as raised:
        record.read(both, share=share)
    assert 'share="left"' in str(raised.value)
    assert "--share left" in str(raised.value)


def test_an_index_of_a_merged_file_names_the_shares(both: Path) -> None:
    with pytest.raises(RecordingError, match="several shares: left, right"):
        RecordingIndex(both)


def test_names_of_files_replace_equal_names_of_shares(tmp_path: Path) -> None:
    paths = [write(tmp_path / f"{n}.mcap", "My Arm", 2, 1000 * n) for n in (1, 2)]
    record.merge(paths, tmp_path / "c.mcap")
    found = record.read(tmp_path / "c.mcap", share="x_2")
    assert found.name == "x_2"
    assert np.array_equal(found.rows, record.read(paths[1]).rows)


def test_a_share_is_found_by_its_own_name(tmp_path: Path) -> None:
    paths = [write(tmp_path / f"{n}.mcap", f"Arm {n}", 2, 100) for n in (1, 2)]
    record.merge(paths, tmp_path / "c.mcap")
    assert record.read(tmp_path / "c.mcap", share="Arm 2").name == "Arm 2"


def test_a_truncated_recording_stays_cut_off(files: dict[str, Path], tmp_path: Path) -> None:
    files["right"].write_bytes(files["right"].read_bytes()[: files["right"].stat().st_size // 2])
    record.merge([*files.values()], tmp_path / "c.mcap")
    alone = record.read(files["right"])
    found = record.read(tmp_path / "c.mcap", share="right")
    assert np.array_equal(found.rows, alone.rows)
    assert found.ended == alone.ended == "cut off"
    assert record.read(tmp_path / "c.mcap", share="left").ended == "left stopped"


def test_a_truncated_merged_file_is_read_up_to_its_last_chunk(both: Path) -> None:
    whole = record.read(both, share="left")
    both.write_bytes(both.read_bytes()[: both.stat().st_size // 2])
    found = record.read(both, share="left")
    assert 0 < len(found) < len(whole)
    assert np.array_equal(found.rows, whole.rows[: len(found)])
    assert found.ended == "cut off"


def test_the_share_of_a_recording_that_is_not_merged(files: dict[str, Path]) -> None:
    assert len(record.read(files["left"], share="left")) == COUNTS["left"]
    with pytest.raises(RecordingError, match="a recording of 'left', not of 'right'"):
        record.read(files["left"], share="right")


def test_plot_draws_one_share(both: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="needs catenary[log]")
    output = both.with_name("left.png")
    assert catenary(["plot", str(both), "--share", "left", "-o", str(output)]) == 0
    assert capsys.readouterr().out == f"{output}: 1500 cycles of left, 2 axes\n"
    assert output.read_bytes().startswith(b"\x89PNG")


def test_plot_without_a_share_names_them(both: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert catenary(["plot", str(both)]) != 0
    error = capsys.readouterr().err
    assert "several shares: left, right" in error
    assert "--share left" in error


def test_plot_of_a_log_has_no_shares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert catenary(["plot", str(tmp_path / "run.csv"), "--share", "left"]) == 2
    assert "--share: a log in CSV has only one loop" in capsys.readouterr().err
