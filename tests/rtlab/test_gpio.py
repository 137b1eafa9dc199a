"""Modules of the GPIO simulator for the guest. Without them, the table is skipped."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tools.rtlab import __main__ as lab
from tools.rtlab import gpio, igh, kernel, machine
from tools.rtlab.kernel import Kernel

RELEASE = "6.1.0-56-rt-amd64"
MODULE = "\0license=GPL\0depends=\0name=x\0vermagic={} SMP preempt_rt mod_unload modversions \0"


@pytest.fixture
def system(tmp_path: Path) -> Kernel:
    return Kernel(Path("vmlinuz"), tmp_path / "modules" / RELEASE, "linux-image")


def built(folder: Path, release: str = RELEASE) -> Path:
    for name in gpio.MODULES:
        (folder / f"{name}.ko").write_bytes(MODULE.format(release).encode())
    return folder


def test_modules_program_and_gpiod_of_the_guest(tmp_path: Path, system: Kernel) -> None:
    pytest.importorskip("gpiod")
    paths = [entry.path for entry in gpio.provide(built(tmp_path), system)]
    assert paths[:3] == ["/gpio/configfs.ko", "/gpio/gpio-sim.ko", "/gpio/gpio_table.py"]
    assert any("/gpiod/_ext" in path for path in paths)


@pytest.mark.parametrize("missing", gpio.MODULES)
def test_a_missing_module_is_named(tmp_path: Path, system: Kernel, missing: str) -> None:
    (built(tmp_path) / f"{missing}.ko").unlink()
    with pytest.raises(igh.NotThere, match=f"no {missing}.ko"):
        gpio.provide(tmp_path, system)


def test_modules_of_another_kernel_are_refused(tmp_path: Path, system: Kernel) -> None:
    with pytest.raises(igh.NotThere, match=r"6\.1\.0-50-rt-amd64"):
        gpio.provide(built(tmp_path, "6.1.0-50-rt-amd64"), system)


def test_without_modules_the_table_is_skipped(
    tmp_path: Path, system: Kernel, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(machine, "program", lambda: "qemu")
    monkeypatch.setattr(kernel, "provide", lambda _: system)
    assert lab.main(["gpio", "--out", str(tmp_path)]) == 0
    assert "gpio: skipped: the kernel has no gpio-sim" in capsys.readouterr().out


def test_the_makefile_passes_the_folder() -> None:
    done = subprocess.run(
        ["make", "-n", "rtlab", "TABLE=gpio", "GPIO=/opt/gpio"],
        cwd=lab.REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "tools.rtlab gpio --gpio /opt/gpio" in done.stdout
