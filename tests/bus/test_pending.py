"""The handle of a procedure."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from catenary.bus.pending import Pending
from catenary.bus.procedure_run import Task


def nothing() -> Generator[None, None, int]:
    return 1
    yield


def test_a_cancelled_request_stays_cancelled() -> None:
    pending: Pending[int] = Pending(Task(nothing()))  # type: ignore[arg-type]
    pending.cancel()
    pending.finish()
    pending.cancel()
    assert pending.cancelled
    with pytest.raises(RuntimeError, match="was cancelled"):
        pending.result()


def test_a_finished_request_cannot_be_cancelled() -> None:
    pending: Pending[int] = Pending(Task(nothing()))  # type: ignore[arg-type]
    pending.finish()
    pending.cancel()
    assert not pending.cancelled
