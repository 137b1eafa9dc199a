"""A machine that stops for longer than the devices' watchdog ends a round: then once more."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TypeVar

from catenary.bench.rounds import RoundError

T = TypeVar("T")
ATTEMPTS = 10


def patiently(run: Callable[[], T]) -> T:
    for _ in range(ATTEMPTS - 1):
        with contextlib.suppress(RoundError):
            return run()
    return run()
