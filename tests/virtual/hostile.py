"""Compilation of hostile_frames.c with the headers of the package, under sanitizers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parent.parent / "src" / "catenary"
FLAGS = "-O1 -g -std=gnu11 -Wall -Wno-unused-function -pthread"
SANITIZERS = "-fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"


def compile_frames(folder: Path) -> Path:
    """Return the program that sends random frames into a segment."""
    compiler = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    program = folder / "hostile_frames"
    headers = [f"-I{PACKAGE / name}" for name in ("native", "virtual")]
    source = HERE / "hostile_frames.c"
    command = [
        compiler,
        *FLAGS.split(),
        *SANITIZERS.split(),
        *headers,
        source,
        "-o",
        program,
        "-lm",
    ]
    subprocess.run(command, check=True)
    return program


def send_frames(
    program: Path, frames: int, seed: int, seconds: float
) -> subprocess.CompletedProcess[str]:
    """Run the program. Raises TimeoutExpired if the segment hangs."""
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    return subprocess.run(
        [program, str(frames), str(seed)],
        capture_output=True,
        text=True,
        timeout=seconds,
        env={**environment, "UBSAN_OPTIONS": "print_stacktrace=1"},
    )


def main(frames: int) -> int:
    """Send one long sequence and print its statistics, for tools/sanitize."""
    with tempfile.TemporaryDirectory() as folder:
        result = send_frames(compile_frames(Path(folder)), frames, os.getpid(), frames / 1000)
    print(result.stdout + result.stderr, end="")
    return result.returncode


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
