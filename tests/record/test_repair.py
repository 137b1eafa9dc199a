"""Reading and repair of truncated files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from catenary.errors import RecordingError
from catenary.record.file import RecordingFile
from catenary.record.mcap_records import CHUNK, DATA_END, MESSAGE_INDEX, METADATA, places
from catenary.record.recording import read
from catenary.record.repair import is_whole, repair
from tests.record.made import make_event, make_layout, make_rows

COUNT = 2200


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "whole.mcap"
    layout = make_layout(3)
    file = RecordingFile(path, layout)
    file.write(make_rows(layout, COUNT))
    file.write_event(make_event(COUNT))
    file.finish({"ended": "the loop ended", "cycles": COUNT, "lost": 4})
    return path


def cut(whole: Path, folder: Path, length: int) -> Path:
    path = folder / f"{length}.mcap"
    path.write_bytes(whole.read_bytes()[:length])
    return path


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """Return the end of every chunk, and the end of the index after it."""
    with path.open("rb") as stream:
        found = list(places(stream))
    chunks = [n for n, place in enumerate(found) if place.opcode == CHUNK]
    ends = []
    for n in chunks:
        last = n
        while found[last + 1].opcode == MESSAGE_INDEX:
            last += 1
        ends.append((found[n].end, found[last].end))
    return ends


def cuts(whole: Path) -> list[int]:
    """Return lengths that cut chunks, indexes or the summary, or fall between records."""
    ends, size = chunk_ends(whole), whole.stat().st_size
    inside = [*(end - 100 for end, _ in ends), *(end + 5 for end, _ in ends)]
    between = [place for pair in ends for place in pair]
    near_the_end = [size - 1, size - 20, size - 200, size - 900, ends[-1][1] + 30]
    return [ends[0][0] // 2, *inside, *between, *near_the_end]


def test_a_truncated_file_is_read_up_to_its_last_complete_chunk(
    whole: Path, tmp_path: Path
) -> None:
    rows = read(whole).rows
    ends = chunk_ends(whole)
    read_before = 0
    for length in sorted(length for length in cuts(whole) if length >= ends[0][0]):
        back = read(cut(whole, tmp_path, length))
        assert read_before <= len(back) <= COUNT
        assert np.array_equal(back.rows, rows[: len(back)])
        read_before = len(back)
    assert read_before == COUNT


def test_a_truncated_file_is_repaired(whole: Path, tmp_path: Path) -> None:
    rows = read(whole).rows
    for length in cuts(whole):
        path = cut(whole, tmp_path, length)
        before = read(path)
        repaired = repair(path)
        assert is_whole(path)
        after = read(path)
        assert np.array_equal(after.rows, rows[: len(after)])
        assert np.array_equal(after.rows, before.rows)
        assert path.stat().st_size <= whole.stat().st_size + 200  # the end record
        judge(path, len(after), repaired.chunks)


def judge(path: Path, count: int, chunks: int) -> None:
    """Check a file with the MCAP library, which uses the index."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) == chunks
        numbers = [m.sequence for _, c, m in reader.iter_messages(topics=["/cell_1/cycle"])]
        assert [m.name for m in reader.iter_metadata()] == ["catenary.layout", "catenary.end"]
        for index in summary.chunk_indexes:
            assert {opcode_at(path, at) for at in index.message_index_offsets.values()} == {7}
            end = index.chunk_start_offset + index.chunk_length + index.message_index_length
            assert opcode_at(path, end) in (CHUNK, METADATA, DATA_END)
    assert numbers == list(range(1, len(numbers) + 1))
    assert count <= len(numbers) <= count + 1  # the last cycle may lack its other messages
    counts = summary.statistics.channel_message_counts
    assert sum(counts.values()) == summary.statistics.message_count


def opcode_at(path: Path, offset: int) -> int:
    with path.open("rb") as stream:
        stream.seek(offset)
        return stream.read(1)[0]


def test_rosbags_reads_a_repaired_file(whole: Path, tmp_path: Path) -> None:
    path = cut(whole, tmp_path, chunk_ends(whole)[2][0] + 3)
    repair(path)
    with AnyReader([path]) as reader:
        positions = [
            reader.deserialize(raw, connection.msgtype).position
            for connection, _, raw in reader.messages()
            if connection.topic == "/cell_1/joint_states"
        ]
    assert np.array_equal(positions, read(whole)["position"][: len(positions)])
    assert len(positions) > 500


def test_repair_keeps_the_end_record_of_the_recorder(whole: Path, tmp_path: Path) -> None:
    path = cut(whole, tmp_path, whole.stat().st_size - 1)
    repair(path)
    assert (read(path).ended, read(path).lost) == ("the loop ended", 4)
    path = cut(whole, tmp_path, chunk_ends(whole)[1][1])
    assert read(path).ended == "cut off"
    repair(path)
    assert read(path).ended == "cut off, and repaired"


def test_repair_does_not_change_a_complete_file(whole: Path, tmp_path: Path) -> None:
    path = cut(whole, tmp_path, whole.stat().st_size)
    assert repair(path).dropped == 0
    assert path.read_bytes() == whole.read_bytes()


def test_repair_removes_everything_from_a_damaged_chunk_on(whole: Path, tmp_path: Path) -> None:
    """After a power failure, a file may contain zeros instead of data."""
    data = bytearray(whole.read_bytes())
    end = chunk_ends(whole)[2][0]
    data[end - 4000 : end - 3000] = bytes(1000)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data[:-1])
    kept = len(read(path))
    assert 900 < kept < 1500
    assert repair(path).chunks == 2
    judge(path, kept, 2)


def test_zeros_after_the_last_record_are_ignored(whole: Path, tmp_path: Path) -> None:
    path = cut(whole, tmp_path, chunk_ends(whole)[1][1])
    with path.open("ab") as stream:
        stream.write(bytes(5000))
    assert repair(path).chunks == 2
    judge(path, len(read(path)), 2)


def test_on_a_full_disk_the_summary_replaces_the_last_chunk(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = cut(whole, tmp_path, chunk_ends(whole)[3][1])
    room = path.stat().st_size
    real_open = Path.open

    def narrow(self: Path, *arguments: object, **options: object) -> object:
        return Narrow(real_open(self, *arguments, **options), room)

    monkeypatch.setattr(Path, "open", narrow)
    repaired = repair(path)
    monkeypatch.undo()
    assert repaired.chunks == 3
    assert path.stat().st_size <= room
    judge(path, len(read(path)), 3)


class Narrow:
    """A file on a disk that is full after `room` bytes."""

    def __init__(self, file: object, room: int) -> None:
        self._file = file
        self._room = room

    def write(self, data: bytes) -> int:
        free = self._room - self._file.tell()
        if free <= 0:
            raise OSError(28, os.strerror(28))
        return self._file.write(data[:free])

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)

    def __enter__(self) -> Narrow:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"not a recording at all" * 9])
def test_a_file_that_is_not_a_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"x\.mcap is not"):
        read(path)


def test_repair_does_not_change_other_files(tmp_path: Path) -> None:
    path = tmp_path / "thesis.txt"
    path.write_text("three years of work")
    with pytest.raises(RecordingError, match="is not an MCAP file"):
        repair(path)
    assert path.read_text() == "three years of work"


def test_repair_does_not_change_mcap_files_of_other_programs(tmp_path: Path) -> None:
    path = tmp_path / "camera.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("camera", {})
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="not a recording of Catenary") as caught:
        repair(path)
    assert "mcap recover" in caught.value.hint
    assert path.read_bytes() == before
