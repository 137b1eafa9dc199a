"""Numba unpickles its cache: a user who writes a file there runs code as the user of the law.

The folder of the source belongs to another user, or $NUMBA_CACHE_DIR names one that does.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

LAW = """
import sys
import catenary as cat

@cat.law
def follow(actual, target, memory, time):
    memory[0] = 7.0
    return True

if __name__ == "__main__":
    with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm) as loop:
            print(loop.run(follow, memory=[0.0])[0])
"""
NUMBAS_OWN = """
import runpy, sys
import numba
space = runpy.run_path(sys.argv[1])
cache = numba.core.caching.FunctionCache(space["follow"].function)
print(cache._cache_file._index_path)
if sys.argv[2] == "load":
    try:
        cache._cache_file.load("key")
    except Exception:
        pass
"""


class Evil:
    """A pickle that makes a file when it is read."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return os.mkdir, (str(self.marker),)


def run(program: list[str], environment: dict[str, str]) -> str:
    done = subprocess.run(
        [sys.executable, *program],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        check=True,
        timeout=120,
    )
    return done.stdout.strip()


@pytest.mark.parametrize("place", ["beside the source", "NUMBA_CACHE_DIR"])
def test_a_planted_cache_is_not_read(tmp_path: Path, place: str) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    law, marker = tmp_path / "follow.py", tmp_path / "owned"
    law.write_text(LAW)
    environment = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    if place == "NUMBA_CACHE_DIR":
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / "theirs")
    index = Path(run(["-c", NUMBAS_OWN, str(law), "where"], environment))
    index.write_bytes(pickle.dumps(Evil(marker)))
    run(["-c", NUMBAS_OWN, str(law), "load"], environment)
    assert marker.exists()  # Numba's own cache reads it
    marker.rmdir()
    assert run([str(law)], environment) == "7.0"
    assert not marker.exists()
    cached = list((tmp_path / "cache" / "catenary" / "laws").glob("*.nbi"))
    # In a user namespace, the folders of root belong to another user: the law is not cached.
    assert bool(cached) == (Path("/").stat().st_uid == 0)
