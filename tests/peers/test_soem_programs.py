"""SOEM's firm_update and PySOEM's example, unmodified, update the firmware of a virtual device.

The sources are those of PySOEM's source distribution, in pytest's cache. pip downloads it if there
is a network; `make test` has none, so the reason for skipping names the command to run before.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
from importlib.metadata import version
from pathlib import Path

import pytest

import catenary as cat
from catenary.types import VISIBLE_STRING
from catenary.virtual import make_firmware
from tests.peers.conftest import serving

pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

TERMINAL = 1
IMAGE = make_firmware(0x0004_0002, "2.0", size=20_000)
# firm_update writes the SyncManagers without disabling them: they must keep their addresses.
LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "analog_inputs"

[device.files]
firmware = { name = "NAME", version = "1.0" }
"""
# PySOEM adds two members to the context, which the initialiser for EC_VER1 lacks.
INITIALISER = ("&EcatError, ", "&EcatError, 0, 0, ")
DOWNLOAD_SECONDS, BUILD_SECONDS, RUN_SECONDS = 120, 120, 60


@pytest.fixture(scope="module")
def source(pytestconfig: pytest.Config) -> Path:
    """Return the folder of PySOEM's source distribution."""
    name = f"pysoem-{version('pysoem')}"
    folder = Path(pytestconfig.cache.mkdir("soem"))
    archive = folder / f"{name}.tar.gz"
    if not archive.exists():
        what = ["--no-deps", "--no-binary", "pysoem", f"pysoem=={version('pysoem')}"]
        command = [
            sys.executable,
            "-m",
            "pip",
            "download",
            "--retries",
            "0",
            "-d",
            str(folder),
            *what,
        ]
        run_or_skip(command, folder, DOWNLOAD_SECONDS, f"no sources; run: {' '.join(command)}")
    if not (folder / name).is_dir():
        with tarfile.open(archive) as files:
            files.extractall(folder, filter="data")
    return folder / name


@pytest.fixture(scope="module")
def firm_update(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the compiled program."""
    folder = tmp_path_factory.mktemp("soem")
    shutil.copytree(source / "soem", folder / "soem")
    root = folder / "soem"
    main = root / "soem" / "ethercatmain.c"
    main.write_text(main.read_text().replace(INITIALISER[0], INITIALISER[1]))
    parts = [
        *(root / "soem").glob("*.c"),
        *(root / "osal" / "linux").glob("*.c"),
        *(root / "oshw" / "linux").glob("*.c"),
        root / "test" / "linux" / "firm_update" / "firm_update.c",
    ]
    places = ("soem", "osal", "osal/linux", "oshw/linux")
    command = ["gcc", "-w", "-O1", "-o", "firm_update", *(f"-I{root / each}" for each in places)]
    command += [*map(str, parts), "-lpthread", "-lrt"]
    run_or_skip(command, folder, BUILD_SECONDS, "firm_update cannot be compiled")
    return folder / "firm_update"


def run_or_skip(command: list[str], folder: Path, seconds: float, why: str) -> None:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=seconds)
    except (OSError, subprocess.TimeoutExpired) as error:
        pytest.skip(f"{why}: {error}")
    if done.returncode:
        pytest.skip(f"{why}: {' '.join(done.stderr.split())[-300:]}")


def updated(command: list[str], veth: tuple[str, str], folder: Path, name: str) -> str:
    """Run a program that updates the firmware. Return the version that the device then reports."""
    ours, theirs = veth
    (folder / "app.efw").write_bytes(IMAGE)
    line = folder / "line.toml"
    line.write_text(LINE.replace("NAME", name))
    with serving(theirs, line):
        arguments = [ours if part == "NIC" else part for part in command]
        done = subprocess.run(
            arguments, cwd=folder, capture_output=True, text=True, timeout=RUN_SECONDS
        )
        assert done.returncode == 0, done.stdout + done.stderr
        with cat.MainDevice(ours) as main:
            return main.scan()[TERMINAL].sdo.read(0x100A, type=VISIBLE_STRING)


def test_firm_update(firm_update: Path, veth: tuple[str, str], tmp_path: Path) -> None:
    command = [str(firm_update), "NIC", str(TERMINAL + 1), "app.efw"]
    assert updated(command, veth, tmp_path, "app.efw") == "2.0"


def test_the_example_of_pysoem(source: Path, veth: tuple[str, str], tmp_path: Path) -> None:
    example = source / "examples" / "firmware_update.py"  # it removes the suffix of the file name
    command = [sys.executable, str(example), "NIC", str(TERMINAL + 1), "app.efw"]
    assert updated(command, veth, tmp_path, "app") == "2.0"
