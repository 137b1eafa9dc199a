"""Merge of recordings: order, offsets, names, damaged files; and two loops, end to end."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import catenary as cat
from catenary import record
from catenary.cli.main import main as catenary
from catenary.errors import RecordingError
from catenary.record.file import RecordingFile
from tests.record.beside import shared_loop
from tests.record.made import make_event, make_layout, make_rows
from tests.share.names import own_name

mcap_reader = pytest.importorskip("mcap.reader", reason="needs catenary[log]")

OFFSET = 0.25  # [s]


def write(path: Path, name: str, *, clock: str = "monotonic", count: int = 1500) -> Path:
    layout = msgspec.structs.replace(make_layout(2), name=name, clock=clock)
    file = RecordingFile(path, layout)
    rows = make_rows(layout, count)
    file.write(rows)
    file.write_event(make_event(5))
    file.finish({"ended": "stopped", "lost": 0})
    return path


def messages(path: Path) -> Iterator[tuple[str, int, int, bytes]]:
    """Yield topic, log time, sequence and data of each message in the order of the file's times."""
    with path.open("rb") as stream:
        for _, channel, message in mcap_reader.make_reader(stream).iter_messages():
            yield channel.topic, message.log_time, message.sequence, message.data


@pytest.fixture
def two(tmp_path: Path) -> tuple[Path, Path]:
    return write(tmp_path / "a.mcap", "left"), write(tmp_path / "b.mcap", "right")


def test_all_messages_are_there_in_the_order_of_their_times(
    two: tuple[Path, Path], tmp_path: Path
) -> None:
    merged = record.merge(two, tmp_path / "c.mcap")
    found = list(messages(tmp_path / "c.mcap"))
    expected = sorted(each for path in two for each in messages(path))
    assert sorted(found) == expected
    assert [each[1] for each in found] == sorted(each[1] for each in found)
    assert {topic.split("/")[1] for topic in merged.messages} == {"left", "right"}
    assert sum(merged.messages.values()) == len(found)
    assert merged.seconds == pytest.approx((found[-1][1] - found[0][1]) * 1e-9)


def test_the_messages_of_both_files_alternate(two: tuple[Path, Path], tmp_path: Path) -> None:
    record.merge(two, tmp_path / "c.mcap")
    cycles = [t for t, *_ in messages(tmp_path / "c.mcap") if t.endswith("/cycle")]
    assert set(cycles[:2]) == set(cycles[-2:]) == {"/left/cycle", "/right/cycle"}


def test_an_offset_moves_the_times_and_the_stamps(two: tuple[Path, Path], tmp_path: Path) -> None:
    record.merge([two[0], record.MergeInput(two[1], OFFSET)], tmp_path / "c.mcap")

    def of(path: Path) -> dict[tuple[str, int], tuple[int, bytes]]:
        return {
            (topic, sequence): (time, data)
            for topic, time, sequence, data in messages(path)
            if topic.startswith("/right") and not topic.endswith(("/log", "/events"))
        }

    before, after = of(two[1]), of(tmp_path / "c.mcap")
    assert before.keys() == after.keys()
    for key, (time, data) in after.items():
        seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
        assert time == before[key][0] + round(OFFSET * 1e9) == seconds * 10**9 + nanoseconds
        assert data[12:] == before[key][1][12:]


def test_equal_names_are_replaced_by_those_of_the_files(tmp_path: Path) -> None:
    paths = write(tmp_path / "upper.mcap", "arm"), write(tmp_path / "lower.mcap", "arm")
    merged = record.merge(paths, tmp_path / "c.mcap")
    assert {topic.split("/")[1] for topic in merged.messages} == {"upper", "lower"}


def test_equal_names_of_shares_and_files_are_refused(tmp_path: Path) -> None:
    paths = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        paths.append(write(tmp_path / folder / "arm.mcap", "arm"))
    with pytest.raises(RecordingError, match="several recordings would have the name 'arm'"):
        record.merge(paths, tmp_path / "c.mcap")


def test_a_truncated_file_is_used_up_to_its_last_chunk(
    two: tuple[Path, Path], tmp_path: Path
) -> None:
    whole = len(list(messages(two[1])))
    two[1].write_bytes(two[1].read_bytes()[: two[1].stat().st_size // 2])
    merged = record.merge(two, tmp_path / "c.mcap")
    right = sum(count for topic, count in merged.messages.items() if topic.startswith("/right"))
    assert 0 < right < whole
    assert merged.messages["/left/cycle"] == 1500


def test_virtual_and_real_time_are_not_mixed(two: tuple[Path, Path], tmp_path: Path) -> None:
    other = write(tmp_path / "v.mcap", "simulated", clock="virtual")
    with pytest.raises(RecordingError, match="different clocks"):
        record.merge([two[0], other], tmp_path / "c.mcap")


def test_what_is_refused_leaves_no_file(two: tuple[Path, Path], tmp_path: Path) -> None:
    other = tmp_path / "x.mcap"
    other.write_bytes(b"no recording at all")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        record.merge([two[0], other], tmp_path / "c.mcap")
    with pytest.raises(RecordingError, match="two or more"):
        record.merge(two[:1], tmp_path / "c.mcap")
    assert not (tmp_path / "c.mcap").exists()


def test_a_failed_merge_leaves_no_file(two: tuple[Path, Path], tmp_path: Path) -> None:
    late = record.MergeInput(two[1], offset=1e11)  # beyond the seconds of a stamp
    with pytest.raises(RecordingError):
        record.merge([two[0], late], tmp_path / "c.mcap")
    assert not (tmp_path / "c.mcap").exists()


def test_an_existing_file_is_kept(two: tuple[Path, Path], tmp_path: Path) -> None:
    target = tmp_path / "c.mcap"
    target.write_text("precious")
    with pytest.raises(RecordingError, match="already exists"):
        record.merge(two, target)
    assert target.read_text() == "precious"
    record.merge(two, target, force=True)
    with pytest.raises(RecordingError, match="also a recording to merge"):
        record.merge(two, two[0], force=True)


def test_a_merged_file_is_not_a_recording(two: tuple[Path, Path], tmp_path: Path) -> None:
    record.merge(two, tmp_path / "c.mcap")
    with pytest.raises(RecordingError, match="not a recording of Catenary"):
        record.merge([two[0], tmp_path / "c.mcap"], tmp_path / "d.mcap")


def test_the_recordings_of_two_loops(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = []
    for side in ("left", "right"):
        with own_name(side) as name, shared_loop(name) as shared, cat.attach(name) as share:
            paths.append(tmp_path / f"{side}.mcap")
            with record.Recorder(share, paths[-1]):
                shared.run(200)
    both = tmp_path / "both.mcap"
    files = [str(path) for path in paths]
    status = catenary(["merge", *files, "-o", str(both), "--offset", f"{files[1]}=0.5", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert status == 0
    assert sum(report["messages"].values()) == sum(len(list(messages(path))) for path in paths)
    assert sum(topic.endswith("/cycle") for topic in report["messages"]) == 2


@pytest.mark.parametrize("text", ["a.mcap", "a.mcap=", "=1", "a.mcap=nan"])
def test_a_wrong_offset_is_an_error(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        catenary(["merge", "a.mcap", "b.mcap", "-o", "c.mcap", "--offset", text])
    assert "FILE=SECONDS" in capsys.readouterr().err


def test_an_offset_of_another_file_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert catenary(["merge", "a.mcap", "b.mcap", "-o", "c.mcap", "--offset", "d.mcap=1"]) == 2
    assert "not a file to merge" in capsys.readouterr().err
