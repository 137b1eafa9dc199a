"""The disk is full, or the file reaches its quota, during a recording.
The recorder ends with status 1 and reports how far it got. The file is valid and has an index,
which replaces its last chunk. The loop is not affected.
"""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader

from catenary import record
from tests.record.beside import DEADLINE, recorder, shared_loop
from tests.share.names import own_name

ROOM = 400_000  # bytes


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("arm") as name:
        yield name


def judge(path: Path) -> None:
    """Check that other programs can read the file, and that it has no gaps."""
    assert path.stat().st_size <= ROOM
    recording = record.read(path)
    assert len(recording) >= 500
    assert recording["number"].tolist() == list(range(1, len(recording) + 1))
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        seen = sum(1 for _ in reader.iter_messages())
    assert seen == summary.statistics.message_count >= 3 * len(recording)


def test_a_file_with_a_quota(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.mcap"
    with shared_loop(name) as shared:
        with recorder(name, path, wrap=("prlimit", f"--fsize={ROOM}")) as child:
            shared.run(20_000)
            said, errors = child.communicate(timeout=DEADLINE)
        shared.run(10)
    assert (child.returncode, said) == (1, "")
    assert f"{path}: File too large; the recording is readable, but ends after " in errors
    judge(path)
    assert record.read(path).ended == "File too large"


def test_a_full_disk(name: str, tmp_path: Path) -> None:
    disk, kept = tmp_path / "disk", tmp_path / "kept.mcap"
    disk.mkdir()
    script = (
        f"mount -t tmpfs -o size={ROOM} tmpfs {disk} && "
        f'{{ "$@"; status=$?; cp {disk}/arm.mcap {kept}; exit $status; }}'
    )
    private = ("unshare", "--mount")
    if shutil.which("unshare") is None or subprocess.run([*private, "true"]).returncode != 0:
        pytest.skip("no mount namespace: this machine gives none to this user")
    wrap = (*private, "sh", "-c", script, "sh")
    with shared_loop(name) as shared, recorder(name, disk / "arm.mcap", wrap=wrap) as child:
        shared.run(20_000)
        said, errors = child.communicate(timeout=DEADLINE)
    assert (child.returncode, said) == (1, "")
    assert "arm.mcap: No space left on device; the recording is readable" in errors
    judge(kept)
