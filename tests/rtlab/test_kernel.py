"""Debian's kernel: output of apt, dependencies of modules, and errors of one line."""

from __future__ import annotations

import lzma
from pathlib import Path

import pytest

from tools.rtlab import kernel
from tools.rtlab.errors import LabError

# printed by apt-cache of Debian 12, 2026-11-21
DEPENDS = "linux-image-rt-amd64\n  Depends: linux-image-6.1.0-56-rt-amd64\n"
POLICY = """linux-image-6.1.0-56-rt-amd64:
  Installed: (none)
  Candidate: 6.1.192-2
  Version table:
     6.1.192-2 500
"""
NAME = "linux-image-6.1.0-56-rt-amd64_6.1.192-2"


def unpacked(cache: Path, name: str = NAME) -> Path:
    """Create the result of `download`, with modules that depend on each other."""
    top = cache / name
    modules = top / "lib" / "modules" / "6.1.0-56-rt-amd64" / "kernel" / "drivers" / "net"
    modules.mkdir(parents=True)
    (modules / "veth.ko").write_bytes(b"x\0depends=under,over\0name=veth\0")
    (modules / "under.ko").write_bytes(b"x\0depends=\0")
    (modules / "over.ko.xz").write_bytes(lzma.compress(b"x\0depends=under\0"))
    (top / "boot").mkdir()
    (top / "boot" / "vmlinuz-6.1.0-56-rt-amd64").touch()
    (top / "unpacked").touch()
    return top


@pytest.fixture
def apt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Machine whose programs are scripts that a test writes to a folder."""
    programs = tmp_path / "programs"
    programs.mkdir()
    write(programs / "apt-cache", f"""[ $1 = depends ] && echo '{DEPENDS}' || echo '{POLICY}'""")
    write(programs / "apt-get", "echo 'W: unsandboxed' >&2; echo 'E: no network' >&2; exit 100")
    write(programs / "dpkg-deb", "exit 1")
    monkeypatch.setenv("PATH", str(programs))
    return programs


def write(program: Path, script: str) -> None:
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)


def test_the_newest_package_of_apt_is_used(apt: Path) -> None:
    assert kernel.wanted() == NAME


@pytest.mark.parametrize("shown", ["", "  Depends: linux-base\n"])
def test_an_unknown_package_has_a_hint(shown: str) -> None:
    with pytest.raises(LabError, match="apt-get update"):
        kernel.first_dependency(shown)


@pytest.mark.parametrize("shown", ["", "  Candidate: (none)\n"])
def test_a_package_without_a_version_has_a_hint(shown: str) -> None:
    with pytest.raises(LabError, match="apt-get update"):
        kernel.candidate(shown)


def test_a_failed_download_gives_the_reason_and_leaves_no_files(apt: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir()
    with pytest.raises(LabError) as caught:
        kernel.provide(cache)
    assert "E: no network" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert list(cache.iterdir()) == []


def test_without_apt_the_error_names_debian(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(LabError, match="apt is not installed here"):
        kernel.provide(tmp_path)


def test_an_older_kernel_is_used_without_the_newest(apt: Path, tmp_path: Path) -> None:
    unpacked(tmp_path, "linux-image-6.1.0-50-rt-amd64_6.1.170-1")
    assert kernel.provide(tmp_path).package == "linux-image-6.1.0-50-rt-amd64_6.1.170-1"


def test_existing_files_are_not_downloaded_again(apt: Path, tmp_path: Path) -> None:
    unpacked(tmp_path)
    found = kernel.provide(tmp_path)
    assert found.package == NAME
    assert found.image.name == "vmlinuz-6.1.0-56-rt-amd64"
    assert found.release == "6.1.0-56-rt-amd64"


def test_modules_follow_their_dependencies(tmp_path: Path) -> None:
    found = kernel.found_in(unpacked(tmp_path)).with_dependencies(("veth",))
    assert [path.name for path in found] == ["under.ko", "over.ko.xz", "veth.ko"]


def test_a_compressed_module_is_unpacked(tmp_path: Path) -> None:
    over = kernel.found_in(unpacked(tmp_path)).with_dependencies(("over",))[-1]
    assert kernel.read_module(over) == b"x\0depends=under\0"


def test_a_missing_module_is_named(tmp_path: Path) -> None:
    with pytest.raises(LabError, match=r"no module .*9p"):
        kernel.found_in(unpacked(tmp_path)).with_dependencies(("9p",))


def test_an_incomplete_kernel_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(LabError, match="delete it"):
        kernel.found_in(tmp_path)


def test_unneeded_modules_are_omitted(tmp_path: Path) -> None:
    top = unpacked(tmp_path)
    others = top / "lib" / "modules" / "6.1.0-56-rt-amd64" / "kernel"
    for name in ("fs/ext4", "drivers/gpu"):
        (others / name).mkdir(parents=True)
    kernel.drop_what_is_not_used(top)
    assert sorted(path.name for path in others.iterdir()) == ["drivers"]
    assert [path.name for path in (others / "drivers").iterdir()] == ["net"]


def test_without_a_network_the_newest_local_kernel_is_used() -> None:
    names = ["linux-image-6.1.0-9-rt-amd64_6.1.27-1", "linux-image-6.1.0-56-rt-amd64_6.1.192-2"]
    marks = [Path("cache", name, "unpacked") for name in names]
    assert sorted(reversed(marks), key=kernel.by_version) == marks
