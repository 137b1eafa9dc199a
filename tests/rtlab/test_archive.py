"""The root of the guest as a cpio archive, checked with a reader in this file."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path

import pytest

from tools.rtlab import archive


def read(data: bytes) -> dict[str, tuple[int, int, bytes, tuple[int, int]]]:
    """Return mode, mtime, content and device numbers by path, in the order of the archive."""
    found = {}
    at = 0
    while True:
        assert data[at : at + 6] == b"070701"
        numbers = [int(data[at + 6 + 8 * k : at + 14 + 8 * k], 16) for k in range(13)]
        mode, mtime, size, name_size = numbers[1], numbers[5], numbers[6], numbers[11]
        name = data[at + 110 : at + 110 + name_size - 1].decode()
        body = at + (110 + name_size + 3) // 4 * 4
        if name == "TRAILER!!!":
            return found
        assert name not in found
        found[name] = mode, mtime, data[body : body + size], (numbers[9], numbers[10])
        at = body + (size + 3) // 4 * 4


def written(*entries: archive.Entry) -> dict[str, tuple[int, int, bytes, tuple[int, int]]]:
    file = io.BytesIO()
    archive.write(entries, file)
    return read(file.getvalue())


@pytest.mark.parametrize("content", ["", "1", "12", "123", "1234"])
def test_a_file_keeps_its_content_mode_and_time(tmp_path: Path, content: str) -> None:
    source = tmp_path / "x.py"
    source.write_text(content)
    os.utime(source, (5, 1_700_000_000))
    found = written(archive.copy_of(source, "/a/x.py"))
    assert found["a/x.py"] == (stat.S_IFREG | 0o644, 1_700_000_000, content.encode(), (0, 0))


def test_folders_precede_their_files_and_occur_once() -> None:
    found = written(archive.text("/a/b/c", "1"), archive.text("/a/d", "2"), archive.folder("/a"))
    assert list(found) == ["a", "a/b", "a/b/c", "a/d"]
    assert stat.S_ISDIR(found["a"][0])


def test_links_and_devices() -> None:
    found = written(archive.link("/lib", "usr/lib"), archive.character_device("/dev/console", 5, 1))
    assert found["lib"][2] == b"usr/lib"
    assert stat.S_ISLNK(found["lib"][0])
    assert found["dev/console"][3] == (5, 1)
    assert stat.S_ISCHR(found["dev/console"][0])


def test_a_program_stays_executable(tmp_path: Path) -> None:
    program = tmp_path / "run"
    program.touch()
    program.chmod(0o700)
    assert written(archive.copy_of(program, "/run"))["run"][0] == stat.S_IFREG | 0o755


def test_a_link_is_stored_as_a_file_with_its_own_name(tmp_path: Path) -> None:
    (tmp_path / "libx.so.1.2").write_bytes(b"elf")
    (tmp_path / "libx.so.1").symlink_to("libx.so.1.2")
    found = written(archive.copy_of(tmp_path / "libx.so.1", "/libx.so.1"))
    assert found["libx.so.1"][2] == b"elf"


def test_the_fingerprint_depends_on_the_content(tmp_path: Path) -> None:
    source = tmp_path / "x"
    source.write_text("1")
    before = archive.fingerprint_of(archive.copy_of(source))
    source.write_text("12")
    assert archive.fingerprint_of(archive.copy_of(source)) != before
