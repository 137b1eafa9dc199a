"""Folders of shares: lock timeouts, drafts of killed processes, owners of files."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from catenary.errors import ShareError
from catenary.share import folder
from tests.share.processes import started

HOLD = """
import fcntl, os, sys
fcntl.flock(os.open(sys.argv[1], os.O_RDONLY), fcntl.LOCK_EX)
print("locked", flush=True)
sys.stdin.readline()
"""


def test_lock_times_out_and_names_its_holder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folder, "LOCK_TIMEOUT", 0.02)
    with started(HOLD, str(tmp_path)) as holder:
        assert holder.line() == "locked"
        locked = pytest.raises(ShareError, match=f"locked for .* by process {holder.process.pid}")
        with locked, folder.deciding(tmp_path):
            pass
    with folder.deciding(tmp_path):
        pass


def ended_process() -> int:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        return process.pid


@pytest.mark.parametrize(
    ("alive", "age", "stays"), [(False, 100.0, False), (False, 0.0, True), (True, 100.0, True)]
)
def test_old_drafts_of_killed_processes_are_removed(
    tmp_path: Path, alive: bool, age: float, stays: bool
) -> None:
    draft = tmp_path / f".draft-{os.getpid() if alive else ended_process()}-0123"
    draft.touch()
    now = draft.stat().st_mtime
    os.utime(draft, (now - age, now - age))
    (tmp_path / ".draft-x").touch()
    folder.remove_old_drafts(tmp_path)
    assert draft.exists() == stays
    assert (tmp_path / ".draft-x").exists()


@pytest.fixture
def user_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Replace /dev/shm, and remove the group folder."""
    monkeypatch.setattr(folder, "USER_FOLDERS", tmp_path)
    monkeypatch.setattr(folder, "GROUP_FOLDER", tmp_path / "none")
    return tmp_path


@pytest.mark.parametrize(
    ("file_mode", "folder_mode"), [(0o600, 0o700), (0o640, 0o711), (0o604, 0o711), (0o664, 0o711)]
)
def test_folder_is_searchable_if_a_file_grants_access(
    user_folders: Path, file_mode: int, folder_mode: int
) -> None:
    own = folder.own_folder()
    assert own == user_folders / f"catenary-{os.geteuid()}"
    folder.prepare(own, file_mode)
    assert own.stat().st_mode & 0o7777 == folder_mode
    folder.prepare(own, 0o600)  # a second file does not revoke the permissions
    assert own.stat().st_mode & 0o7777 == folder_mode


def test_folder_name_has_the_user_id_outside_of_the_namespace(
    user_folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a private network an ordinary user is root, but must not use the folder of root."""
    (tmp_path / "uid_map").write_text("         0      64001          1\n")
    monkeypatch.setattr(folder, "USER_IDS", tmp_path / "uid_map")
    assert folder.user_folder(0) == user_folders / "catenary-64001"
    assert folder.user_folder(7) == user_folders / "catenary-7"  # not mapped


def test_permissions_of_an_open_folder_are_restricted(user_folders: Path) -> None:
    own = folder.own_folder()
    own.mkdir()
    own.chmod(0o777)
    folder.prepare(own, 0o600)
    assert own.stat().st_mode & 0o066 == 0


def test_file_instead_of_a_folder_is_refused(user_folders: Path) -> None:
    folder.own_folder().touch()
    with pytest.raises(ShareError, match="and is not a folder"):
        folder.prepare(folder.own_folder(), 0o600)


def test_group_folder_with_unsafe_permissions_is_not_used(
    user_folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    common = user_folders / "common"
    common.mkdir()
    monkeypatch.setattr(folder, "GROUP_FOLDER", common)
    common.chmod(0o777)
    assert folder.own_folder() == folder.user_folder(os.geteuid())
    common.chmod(0o2770)  # not sticky: its group could replace the files of others
    assert folder.own_folder() == folder.user_folder(os.geteuid())
    if os.geteuid() == 0:  # otherwise root does not own the folder
        for mode in (0o755, 0o3771):
            common.chmod(mode)
            assert folder.own_folder() == common


def test_missing_file_is_not_found(user_folders: Path) -> None:
    with pytest.raises(FileNotFoundError):
        folder.find("share-arm", None)
    assert folder.names(None) == []
    folder.prepare(folder.own_folder(), 0o600)
    (folder.own_folder() / "share-arm").touch()
    assert folder.find("share-arm", None) == folder.own_folder() / "share-arm"
    assert folder.names(None) == ["arm"]
