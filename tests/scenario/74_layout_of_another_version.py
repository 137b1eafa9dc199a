"""The file of a share was written by another release, is truncated, or is not a share.
Readers refuse it and name both versions. A writer does not overwrite an unknown file.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.share.folder import own_folder
from catenary.share.layout import HEADER, MAGIC, VERSION
from catenary.virtual import Segment, Servo
from tests.share.names import own_name, state_file


@pytest.fixture
def shared() -> Iterator[tuple[str, Path]]:
    """Yield a name, and the file of a share that a loop has written."""
    with own_name("version") as name, cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        path = state_file(name)
        with cat.Share(name, history=0.01) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            bytes_ = path.read_bytes()
        path.write_bytes(bytes_)
        yield name, path


def assert_refused(name: str, said: str) -> None:
    with pytest.raises(ShareError, match=f"the share '{name}': .*{said}"):
        cat.attach(name, stale=True)
    with pytest.raises(ShareError, match="exists and cannot be replaced"), cat.Share(name):
        pass


def test_another_version_is_refused(shared: tuple[str, Path]) -> None:
    name, path = shared
    cat.attach(name)  # unchanged
    content = path.read_bytes()
    path.write_bytes(MAGIC + (VERSION + 1).to_bytes(4, "little") + content[12:])
    assert_refused(name, f"version {VERSION + 1}, but this program reads version {VERSION}")


@pytest.mark.parametrize("kept", [5, HEADER.size, 300, -1])
def test_a_truncated_file_is_refused(shared: tuple[str, Path], kept: int) -> None:
    name, path = shared
    path.write_bytes(path.read_bytes()[:kept])
    assert_refused(name, "truncated" if kept != 5 else "not a Catenary share")


def test_a_broken_description_is_refused(shared: tuple[str, Path]) -> None:
    name, path = shared
    content = path.read_bytes()
    path.write_bytes(content[: HEADER.size] + b"[" + content[HEADER.size + 1 :])
    assert_refused(name, "description is invalid")


@pytest.mark.parametrize(
    ("says", "instead"),
    [
        (b'"count":64', b'"count":65'),
        (b'"count":256', b'"count":999'),
        (b'"size":1024', b'"size":9999'),
    ],
)
def test_a_description_of_another_size_is_refused(
    shared: tuple[str, Path], says: bytes, instead: bytes
) -> None:
    name, path = shared
    content = path.read_bytes()
    assert says in content
    path.write_bytes(content.replace(says, instead, 1))
    with pytest.raises(ShareError, match=r"a ring|does not (fit|match)|invalid"):
        cat.attach(name, stale=True)


@pytest.mark.parametrize("content", [b"", b"something else", bytes(8192)])
def test_a_file_that_is_not_a_share_is_refused(content: bytes) -> None:
    with own_name("else") as name:
        own_folder().mkdir(0o700, exist_ok=True)
        state_file(name).write_bytes(content)
        assert_refused(name, "is empty" if not content else "not a Catenary share")
