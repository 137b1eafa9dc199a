"""Diagnosis messages of a device of a running program, by requests to this program."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from catenary.errors import LoopError, SdoAbort
from catenary.model.diagnosis_history import HistoryMessage, SyncCounters, described
from catenary.procedure.diagnosis_history import read_history, read_sync_counters
from catenary.procedure.exchange import Procedure
from catenary.procedure.sdo import OBJECT_MISSING

if TYPE_CHECKING:
    from catenary.remote import Client

T = TypeVar("T")


def read_device(
    program: Client, position: int
) -> tuple[Sequence[HistoryMessage] | None, Sequence[SyncCounters]]:
    """Return messages and counters of a device.

    The messages are None if the device has no diagnosis history. Texts of ESI files are missing.

    Args:
        program: The program.
        position: Position of the device.
    """
    upload = partial(_upload, program, position)
    counters = result_of(read_sync_counters(upload))
    try:
        found = result_of(read_history(upload))
    except SdoAbort as error:
        if error.code in OBJECT_MISSING:
            return None, counters
        raise
    return [described(each, {}, found.now_ns) for each in found.messages], counters


def result_of(procedure: Procedure[T]) -> T:
    """Return the result of a procedure that sends nothing."""
    try:
        next(procedure)
    except StopIteration as end:
        result: T = end.value
        return result
    raise LoopError("a procedure without requests has made a request")


def _upload(program: Client, position: int, index: int, subindex: int) -> Procedure[bytes]:
    """Read an entry with a request to the program."""
    return program.sdo_read(position, index, subindex, type="BYTES").data
    yield []
