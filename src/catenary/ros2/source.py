"""Attachment to a share that may be missing, end and return, for example on a program restart."""

from __future__ import annotations

import re
import time
from typing import Any

import numpy as np

from catenary.errors import ShareError
from catenary.share import Reader, attach

RETRY = 0.5  # [s] between two attempts to attach
STALLED = 1.0  # [s] without a cycle
ELEMENT = re.compile(r"(.+)\[(\d+)\]")


class Source:
    """Owner of the attachment to a share. It attaches again after the loop has ended.

    Args:
        name: name of the share.
        uid: owner of the share (`cat.attach`).
    """

    def __init__(self, name: str, uid: int | None = None) -> None:
        self.name = name
        self.reason = "not attached yet"  # why there are no cycles; "" while they come
        self.uid = uid
        self._reader: Reader | None = None
        self._retry_at = 0.0
        self._number = 0
        self._news_at = 0.0

    @property
    def reader(self) -> Reader | None:
        """Reader of the present loop; None while there is none."""
        return self._reader

    @property
    def run(self) -> str:
        """Identifier of the present run of the loop; "" while there is none."""
        return self._reader.layout.run if self._reader is not None else ""

    def row(self) -> np.void | None:
        """Return the newest cycle if it is new; None otherwise. Attach if needed."""
        now = time.monotonic()
        if self._reader is None:
            self._attach(now)
        reader = self._reader
        if reader is None:
            return None
        if reader.number != self._number:
            self._number, self._news_at, self.reason = reader.number, now, ""
            return reader.read()
        if now >= self._news_at + STALLED:
            self._check_writer(reader)
        return None

    def close(self) -> None:
        """Detach from the share."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def _attach(self, now: float) -> None:
        if now < self._retry_at:
            return
        self._retry_at = now + RETRY
        try:
            self._reader = attach(self.name, uid=self.uid)
        except ShareError as error:
            self.reason = error.message
            return
        self._number, self._news_at, self.reason = 0, now, "no cycle yet"

    def _check_writer(self, reader: Reader) -> None:
        """Detach from a loop that has ended or died; report one that stalls."""
        state = reader.state
        if state == "running":
            self.reason = f"no cycle for {STALLED:g} s"
            return
        self.reason = "the loop has ended" if state == "ended" else "the program has died"
        self.close()


def stamp_ns(reader: Reader, row: np.void) -> int:
    """Return the time of a cycle for messages [ns]: UTC, or the virtual time.

    Args:
        reader: reader of the share.
        row: a cycle of the share.
    """
    layout = reader.layout
    offset = layout.utc_offset_ns if layout.clock == "monotonic" else 0
    return int(row["scheduled_ns"]) + offset


def value_of(row: np.void, field: str) -> Any:
    """Return the value of a field: a NumPy scalar or array.

    Args:
        row: a cycle of a share.
        field: name of a field, such as "pressure", or an element, such as "input_bytes[3]".

    Raises:
        ValueError: The share has no such field or element.
    """
    names = row.dtype.names or ()
    if field in names:
        return row[field]
    element = ELEMENT.fullmatch(field)
    if element is None or element[1] not in names:
        raise ValueError(f"there is no field {field!r}; the fields are {', '.join(names)}")
    values = np.atleast_1d(row[element[1]])
    if int(element[2]) >= len(values):
        raise ValueError(f"{element[1]!r} has {len(values)} elements; {field!r} does not exist")
    return values[int(element[2])]
