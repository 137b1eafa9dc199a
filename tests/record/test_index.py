"""Index of a recording: parts equal those of the whole file; damaged and foreign files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from catenary import record
from catenary.errors import RecordingError
from catenary.record import index as module
from catenary.record.file import RecordingFile
from catenary.record.index import RecordingIndex
from tests.record.made import make_event, make_layout, make_rows


@pytest.fixture
def path(tmp_path: Path) -> Path:
    layout = make_layout(3)
    file = RecordingFile(tmp_path / "arm.mcap", layout)
    file.write_event(make_event(-3))
    file.write(make_rows(layout, 6000))
    file.write_event(make_event(5000))
    file.finish({"ended": "the loop ended", "lost": 2})
    return tmp_path / "arm.mcap"


@pytest.mark.parametrize(("start", "end"), [(0.0, 99.0), (2.0, 2.5), (0.0, 0.0), (5.9, 7.0)])
def test_a_part_equals_that_of_the_whole_file(path: Path, start: float, end: float) -> None:
    part, expected = RecordingIndex(path).read(start, end), record.read(path, start=start, end=end)
    assert np.array_equal(part.rows, expected.rows)
    assert np.array_equal(part.time, expected.time)
    assert (part.events, part.lost, part.ended) == (expected.events, expected.lost, expected.ended)


def test_a_part_reads_only_its_chunks(path: Path) -> None:
    index = RecordingIndex(path)
    assert index.duration == pytest.approx(5.999)
    assert len(index.chunks) > 5
    assert len(index.overlapping(2.0, 2.1)) <= 2
    damaged = bytearray(path.read_bytes())
    last = index.chunks[-1].place
    damaged[last.offset + 60 : last.end] = bytes(last.end - last.offset - 60)
    path.write_bytes(damaged)
    assert len(RecordingIndex(path).read(2.0, 2.1)) == 101
    assert RecordingIndex(path).read(5.9, 6.0).ended == "cut off"


def test_a_truncated_file_is_used_up_to_its_last_chunk(path: Path) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    index = RecordingIndex(path)
    assert index.ended == "cut off"
    assert 1.0 < index.duration < 5.0
    assert len(index.read(0.0, 99.0)) == len(record.read(path))


def test_events_are_found_without_reading_all_chunks(path: Path) -> None:
    index = RecordingIndex(path)
    assert index.events() == record.read(path).events
    assert len(index.events()) == 2
    with_events = [chunk for chunk in index.chunks if index._event_channel in chunk.channels]
    assert len(with_events) == 2 < len(index.chunks)


@pytest.mark.parametrize(
    "content", [b"", b"text", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + b"\xff" * 99]
)
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.mcap").write_bytes(content)
    with pytest.raises(RecordingError):
        RecordingIndex(tmp_path / "x.mcap")


def test_the_number_of_records_is_bounded(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "RECORDS_MAX", 5)
    with pytest.raises(RecordingError, match="too many records"):
        RecordingIndex(path)
