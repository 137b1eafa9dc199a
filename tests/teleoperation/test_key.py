from __future__ import annotations

import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.teleoperation import make_key, read_key
from catenary.teleoperation.key import VARIABLE

READ = "import sys; from catenary.teleoperation import read_key; read_key(sys.argv[1])"


def test_a_new_key_is_private_and_random(tmp_path: Path) -> None:
    one, other = make_key(tmp_path / "one"), make_key(tmp_path / "other")
    assert stat.S_IMODE((tmp_path / "one").stat().st_mode) == 0o600
    assert len(one) == 32
    assert one != other
    assert read_key(tmp_path / "one") == one


def test_an_existing_key_is_kept(tmp_path: Path) -> None:
    key = make_key(tmp_path / "key")
    with pytest.raises(FileExistsError):
        make_key(tmp_path / "key")
    assert read_key(tmp_path / "key") == key


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o622, 0o666])
def test_a_key_that_others_can_use_is_refused(tmp_path: Path, mode: int) -> None:
    make_key(tmp_path / "key")
    (tmp_path / "key").chmod(mode)
    with pytest.raises(ConfigurationError, match=f"mode {mode:o}.*\n.*chmod 600"):
        read_key(tmp_path / "key")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_a_key_of_another_user_is_refused(tmp_path: Path) -> None:
    make_key(tmp_path / "key")
    os.chown(tmp_path / "key", 12345, -1)
    with pytest.raises(ConfigurationError, match=r"belongs to user 12345.*user 0\n.*chown 0 "):
        read_key(tmp_path / "key")


def test_a_link_to_a_key_is_refused(tmp_path: Path) -> None:
    make_key(tmp_path / "key")
    (tmp_path / "link").symlink_to("key")
    with pytest.raises(ConfigurationError, match=r"symbolic link(.|\n)*name the file itself"):
        read_key(tmp_path / "link")


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_not_a_file_is_refused_at_once(
    tmp_path: Path, make: Callable[[Path, int], None]
) -> None:
    make(tmp_path / "key", 0o600)
    command = [sys.executable, "-c", READ, str(tmp_path / "key")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert "ConfigurationError" in done.stderr
    assert "is not a file" in done.stderr


def test_a_device_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="/dev/zero is not a file"):
        read_key("/dev/zero")


def test_a_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    """The digits at its begin are a key, but the file is another one."""
    path = tmp_path / "key"
    path.write_text("ab" * 32 + " " * 4096 + "zz")
    path.chmod(0o600)
    with pytest.raises(ConfigurationError, match="has 4162 bytes, and a key file 65"):
        read_key(path)


@pytest.mark.parametrize("text", ["", "zz", "00" * 31, "00" * 33, "geheim\xe4"])
def test_an_invalid_key_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "key"
    path.write_text(text)
    path.chmod(0o600)
    with pytest.raises(ConfigurationError, match="64 hexadecimal digits"):
        read_key(path)


def test_a_missing_key_tells_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"No such file(.|\n)*catenary.teleoperation.key"):
        read_key(tmp_path / "none")


def test_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "ab" * 32)
    assert read_key() == b"\xab" * 32
    monkeypatch.delenv(VARIABLE)
    with pytest.raises(ConfigurationError, match=f"{VARIABLE} is not set"):
        read_key()


def test_the_program_writes_a_key_once(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "catenary.teleoperation.key", str(tmp_path / "key")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    key = read_key(tmp_path / "key")
    assert key.hex() not in done.stdout
    again = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert again.returncode == 1
    assert "exists" in again.stderr
    assert read_key(tmp_path / "key") == key


def test_the_program_reports_where_it_cannot_write(tmp_path: Path) -> None:
    path = str(tmp_path / "none" / "key")
    command = [sys.executable, "-m", "catenary.teleoperation.key", path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: cannot write {path}: No such file or directory")
