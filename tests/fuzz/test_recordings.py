"""A damaged recording is read up to the damage, or refused with a clear message."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import RecordingError
from catenary.record.file import RecordingFile
from catenary.record.mcap_records import places
from catenary.record.merge import merge
from catenary.record.recording import read
from catenary.record.repair import is_whole, repair
from tests.record.made import make_event, make_layout, make_rows

LAYOUT = make_layout(2)
ROWS = make_rows(LAYOUT, 900)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


@pytest.fixture(scope="module")
def whole(folder: Path) -> bytes:
    file = RecordingFile(folder / "whole.mcap", LAYOUT)
    file.write(ROWS)
    file.write_event(make_event(900))
    file.finish({"ended": "the loop ended", "lost": 0})
    return (folder / "whole.mcap").read_bytes()


@pytest.fixture(scope="module")
def starts(folder: Path, whole: bytes) -> list[int]:
    """Return the offsets at which records begin, which are the most critical places."""
    with (folder / "whole.mcap").open("rb") as stream:
        return [place.offset for place in places(stream)]


@pytest.fixture(scope="module")
def merged(folder: Path, whole: bytes) -> bytes:
    """Return a merged file: two copies of the recording, as `one` and `two`."""
    copies = [folder / "one.mcap", folder / "two.mcap"]
    for copy in copies:
        copy.write_bytes(whole)
    merge(copies, folder / "merged.mcap")
    assert np.array_equal(read(folder / "merged.mcap", share="two").rows, ROWS)
    return (folder / "merged.mcap").read_bytes()


DAMAGES = st.lists(
    st.tuples(st.integers(0, 100), st.integers(0, 120), st.binary(min_size=1, max_size=12)),
    min_size=1,
    max_size=3,
)


def check(path: Path, share: str | None = None) -> None:
    """Check that the readable part equals the written data."""
    try:
        back = read(path, share=share)
    except RecordingError:
        return
    if (
        msgspec.structs.replace(back.layout, name=LAYOUT.name) == LAYOUT
    ):  # damage may have changed a name
        assert np.array_equal(back.rows, ROWS[back["number"].astype(int) - 1])


@given(damages=DAMAGES, kept=st.floats(0.5, 1.0))
def test_damage_is_found(
    whole: bytes,
    starts: list[int],
    folder: Path,
    damages: list[tuple[int, int, bytes]],
    kept: float,
) -> None:
    data, path = bytearray(whole), folder / "damaged.mcap"
    for record, offset, written in damages:
        at = starts[record % len(starts)] + offset
        data[at : at + len(written)] = written
    path.write_bytes(data[: int(kept * len(data))])
    check(path)
    try:
        repair(path)
    except RecordingError:
        return
    assert is_whole(path)
    check(path)


@given(damages=DAMAGES, start=st.integers(0, 3000))
def test_damage_of_a_merged_recording_is_found(
    merged: bytes, folder: Path, damages: list[tuple[int, int, bytes]], start: int
) -> None:
    """Damage the metadata at the start, which describe the shares, or a chunk after them."""
    data, path = bytearray(merged), folder / "damaged.mcap"
    for record, offset, written in damages:
        at = start + 30 * record + offset
        data[at : at + len(written)] = written
    path.write_bytes(data)
    check(path, "two")


@given(data=st.binary(max_size=300))
def test_a_file_with_only_the_start_of_a_recording(folder: Path, data: bytes) -> None:
    path = folder / "short.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + data)
    with pytest.raises(RecordingError):
        read(path)
