"""Compiled laws are cached only where no other user can write; otherwise there is a warning."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import pytest

from catenary.loop.laws.cache import cache_folder, make_cache, private_folder

NOBODY = 65534


def law(x: float) -> float:
    return 2.0 * x


def test_it_is_below_the_users_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/somebody")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache_folder() == Path("/home/somebody/.cache/catenary/laws")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # ignored, as the specification asks
    assert cache_folder() == Path("/home/somebody/.cache/catenary/laws")
    monkeypatch.setenv("XDG_CACHE_HOME", "/big/cache")
    assert cache_folder() == Path("/big/cache/catenary/laws")


def test_a_folder_becomes_private(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    assert private_folder(folder) == folder
    assert folder.stat().st_mode & 0o7777 == 0o700


def test_a_folder_above_that_others_can_write_is_refused(tmp_path: Path) -> None:
    above = tmp_path / "above"
    above.mkdir()
    above.chmod(0o775)
    with pytest.raises(PermissionError, match=f"other users can write in {above}"):
        private_folder(above / "laws")
    above.chmod(0o1777)  # sticky, as /tmp: others cannot exchange what is ours
    private_folder(above / "laws")


@pytest.mark.parametrize("name", ["law.nbi", "law.nbc"])
def test_a_file_that_others_can_write_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / name).touch()
    (tmp_path / "laws" / name).chmod(0o666)
    with pytest.raises(PermissionError, match=name):
        private_folder(tmp_path / "laws")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
@pytest.mark.parametrize("given", ["laws", "above"])
def test_a_folder_of_another_user_is_refused(tmp_path: Path, given: str) -> None:
    folder = tmp_path / "above" / "laws"
    folder.mkdir(parents=True)
    os.chown(folder if given == "laws" else folder.parent, NOBODY, NOBODY)
    with pytest.raises(PermissionError, match=f"belongs to user {NOBODY}"):
        private_folder(folder)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_root_with_the_home_of_a_user_creates_and_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """sudo can keep HOME: the user's links must not choose what root creates or makes private."""
    home, target = tmp_path / "home", tmp_path / "etc"
    target.mkdir(mode=0o755)
    home.mkdir()
    os.chown(home, NOBODY, NOBODY)
    monkeypatch.setenv("HOME", str(home))
    refused = f"belongs to user {NOBODY}"
    with pytest.raises(PermissionError, match=refused):
        private_folder(home / ".cache" / "laws")
    assert not list(home.iterdir())
    (home / "laws").symlink_to(target)
    with pytest.raises(PermissionError, match=refused):
        private_folder(home / "laws")
    assert target.stat().st_mode & 0o777 == 0o755


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a link away")
def test_a_link_of_another_user_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o1777)  # sticky: others can create names there
    (tmp_path / "place").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "place")
    os.lchown(tmp_path / "link", NOBODY, NOBODY)
    with pytest.raises(PermissionError, match=f"link belongs to user {NOBODY}"):
        private_folder(tmp_path / "link" / "laws")
    assert not list((tmp_path / "place").iterdir())


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_folders_above_the_home_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They belong to user 65534 in a user namespace, such as that of an ordinary user's demo."""
    home = tmp_path / "homes" / "alice"
    home.mkdir(parents=True)
    os.chown(home.parent, NOBODY, NOBODY)
    monkeypatch.setenv("HOME", str(home))
    assert private_folder(home / ".cache" / "laws") == home / ".cache" / "laws"
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(PermissionError, match=f"belongs to user {NOBODY}"):
        private_folder(home / ".cache" / "laws")


def test_a_link_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "place").mkdir(mode=0o755)
    (tmp_path / "laws").symlink_to(tmp_path / "place")
    with pytest.raises(PermissionError, match="is a symbolic link"):
        private_folder(tmp_path / "laws")
    assert (tmp_path / "place").stat().st_mode & 0o777 == 0o755


def test_a_link_is_followed_once(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "place")
    (tmp_path / "place").mkdir()
    assert private_folder(tmp_path / "link" / "laws") == tmp_path / "place" / "laws"


def test_without_a_folder_there_is_a_warning_and_no_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert make_cache(law) is not None
    tmp_path.chmod(0o777)
    with pytest.warns(RuntimeWarning, match="other users can write in"):
        assert make_cache(law) is None
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.warns(RuntimeWarning, match="not cached"):
        assert make_cache(law) is None


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_damaged_file_is_compiled_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    numba = pytest.importorskip("numba", reason="laws are compiled by Numba")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def compiled() -> int:
        function = numba.njit(law)
        function._cache = make_cache(law)
        assert function(2.0) == 4.0
        return sum(function.stats.cache_hits.values())

    assert compiled() == 0
    assert compiled() == 1
    [file] = (tmp_path / "catenary" / "laws").glob(f"*.{suffix}")
    file.write_bytes(file.read_bytes()[:40])
    assert compiled() == 0
    assert compiled() == 1
