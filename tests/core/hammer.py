"""Compiles hammer.c on the package's own headers: no Python, and no GIL, in the two threads."""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
HEADERS = HERE.parent.parent / "src" / "catenary" / "native"


@functools.cache
def load_hammer() -> ctypes.CDLL:
    hammer = compiled(HERE / "hammer.c")
    hammer.hammer_ring.restype = ctypes.c_uint64
    hammer.hammer_pointer.restype = ctypes.c_uint64
    hammer.hammer_trigger.restype = ctypes.c_uint64
    return hammer


def compiled(source: Path) -> ctypes.CDLL:
    """A C file of the tests as a library."""
    compiler = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "hammer.so"
        flags = ["-O2", "-shared", "-fPIC", "-pthread", f"-I{HEADERS}", "-Wall", "-Werror"]
        subprocess.run([compiler, *flags, str(source), "-o", str(library)], check=True)
        return ctypes.CDLL(str(library))
