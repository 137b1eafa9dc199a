"""Reading along: what another process' loop does, cycle by cycle."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Literal

import numpy as np
import numpy.typing as npt

from catenary.errors import ShareError
from catenary.share import folder, memory
from catenary.share._rows import Ring
from catenary.share.command_table import Desk, open_desk
from catenary.share.events import SharedEvent, decode_event
from catenary.share.layout import ShareLayout, decode_head
from catenary.share.lease import Lease, lease_of
from catenary.share.memory import Segment

LOOK_NS = 250_000_000  # between two looks whether the writer still lives
FOR_EVER = 1 << 62
CYCLES, EVENTS = 0, 1
END = object()

Rows = npt.NDArray[np.void]
State = Literal["running", "ended", "dead"]


def attach(
    name: str, *, stale: bool = False, uid: int | None = None, patience: Iterable[object] = ()
) -> Reader:
    """Map the cycles that another process shares as `name`, for reading; leave it by `with`.

    Args:
        name: of the share.
        stale: accept one whose writer has died, to see its last cycles.
        uid: the user whose share it is. None: this user or root; others are refused, because the
            owner of a share can crash its readers.
        patience: try again after each item, a task's jobs for one (`attach(name, patience=task)`).

    Raises:
        ShareError: there is none, it may not be read, it belongs to another user, its writer is
            dead, or it has the layout of another version.
    """
    waiting = iter(patience)
    while True:
        try:
            return _attached(name, stale, uid)
        except ShareError:
            if next(waiting, END) is END:
                raise


def _attached(name: str, stale: bool, uid: int | None) -> Reader:
    file = folder.file_name(folder.STATE, name)
    try:
        segment = memory.open_segment(folder.find(file, uid), folder.trusted_owners(uid))
        layout = decode_head(segment.memory, segment.size)
    except FileNotFoundError as error:
        others = ", ".join(map(repr, folder.names(uid))) or "none"
        raise ShareError(
            f"there is no share {name!r}; there are: {others}",
            hint="it is there while a Loop with sink=cat.Share(...) is open; name the user of "
            "another user's share: uid= (--uid)",
        ) from error
    except PermissionError as error:
        raise ShareError(
            f"the share {name!r} may not be read: {error.filename} belongs to another user",
            hint="its writer can allow it: cat.Share(..., mode=0o640) for the group",
        ) from error
    except ShareError as error:
        raise ShareError(f"the share {name!r}: {error.message}", hint=error.hint) from error
    try:
        reader = Reader(segment, layout)
    except (ValueError, OverflowError) as error:
        raise ShareError(f"the share {name!r}: its description is broken: {error}") from error
    if reader.state == "dead" and not stale:
        raise ShareError(
            f"the share {name!r} is stale: {layout.writer} has died",
            hint=f"its last cycles are still there: cat.attach({name!r}, stale=True); a new "
            "writer replaces it",
        )
    return reader


class Reader:
    """Owns one process' sight of a share; `catenary.attach` makes it.

        with cat.attach("arm") as arm:
            while arm.wait(timeout=1.0):
                now = arm.read()
                print(now["number"], now["position"])

    The memory is mapped for reading only: nothing here can delay or change the loop.
    """

    def __init__(self, segment: Segment, layout: ShareLayout) -> None:
        self.layout = layout
        self.dtype = layout.dtype
        rows, events = layout.rows, layout.events
        self._rings: tuple[Ring, Ring] | None = (
            Ring(segment.memory, rows.offset, rows.count, rows.size),
            Ring(segment.memory, events.offset, events.count, events.size),
        )
        self._seen = 0
        self._owner = segment.owner
        _, _, share = segment.path.name.partition("-")
        self._socket = segment.path.with_name(folder.file_name(folder.SOCKET, share))
        self._desk: Desk | None = None

    def __enter__(self) -> Reader:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Lets go of the memory; what was read stays. The share is there for others."""
        self._rings = None

    @property
    def state(self) -> State:
        """Of the writer: "running"; "ended": its loop was left; "dead": killed, or crashed."""
        if self._ring(CYCLES).ended:
            return "ended"
        return "running" if self.layout.writer.is_alive else "dead"

    @property
    def alive(self) -> bool:
        """Whether there may be more cycles."""
        return self.state == "running"

    @property
    def number(self) -> int:
        """Of the newest cycle; 0: there is none yet."""
        return self._ring(CYCLES).newest

    def wait(self, timeout: float | None = None) -> bool:
        """Sleeps until there is a cycle newer than the last one that `read` or `wait` has seen.
        False: `timeout` [s] has passed, or no more will come: see `alive`."""
        deadline = FOR_EVER if timeout is None else time.monotonic_ns() + round(timeout * 1e9)
        while not self._has_news(min(deadline, time.monotonic_ns() + LOOK_NS)):
            if time.monotonic_ns() >= deadline:
                return False
            if not self.alive:
                return self._has_news(0)  # the last ones may have come before we asked
        return True

    def read(self) -> np.void:
        """The newest cycle: a record of `dtype`, copied whole. ShareError: there is none yet."""
        number, row = self._ring(CYCLES).copy()
        if number == 0:
            raise ShareError(
                f"the share {self.layout.name!r} has no cycle yet", hint="wait() for it"
            )
        self._seen = number
        record: np.void = np.frombuffer(row, self.dtype)[0]
        return record

    def rows(self, after: int) -> tuple[Rows, int]:
        """Every cycle behind number `after` that is still there, oldest first, as an array of
        `dtype`; and how many are missing before the last of them, since they were overwritten."""
        rows, lost = self._ring(CYCLES).copy_after(after)
        return np.frombuffer(rows, self.dtype), lost

    def events(self, after: int = 0) -> tuple[list[SharedEvent], int]:
        """Every event behind serial `after` that is still there, oldest first; and how many are
        missing before the last of them, since they were overwritten."""
        rows, lost = self._ring(EVENTS).copy_after(after)
        size = self.layout.events.size
        return [decode_event(rows[at : at + size]) for at in range(0, len(rows), size)], lost

    def lease(self, axes: Sequence[str | int] | None = None, *, for_: float = 0.5) -> Lease:
        """The right to command some axes, by name or number (None: all), for `for_` seconds after
        each command. LeaseError: another client has one of them. ShareError: the loop has ended, or
        may not be commanded."""
        if not self.alive:
            raise ShareError(f"the loop of the share {self.layout.name!r} has ended")
        if self._desk is None:
            self._desk = open_desk(self.layout, self._socket, self._owner)
        return lease_of(self._desk, self.layout, axes, for_)

    def _has_news(self, deadline_ns: int) -> bool:
        """Waits so long for a cycle that was not seen yet."""
        if not self._ring(CYCLES).wait(self._seen, deadline_ns):
            return False
        self._seen = self.number
        return True

    def _ring(self, which: int) -> Ring:
        if self._rings is None:
            raise RuntimeError("the reader is closed")
        return self._rings[which]
