"""Desk of a loop: shared memory for the commands of clients and for their leases on axes.

The desk is sealed, anonymous memory, because clients write to it. They receive it over a socket
(desk_socket.py). Clients trust each other: they share a mutex, whose robust list contains pointers.
The loop does not trust them. It never locks the mutex, and checks the bounds of all that it reads.

The desk contains, in this order: the header, the mutex, the holders (for each axis the serial of
its lease; 0: none), the places (one for each client) and one ring for each place. Clients change
these parts while they hold the mutex. One atomic word (`_atomic_words.pyx`) publishes a lease to
the loop. The loop writes two words of a place: the number of commands that it has read, and the
lease that it has ended. When it closes, it sets `closed`.

The last part contains the motion words (native/motion.h). The core of the loop reads them in every
cycle: jogs, heartbeats, requested states and the stop word.
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
COMMANDS = 64  # maximum number of unread commands of a client
QUANTITIES = ("position", "velocity", "torque")  # bits 0 to 2 of the quantities of a command
EXTRAPOLATE = 1 << 3  # bit of the quantities: the positions continue with the velocities

PLACE = np.dtype(
    [
        # Atomic words. Both sides read them; the loop does so without the mutex.
        ("lease", "<u8"),  # serial; 0: the place is free. Publishes the client and its axes.
        ("ended", "<u8"),  # the lease that the loop has ended. Publishes the reason.
        ("taken", "<u8"),  # number of commands that the loop has read
        ("deadline_ns", "<u8"),  # CLOCK_MONOTONIC
        # The atomic words publish the other fields.
        ("last", "<u8"),  # the previous lease
        ("reason", "<u8"),  # why the previous lease ended
        ("start_time", "<u8"),  # of the client process
        ("pid", "<i8"),
        ("command", "S64"),
    ]
)

MOTION = np.dtype(  # cat_motion of native/motion.h
    [
        ("stop", "<u8"),
        ("stopper", "<u8"),
        ("of_clients", "<u8", (6,)),
        ("token", "<u8"),
        ("of_core", "<u8", (7,)),
    ]
)
SLOT = np.dtype(  # cat_motion_slot
    [
        ("press", "<u8"),
        ("begun", "<u8"),
        ("heartbeat", "<u8"),
        ("released", "<u8"),
        ("velocity", "<f8"),
        ("distance", "<f8"),
        ("acceleration", "<f8"),
        ("request", "<u8"),
        ("answer", "<u8"),
        ("taken", "<u8"),
        ("of_core", "<u8", (3,)),
        ("sweep_start", "<f8"),
        ("sweep_end", "<f8"),
        ("sweep_duration", "<f8"),
    ]
)

Values = npt.NDArray[np.float64]


class Reason(IntEnum):
    """Reason why a lease has ended."""

    RELEASED = 1
    EXPIRED = 2  # not renewed in time
    DIED = 3  # the client process has ended
    LOOP_ENDED = 4

    def __str__(self) -> str:
        return REASONS[self]


REASONS = {
    Reason.RELEASED: "released",
    Reason.EXPIRED: "not renewed in time",
    Reason.DIED: "the client process has died",
    Reason.LOOP_ENDED: "the loop has ended",
}


class Geometry(NamedTuple):
    """Offsets of the parts of a desk, and sizes [bytes]."""

    closed: int
    holders: int
    places: int
    rings: int
    ring_size: int
    motion: int
    size: int


def row_dtype(axes: int) -> np.dtype[np.void]:
    """Return the type of a command row. NaN marks an axis without a command."""
    return np.dtype(
        [("lease", "<u8"), ("quantities", "<u8"), *((q, "<f8", (axes,)) for q in QUANTITIES)]
    )


def geometry(axes: int) -> Geometry:
    """Return the offsets of the parts of a desk for this number of axes."""
    closed = memory_aligned(HEAD.size) + MUTEX_SIZE
    holders = memory_aligned(closed + 8)
    places = memory_aligned(holders + 8 * axes)
    rings = memory_aligned(places + PLACES * PLACE.itemsize)
    ring_size = memory_aligned(_rows.memory_size(COMMANDS, row_dtype(axes).itemsize))
    motion = rings + PLACES * ring_size
    size = motion + MOTION.itemsize + max(axes, 1) * SLOT.itemsize
    return Geometry(closed, holders, places, rings, ring_size, motion, size)


def memory_aligned(offset: int) -> int:
    return -(-offset // 64) * 64


class MotionWords:
    """View of the motion words of a desk (native/motion.h): global ones, and one of each axis."""

    def __init__(self, memory: mmap.mmap, offset: int, axes: int) -> None:
        slots = offset + MOTION.itemsize
        count = max(axes, 1)  # a loop without axes has an unused slot
        self.stop, self.stopper, self.token = (
            Words(memory, offset + field_offset(MOTION, name), 1)
            for name in ("stop", "stopper", "token")
        )
        self.press, self.begun, self.heartbeat, self.released, self.request = (
            Words(memory, slots + field_offset(SLOT, name), count, SLOT.itemsize)
            for name in ("press", "begun", "heartbeat", "released", "request")
        )
        self.answer, self.taken = (
            Words(memory, slots + field_offset(SLOT, name), count, SLOT.itemsize)
            for name in ("answer", "taken")
        )
        self.slots = np.frombuffer(memory, SLOT, axes, slots)  # for the real numbers


def field_offset(kind: np.dtype[np.void], name: str) -> int:
    """Return the offset of a field in a structured type [bytes]."""
    assert kind.fields is not None
    return kind.fields[name][1]


class Desk:
    """View of a loop's desk (the shared-memory command table).

    The loop and its clients use it.
    """

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
        self.motion = MotionWords(memory, where.motion, axes)
        self.motion_place = (memory, where.motion, axes)  # for the sink of the loop

    def client(self, place: int) -> Process:
        """Return the client that holds the place, or that held it last."""
        entry = self.places[place]
        return Process(
            int(entry["pid"]),
            int(entry["start_time"]),
            self._boot_id,
            bytes(entry["command"]).decode(errors="replace"),
        )

    def is_valid(self, place: int, serial: int) -> bool:
        """Return True if the place still has this lease and neither side has ended it."""
        return (
            self.leases.load(place) == serial
            and self.ended.load(place) != serial
            and not self._closed.load(0)
        )

    def reason(self, place: int, serial: int) -> Reason:
        """Return the reason why a lease of this place has ended.

        Return LOOP_ENDED after `end_all`, and EXPIRED if no reason was recorded.
        """
        if self._closed.load(0):
            return Reason.LOOP_ENDED
        is_recorded = serial in (self.ended.load(place), int(self.places[place]["last"]))
        reason = int(self.places[place]["reason"])
        return Reason(reason) if is_recorded and reason in tuple(Reason) else Reason.EXPIRED

    def end(self, place: int, serial: int, reason: Reason) -> None:
        """End a lease, so that it cannot be renewed. Called by the loop."""
        self.places[place]["reason"] = reason
        self.ended.store(place, serial)

    def end_all(self) -> None:
        """End all leases. Later leases are invalid, too. Called by the loop."""
        self._closed.store(0, 1)

    def ending(self, place: int, now_ns: int) -> Reason | None:
        """Return the reason why the lease of a place must end; None if it remains valid.

        The method reads /proc to check whether the client process is alive.
        """
        if self.deadlines_ns.load(place) <= now_ns:
            return Reason.EXPIRED if self.client(place).is_alive else Reason.DIED
        return None if self.client(place).is_alive else Reason.DIED

    def _words(self, places: int, name: str) -> Words:
        """Return one field of all places."""
        return Words(self._memory, places + field_offset(PLACE, name), PLACES, PLACE.itemsize)


def make_desk(layout: ShareLayout) -> tuple[Desk, int]:
    """Create a desk. Return it and the descriptor of its memory, which the caller owns."""
    axes = len(layout.axes)
    descriptor, memory = make_sealed(f"catenary-{layout.name}", geometry(axes).size)
    try:
        memory[: HEAD.size] = HEAD.pack(MAGIC, VERSION, axes, layout.run.encode())
        return Desk(memory, layout, fresh=True), descriptor
    except BaseException:
        os.close(descriptor)
        raise


def open_desk(layout: ShareLayout, path: Path, owner: int) -> Desk:
    """Open the desk of a running loop over its socket.

    Args:
        layout: layout of the share.
        path: path of the socket.
        owner: user id of the owner of the share.

    Raises:
        ShareError: the loop does not accept commands from this user or does not answer, or the
            desk is damaged or belongs to another loop.
    """
    try:
        descriptor = request_descriptor(path, owner)
    except FileNotFoundError as error:
        raise ShareError(f"the share {layout.name!r} does not accept commands") from error
    except PermissionError as error:
        raise ShareError(
            f"no permission to command the share {layout.name!r}: {path} belongs to another user",
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
