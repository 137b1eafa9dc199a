"""Compilation of the C peers with the compiler of the machine.

For a machine without a compiler, run `compile_all` on another one, and set the environment variable
CATENARY_BENCH_PROGRAMS to the folder of the programs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from catenary.errors import CatenaryError

SOURCES = Path(__file__).parent / "peers"
PROGRAMS = {
    "c": ("peer.c", "receive_recv.c"),
    "c-ring": ("peer.c", "receive_ring.c"),
    "c-busy": ("peer.c", "receive_recv.c"),
    "three_tasks": ("three_tasks.c",),
    "reaction": ("reaction.c",),
}
FLAGS = ("-O2", "-std=gnu11")
VARIABLE = "CATENARY_BENCH_PROGRAMS"


class CompilerError(CatenaryError):
    """Error if a C peer cannot be compiled."""


def has_programs() -> bool:
    """Return True if there is a compiler, or a folder of compiled programs."""
    return VARIABLE in os.environ or shutil.which("cc") is not None


def compile_all(folder: Path) -> list[Path]:
    """Compile all C peers into `folder`, for a machine without a compiler."""
    return [compile_peer(name, folder) for name in PROGRAMS]


def compile_peer(name: str, folder: Path) -> Path:
    """Return the program of a C peer. Compile it into `folder` if it does not exist."""
    program = Path(os.environ.get(VARIABLE, folder), name)
    if not program.exists():
        sources = [str(SOURCES / source) for source in PROGRAMS[name]]
        _compile(name, [*FLAGS, "-pthread", "-o", str(program), *sources, "-lm"])
    return program


def compile_library(name: str, folder: Path) -> Path:
    """Compile `name`.c as a shared library, and return its path."""
    library = folder / f"{name}.so"
    _compile(name, [*FLAGS, "-shared", "-fPIC", "-o", str(library), str(SOURCES / f"{name}.c")])
    return library


def _compile(name: str, arguments: list[str]) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        raise CompilerError(
            f"the peer {name} needs a C compiler, and `cc` was not found",
            hint="sudo apt install gcc libc6-dev, or omit the peer: --peers pysoem",
        )
    done = subprocess.run(
        [compiler, *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        first = next(iter(done.stderr.splitlines()), f"{compiler} failed")
        raise CompilerError(f"the peer {name} does not compile: {first}")
