"""Commands `record` and `plot`.

tests/record/test_recorder.py and scenarios 76 to 78 cover signals, killed recorders and full disks.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary import record
from catenary.cli.main import main
from catenary.record.file import RecordingFile
from tests.record.beside import shared_loop
from tests.record.made import make_event, make_layout, make_rows
from tests.share.names import own_name


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("cli") as name:
        yield name


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    layout = make_layout(2)
    file = RecordingFile(tmp_path / "arm.mcap", layout)
    file.write(make_rows(layout, 1200))
    file.write_event(make_event(100))
    file.finish({"ended": "the loop ended", "lost": 0})
    return tmp_path / "arm.mcap"


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_record_prints_its_progress(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.mcap"
    with shared_loop(name) as shared:
        shared.run(100)
        status, out, err = call(f"record {name} {path} --seconds 0.01", capsys)
    cycles = len(record.read(path))
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        f"recording {name} (3 axes at 1000 Hz) to {path}; press Ctrl-C to stop",
        f"{path}: {cycles} cycles, none lost; stopped",
    ]
    assert cycles > 100


def test_record_as_json(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with shared_loop(name) as shared:
        shared.run(100)
        status, out, _ = call(f"record {name} {tmp_path}/x.mcap --seconds 0.01 --json", capsys)
    said = json.loads(out)
    assert status == 0
    assert said.pop("cycles") > 100
    assert said == {"file": f"{tmp_path}/x.mcap", "lost": 0, "ended": "stopped"}


def test_uid_selects_the_owner_of_the_share(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with shared_loop(name) as shared:
        shared.run(10)
        line = f"record {name} {tmp_path / 'x.mcap'} --seconds 0.01 --uid"
        status, _, err = call(f"{line} 64001", capsys)  # an unused user id
        assert (status, f"there is no share '{name}'" in err) == (1, True)
        assert call(f"{line} {os.geteuid()}", capsys)[0] == 0


def test_an_existing_file_is_replaced_only_with_force(
    name: str, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = recording.read_bytes()
    with shared_loop(name) as shared:
        shared.run(5)
        status, _, err = call(f"record {name} {recording} --seconds 0.01", capsys)
        assert (status, recording.read_bytes()) == (1, before)
        assert err.splitlines()[0] == f"catenary: {recording} already exists"
        assert "--force" in err.splitlines()[1]
        assert call(f"record {name} {recording} --seconds 0.01 --force", capsys)[0] == 0
    assert record.read(recording).name == name


def test_a_missing_share(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = call(f"record nobody-here {tmp_path}/x.mcap", capsys)
    assert status == 1
    assert "there is no share 'nobody-here'" in err
    assert not list(tmp_path.iterdir())


def test_a_missing_folder(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with shared_loop(name):
        status, _, err = call(f"record {name} {tmp_path}/no/x.mcap", capsys)
    assert (status, err) == (1, f"catenary: {tmp_path}/no/x.mcap: No such file or directory\n")


@pytest.mark.parametrize("line", ["record {file}", "record arm {file} --repair"])
def test_a_share_and_repair_exclude_each_other(
    recording: Path, capsys: pytest.CaptureFixture[str], line: str
) -> None:
    before = recording.read_bytes()
    assert call(line.format(file=recording), capsys)[0] == 2
    assert recording.read_bytes() == before


def test_repair(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(f"record --repair {recording}", capsys)[1] == (
        f"{recording}: nothing to repair, 1.199 s\n"
    )
    recording.write_bytes(recording.read_bytes()[:-7])
    status, out, _ = call(f"record --repair {recording}", capsys)
    assert (status, out.split(";")[0]) == (0, f"{recording}: repaired, 1.199 s")
    recording.write_bytes(recording.read_bytes()[:-7])
    said = json.loads(call(f"record --repair {recording} --json", capsys)[1])
    assert said["seconds"] == pytest.approx(1.199)


def test_plot_next_to_the_recording(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call(f"plot {recording}", capsys)
    picture = recording.with_suffix(".png")
    assert (status, err) == (0, "")
    assert out == f"{picture}: 1200 cycles of cell-1, 2 axes\n"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_plot_a_part_of_one_axis(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = recording.with_name("part.html")
    line = f"plot {recording} -o {page} --axis joint1 --start 0.5 --end 0.7495 --degrees"
    status, out, _ = call(line, capsys)
    assert (status, out) == (0, f"{page}: 250 cycles of cell-1, 2 axes\n")
    assert "tracking error [°]" in page.read_text()


def test_plot_errors(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(f"plot {recording} -o x.jpeg", capsys)[0] == 2
    assert call(f"plot {recording}.old", capsys)[2] == (
        f"catenary: {recording}.old: No such file or directory\n"
    )
    status, _, err = call(f"plot {recording} --axis elbow", capsys)
    assert status == 1
    assert err == "catenary: cell-1 has no axis 'elbow'\n  hint: its axes are joint0, joint1\n"
    status, _, err = call(f"plot {recording} --start 99", capsys)
    assert status == 2
    assert err.startswith(f"catenary: {recording} has no cycles in this time range")
    assert not recording.with_suffix(".png").exists()
    recording.write_text("text")
    status, _, err = call(f"plot {recording}", capsys)
    assert (status, "is not an MCAP file" in err) == (1, True)


def test_a_missing_matplotlib_names_the_extra(
    recording: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    status, _, err = call(f"plot {recording}", capsys)
    assert status == 1
    assert err == (
        "catenary: recordings need matplotlib, which is not installed\n"
        "  hint: pip install 'catenary[log]'\n"
    )
