"""Compiles the C peers on the spot, from the package's own data, with the machine's compiler.

For a machine without one, `compile_all` makes them elsewhere: the folder they lie in goes into the
variable CATENARY_BENCH_PROGRAMS."""

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
    """A C peer cannot be compiled here."""


def has_programs() -> bool:
    """Whether `compile_peer` can do something here."""
    return VARIABLE in os.environ or shutil.which("cc") is not None


def compile_all(folder: Path) -> list[Path]:
    """Programs of all C peers, in `folder`, for a machine that has no compiler."""
    return [compile_peer(name, folder) for name in PROGRAMS]


def compile_peer(name: str, folder: Path) -> Path:
    """The program of the C peer `name`, in `folder` or brought along; compiled once."""
    program = Path(os.environ.get(VARIABLE, folder), name)
    if not program.exists():
        sources = [str(SOURCES / source) for source in PROGRAMS[name]]
        _compile(name, [*FLAGS, "-pthread", "-o", str(program), *sources, "-lm"])
    return program


def compile_library(name: str, folder: Path) -> Path:
    """The C peer `name`.c as a library that this process can load."""
    library = folder / f"{name}.so"
    _compile(name, [*FLAGS, "-shared", "-fPIC", "-o", str(library), str(SOURCES / f"{name}.c")])
    return library


def _compile(name: str, arguments: list[str]) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        raise CompilerError(
            f"the peer {name} needs a C compiler, and there is no `cc`",
            hint="sudo apt install gcc libc6-dev, or leave it out: --peers pysoem",
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
