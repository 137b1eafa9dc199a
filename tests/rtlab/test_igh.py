"""A build of the IgH master for the guest. Without a valid build, its table is skipped."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tools.rtlab import __main__ as lab
from tools.rtlab import igh, image, kernel, machine
from tools.rtlab.kernel import Kernel

RELEASE = "6.1.0-56-rt-amd64"
# format of the .modinfo section of a module
MODULE = "\0license=GPL\0depends=\0name=ec\0vermagic={} SMP preempt_rt mod_unload modversions \0"


@pytest.fixture
def system(tmp_path: Path) -> Kernel:
    return Kernel(Path("vmlinuz"), tmp_path / "modules" / RELEASE, "linux-image")


def built(folder: Path, release: str = RELEASE) -> Path:
    """Create the result of a build in the source tree."""
    for name in ("master/ec_master.ko", "devices/ec_generic.ko", "lib/.libs/libethercat.so.1"):
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(MODULE.format(release).encode())
    return folder


def test_modules_library_and_program_of_the_guest(tmp_path: Path, system: Kernel) -> None:
    entries = igh.provide(built(tmp_path), system)
    assert [Path(entry.path).name for entry in entries] == [
        *("ec_master.ko", "ec_generic.ko", "libethercat.so.1", "igh_table.py")
    ]
    assert {str(Path(entry.path).parent) for entry in entries} == {igh.FOLDER}


@pytest.mark.parametrize(
    ("missing", "message"),
    [
        ("master/ec_master.ko", "no ec_master.ko"),
        ("devices/ec_generic.ko", "no ec_generic.ko"),
        ("lib/.libs/libethercat.so.1", "no libethercat.so.1"),
    ],
)
def test_a_missing_part_is_named(
    tmp_path: Path, system: Kernel, missing: str, message: str
) -> None:
    (built(tmp_path) / missing).unlink()
    with pytest.raises(igh.NotThere, match=message):
        igh.provide(tmp_path, system)


def test_a_module_of_another_kernel_is_refused(tmp_path: Path, system: Kernel) -> None:
    with pytest.raises(igh.NotThere, match=r"6\.1\.0-50-rt-amd64.*linux-headers-6\.1\.0-56"):
        igh.provide(built(tmp_path, "6.1.0-50-rt-amd64"), system)


def test_without_a_build_the_table_is_skipped(
    tmp_path: Path, system: Kernel, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("nothing is to be made")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(machine, "program", lambda: "qemu")
    monkeypatch.setattr(kernel, "provide", lambda _: system)
    monkeypatch.setattr(image, "provide", refuse)
    assert lab.main(["igh", "--out", str(tmp_path)]) == 0
    assert "igh: skipped: IGH=path is not a build" in capsys.readouterr().out


def test_the_makefile_passes_the_folder() -> None:
    done = subprocess.run(
        ["make", "-n", "rtlab", "TABLE=igh", "IGH=/opt/igh"],
        cwd=lab.REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "tools.rtlab igh --igh /opt/igh" in done.stdout
