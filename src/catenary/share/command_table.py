"""The desk: memory for the commands of clients to a loop, and for their leases on axes.

It is sealed memory without a name, because clients write in it. They get it over a socket
(desk_socket.py). Clients trust each other: they share a mutex, whose robust list holds pointers.
The loop does not trust them. It never takes the mutex, and bounds whatever it reads.

The head is followed by the mutex, the holders (for each axis the serial of its lease; 0: none), the
places (one for each client) and the ring of each place. Clients change these under the mutex. The
loop sees a lease by the word that publishes it (`_words.pyx`). It writes two words of a place: the
number of commands that it has read, and the lease that it has ended. At its end it sets `closed`.
"""

from __future__ import annotations

import mmap
import os
import struct
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from catenary.errors import ShareError
from catenary.share import _rows
from catenary.share._atomic_words import Words
from catenary.share._mutex import MUTEX_SIZE, SharedMutex
from catenary.share._rows import Ring
from catenary.share.desk_socket import request_descriptor
from catenary.share.layout import VERSION, ShareLayout
from catenary.share.memory import make_sealed, map_sealed
from catenary.share.process import Process

MAGIC = b"CATADESK"
HEAD = struct.Struct("<8sII32s")
PLACES = 16
COMMANDS = 64  # of a client that the loop has not read
QUANTITIES = ("position", "velocity", "torque")

PLACE = np.dtype(
    [
        # Atomic words: both sides read them, the loop without the mutex.
        ("lease", "<u8"),  # serial; 0: the place is free. Publishes the client and its axes.
        ("ended", "<u8"),  # the lease that the loop has ended. Publishes the reason.
        ("taken", "<u8"),  # commands that the loop has read
        ("deadline_ns", "<u8"),  # CLOCK_MONOTONIC
        # The rest is published by them.
        ("last", "<u8"),  # the previous lease; `reason`: why it ended
        ("reason", "<u8"),
        ("start_time", "<u8"),  # the client
        ("pid", "<i8"),
        ("command", "S64"),
    ]
)

Values = npt.NDArray[np.float64]


class Reason(IntEnum):
    """The reason for which a lease has ended."""

    RELEASED = 1
    EXPIRED = 2  # not renewed in time
    DIED = 3  # its process has ended
    LOOP_ENDED = 4

    def __str__(self) -> str:
        return REASONS[self]


REASONS = {
    Reason.RELEASED: "released",
    Reason.EXPIRED: "not renewed in time",
    Reason.DIED: "its process died",
    Reason.LOOP_ENDED: "the loop has ended",
}


class Geometry(NamedTuple):
    """Offsets of the parts of the memory."""

    closed: int
    holders: int
    places: int
    rings: int
    ring_size: int
    size: int


def row_dtype(axes: int) -> np.dtype[np.void]:
    """Return the type of a command's row; NaN marks an axis without a command."""
    return np.dtype(
        [("lease", "<u8"), ("quantities", "<u8"), *((q, "<f8", (axes,)) for q in QUANTITIES)]
    )


def geometry(axes: int) -> Geometry:
    closed = memory_aligned(HEAD.size) + MUTEX_SIZE
    holders = memory_aligned(closed + 8)
    places = memory_aligned(holders + 8 * axes)
    rings = memory_aligned(places + PLACES * PLACE.itemsize)
    ring_size = memory_aligned(_rows.memory_size(COMMANDS, row_dtype(axes).itemsize))
    return Geometry(closed, holders, places, rings, ring_size, rings + PLACES * ring_size)


def memory_aligned(offset: int) -> int:
    return -(-offset // 64) * 64


class Desk:
    """One process's view of the desk of a loop."""

    def __init__(self, memory: mmap.mmap, layout: ShareLayout, *, fresh: bool = False) -> None:
        axes = len(layout.axes)
        where = geometry(axes)
        self._memory = memory
        self._boot_id = layout.writer.boot_id
        self.row = row_dtype(axes)
        self.mutex = SharedMutex(memory, memory_aligned(HEAD.size), fresh=fresh)
        self.holders = np.frombuffer(memory, "<u8", axes, where.holders)
        self.places = np.frombuffer(memory, PLACE, PLACES, where.places)
        self.leases, self.ended, self.taken, self.deadlines_ns = (
            self._words(where.places, name) for name in ("lease", "ended", "taken", "deadline_ns")
        )
        self._closed = Words(memory, where.closed, 1)
        self.rings = [
            Ring(
                memory,
                where.rings + k * where.ring_size,
                COMMANDS,
                self.row.itemsize,
                writable=True,
            )
            for k in range(PLACES)
        ]

    def client(self, place: int) -> Process:
        """Return the client that has the place, or that had it last."""
        entry = self.places[place]
        return Process(
            int(entry["pid"]),
            int(entry["start_time"]),
            self._boot_id,
            bytes(entry["command"]).decode(errors="replace"),
        )

    def is_valid(self, place: int, serial: int) -> bool:
        """Return True if the lease is valid and neither side has ended it."""
        return (
            self.leases.load(place) == serial
            and self.ended.load(place) != serial
            and not self._closed.load(0)
        )

    def reason(self, place: int, serial: int) -> Reason:
        """Return why a lease of the place has ended."""
        if self._closed.load(0):
            return Reason.LOOP_ENDED
        is_recorded = serial in (self.ended.load(place), int(self.places[place]["last"]))
        reason = int(self.places[place]["reason"])
        return Reason(reason) if is_recorded and reason in tuple(Reason) else Reason.EXPIRED

    def end(self, place: int, serial: int, reason: Reason) -> None:
        """End a lease; called by the loop. The lease cannot be renewed afterwards."""
        self.places[place]["reason"] = reason
        self.ended.store(place, serial)

    def end_all(self) -> None:
        """End all leases; called by the loop. No lease can be renewed or taken afterwards."""
        self._closed.store(0, 1)

    def ending(self, place: int, now_ns: int) -> Reason | None:
        """Return why the lease of a place is over; None if it is not.

        Ask the kernel whether the client's process is alive.
        """
        if self.deadlines_ns.load(place) <= now_ns:
            return Reason.EXPIRED if self.client(place).is_alive else Reason.DIED
        return None if self.client(place).is_alive else Reason.DIED

    def _words(self, places: int, name: str) -> Words:
        """Return one field of every place."""
        assert PLACE.fields is not None
        return Words(self._memory, places + PLACE.fields[name][1], PLACES, PLACE.itemsize)


def make_desk(layout: ShareLayout) -> tuple[Desk, int]:
    """Make a desk that no client has yet. Returns it and the descriptor of its memory."""
    axes = len(layout.axes)
    descriptor, memory = make_sealed(f"catenary-{layout.name}", geometry(axes).size)
    try:
        memory[: HEAD.size] = HEAD.pack(MAGIC, VERSION, axes, layout.run.encode())
        return Desk(memory, layout, fresh=True), descriptor
    except BaseException:
        os.close(descriptor)
        raise


def open_desk(layout: ShareLayout, path: Path, owner: int) -> Desk:
    """Open the desk of a running loop, over its socket. Raises ShareError if that fails."""
    try:
        descriptor = request_descriptor(path, owner)
    except FileNotFoundError as error:
        raise ShareError(f"the share {layout.name!r} takes no commands") from error
    except PermissionError as error:
        raise ShareError(
            f"the share {layout.name!r} may not be commanded: {path} belongs to another user",
            hint="its writer can allow it: cat.Share(..., mode=0o660) for the group",
        ) from error
    memory = map_sealed(descriptor, geometry(len(layout.axes)).size)
    magic, version, axes, run = HEAD.unpack(memory[: HEAD.size])
    if (magic, version, axes, run) != (MAGIC, VERSION, len(layout.axes), layout.run.encode()):
        raise ShareError(
            f"the share {layout.name!r} now belongs to another loop", hint="attach again"
        )
    try:
        return Desk(memory, layout)
    except ValueError as error:
        raise ShareError(f"the desk of the share {layout.name!r} is damaged: {error}") from error
