"""Names of shares that no other test has, and nothing left behind."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def own_name(what: str) -> Iterator[str]:
    name = f"test-{os.getpid()}-{what}-{os.urandom(3).hex()}"
    try:
        yield name
    finally:
        for path in Path("/dev/shm").glob(f"catenary*-{name}*"):
            path.unlink()
