"""SOEM's SoE (ethercatsoe.c) reads, writes, maps and moves a virtual SERCOS drive.

The sources are those of PySOEM's source distribution, as in test_soem_programs.py.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from tests.peers.conftest import serving
from tests.peers.test_soem_programs import (
    BUILD_SECONDS,
    INITIALISER,
    RUN_SECONDS,
    run_or_skip,
)
from tests.peers.test_soem_programs import source as source

PROGRAM = Path(__file__).with_name("soe_program.c")
LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "sercos_drive"
"""


def compiled(source: Path, program: Path, folder: Path) -> Path:
    """Return a program that is linked with SOEM."""
    shutil.copytree(source / "soem", folder / "soem")
    root = folder / "soem"
    main = root / "soem" / "ethercatmain.c"
    main.write_text(main.read_text().replace(INITIALISER[0], INITIALISER[1]))
    parts = [
        *(root / "soem").glob("*.c"),
        *(root / "osal" / "linux").glob("*.c"),
        *(root / "oshw" / "linux").glob("*.c"),
        program if program.is_absolute() else root / program,
    ]
    places = ("soem", "osal", "osal/linux", "oshw/linux")
    command = ["gcc", "-w", "-O1", "-o", "program", *(f"-I{root / each}" for each in places)]
    command += [*map(str, parts), "-lpthread", "-lrt"]
    run_or_skip(command, folder, BUILD_SECONDS, f"{program.name} cannot be compiled")
    return folder / "program"


def output(program: Path, veth: tuple[str, str], folder: Path, *arguments: str) -> list[str]:
    """Run a program with a served drive, and return the lines of its output."""
    ours, theirs = veth
    line = folder / "line.toml"
    line.write_text(LINE)
    with serving(theirs, line):
        done = subprocess.run(
            [str(program), ours, *arguments], capture_output=True, text=True, timeout=RUN_SECONDS
        )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


def test_idns_and_telegrams(source: Path, veth: tuple[str, str], tmp_path: Path) -> None:
    lines = output(compiled(source, PROGRAM, tmp_path), veth, tmp_path)
    assert lines == [
        "read 79: wkc 1, 4 bytes, 1048576",
        "read 2: wkc 1, 2 bytes, 1000",
        "write 2: wkc 1",
        "read 2: wkc 1, 2 bytes, 2000",
        "write list: wkc 1",
        "read list: wkc 1, 4004 bytes, 4000 equal",
        "read 4000: wkc 0, 4 bytes, 0",
        "error: idn 4000 code 0x1001",
        "sizes: 48 bits out, 48 bits in",
        "state 8",
        "status 3, moved yes",
    ]


def test_slaveinfo(source: Path, veth: tuple[str, str], tmp_path: Path) -> None:
    """SOEM's program, unmodified, shows the sizes that S-0-0016 and S-0-0024 specify."""
    example = Path("test/linux/slaveinfo/slaveinfo.c")
    lines = output(compiled(source, example, tmp_path), veth, tmp_path)
    text = [each.strip() for each in lines]
    assert {"Output size: 48bits", "Input size: 48bits"} <= set(text)
    assert any("SoE details: 01" in each for each in lines)
