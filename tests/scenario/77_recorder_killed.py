"""The recorder is killed (kill -9) during a recording and does not finish its file.
The loop is not affected. The file is readable up to the last half second.
`--repair` adds the index that PlotJuggler needs.
"""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from catenary import record
from tests.record.beside import DEADLINE, command, has_bytes, recorder, shared_loop, until
from tests.share.names import own_name


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("arm") as name:
        yield name


def test_a_killed_recorder_leaves_a_readable_file(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.mcap"
    with shared_loop(name) as shared:
        with recorder(name, path) as child:
            shared.run(5000)
            assert until(has_bytes(path, 100_000))
            child.kill()
            child.wait(DEADLINE)
        shared.run(10)  # the cycles continue
    recording = record.read(path)
    assert recording.ended == "cut off"
    assert len(recording) >= 500
    assert recording["number"].tolist() == list(range(1, len(recording) + 1))

    repaired = subprocess.run(
        command("record", "--repair", path), capture_output=True, text=True, timeout=DEADLINE
    )
    assert (repaired.returncode, repaired.stderr) == (0, "")
    assert f"{path}: repaired" in repaired.stdout
    with path.open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.chunk_indexes
    with AnyReader([path]) as bag:
        states = [c for c in bag.connections if c.topic.endswith("joint_states")]
        assert sum(1 for _ in bag.messages(states)) >= len(recording)
    assert len(record.read(path)) == len(recording)
    assert record.read(path).ended == "cut off, and repaired"
