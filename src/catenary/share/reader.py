"""Reader of the cycles and events of a loop in another process."""

from __future__ import annotations

import os
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
from catenary.share.layout import ShareLayout, decode_head, decode_mode
from catenary.share.lease import Lease, lease_of
from catenary.share.memory import Segment

ALIVE_CHECK_NS = 250_000_000  # interval at which the writer process is checked
NO_DEADLINE_NS = 1 << 62
CYCLES, EVENTS = 0, 1
END = object()

Rows = npt.NDArray[np.void]
State = Literal["running", "ended", "dead"]


def attach(
    name: str, *, stale: bool = False, uid: int | None = None, patience: Iterable[object] = ()
) -> Reader:
    """Open the share `name` of another process for reading. Use the result in a `with` block.

    Args:
        name: name of the share.
        stale: accept a share whose writer has died, to read its last cycles.
        uid: owner of the share; None: this user or root. Shares of others are refused, because the
            owner of a share can crash its readers.
        patience: after a ShareError, retry once for each item of this iterable, for example the
            jobs of a task: `attach(name, patience=task)`.

    Returns:
        The reader of the share.

    Raises:
        ShareError: the share does not exist, cannot be read, belongs to another user, has a dead
            writer, or was written by another version.
        ValueError: the name is invalid.
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
            f"there is no share {name!r}; existing shares: {others}",
            hint="a share exists while a Loop with sink=cat.Share(...) is open; for the share of "
            "another user, pass uid= (--uid)",
        ) from error
    except PermissionError as error:
        raise ShareError(
            f"no permission to read the share {name!r}: {error.filename} belongs to another user",
            hint="its writer can allow it: cat.Share(..., mode=0o640) for the group",
        ) from error
    except ShareError as error:
        raise ShareError(
            f"cannot open the share {name!r}: {error.message}", hint=error.hint
        ) from error
    try:
        reader = Reader(segment, layout)
    except (ValueError, OverflowError) as error:
        raise ShareError(f"the description of the share {name!r} is invalid: {error}") from error
    if reader.state == "dead" and not stale:
        raise ShareError(
            f"the share {name!r} is stale: {layout.writer} has died",
            hint=f"read its last cycles with cat.attach({name!r}, stale=True); a new writer "
            "replaces the share",
        )
    return reader


class Reader:
    """Read-only view of a share. `catenary.attach` creates it.

        with cat.attach("arm") as arm:
            while arm.wait(timeout=1.0):
                now = arm.read()
                print(now["number"], now["position"])

    The memory is mapped read-only, so a reader can neither delay nor change the loop.
    """

    def __init__(self, segment: Segment, layout: ShareLayout) -> None:
        self.layout = layout
        self.dtype = layout.dtype
        rows, events = layout.rows, layout.events
        self._rings: tuple[Ring, Ring] | None = (
            Ring(segment.memory, rows.offset, rows.count, rows.size),
            Ring(segment.memory, events.offset, events.count, events.size),
        )
        self._memory = segment.memory
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
        """Unmap the memory. Data already read stays valid; other readers are not affected."""
        self._rings = None

    @property
    def state(self) -> State:
        """State of the writer: "running", "ended" (loop closed) or "dead" (killed or crashed)."""
        if self._ring(CYCLES).ended:
            return "ended"
        return "running" if self.layout.writer.is_alive else "dead"

    @property
    def alive(self) -> bool:
        """True if more cycles may come."""
        return self.state == "running"

    @property
    def number(self) -> int:
        """Number of the newest cycle; 0 before the first cycle."""
        return self._ring(CYCLES).newest

    @property
    def mode(self) -> str | None:
        """Operating mode of the program, one of `layout.modes`; None if it has set none.

        Raises ShareError if the share is damaged.
        """
        self._ring(CYCLES)  # raises an error if the reader is closed
        return decode_mode(self._memory, self.layout)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for a cycle after the last one that `read` or `wait` has reported.

        Return False after `timeout` [s], or if no more cycles will come (see `alive`). None sets no
        limit.
        """
        deadline = NO_DEADLINE_NS if timeout is None else time.monotonic_ns() + round(timeout * 1e9)
        while not self._has_news(min(deadline, time.monotonic_ns() + ALIVE_CHECK_NS)):
            if time.monotonic_ns() >= deadline:
                return False
            if not self.alive:
                return self._has_news(0)  # the last cycles may have come before the check
        return True

    def read(self) -> np.void:
        """Return a consistent copy of the newest cycle: a record of type `dtype`.

        Raises ShareError before the first cycle.
        """
        number, row = self._ring(CYCLES).copy()
        if number == 0:
            raise ShareError(
                f"the share {self.layout.name!r} has no cycle yet", hint="wait() for it"
            )
        self._seen = number
        record: np.void = np.frombuffer(row, self.dtype)[0]
        return record

    def rows(self, after: int) -> tuple[Rows, int]:
        """Return the cycles after cycle `after` that still exist, oldest first.

        The result is an array of type `dtype`, and the number of cycles between `after` and the
        last returned cycle that were overwritten.
        """
        rows, lost = self._ring(CYCLES).copy_after(after)
        return np.frombuffer(rows, self.dtype), lost

    def events(self, after: int = 0) -> tuple[list[SharedEvent], int]:
        """Return the events after serial `after` that still exist, oldest first.

        Also return how many events between `after` and the last returned event were overwritten.
        Raises ShareError if an event is damaged.
        """
        rows, lost = self._ring(EVENTS).copy_after(after)
        size = self.layout.events.size
        return [decode_event(rows[at : at + size]) for at in range(0, len(rows), size)], lost

    def lease(self, axes: Sequence[str | int] | None = None, *, for_: float = 0.5) -> Lease:
        """Take a lease: the right to command some axes.

        Args:
            axes: names or numbers of the axes; None: all axes.
            for_: time until the lease expires, counted from the last renewal [s].

        Raises:
            LeaseError: another client has leased one of the axes, there are too many clients, or
                the desk is locked for too long or damaged.
            ShareError: the loop has ended, or does not accept commands from this user.
            ValueError: unknown axes, or `for_` out of range.
        """
        if not self.alive:
            raise ShareError(f"the loop of the share {self.layout.name!r} has ended")
        return lease_of(self._opened_desk(), self.layout, axes, for_)

    def stop(self) -> None:
        """Stop all axes at the next cycle, with a quick stop. It needs no lease.

        Each axis needs a new request to be enabled again. The first call opens the memory for
        commands, unless `token` or `lease` has opened it.

        Raises ShareError if the loop does not accept commands from this user, or has ended.
        """
        motion = self._opened_desk().motion
        motion.stopper.store(0, os.getpid())
        motion.stop.add(0, 1)
        if not self.alive:
            raise ShareError(
                f"the loop of the share {self.layout.name!r} has ended, and cannot be stopped",
                hint="attach again, if its program has opened another loop",
            )

    @property
    def token(self) -> int:
        """Newest token of the core, a number of 48 bits; 0 before the first cycle.

        A heartbeat of a jog echoes it (`Jog.beat`). The core issues a token every 50 ms.

        Raises ShareError if the loop does not accept commands from this user.
        """
        return self._opened_desk().motion.token.load(0)

    def _opened_desk(self) -> Desk:
        """Return the desk of the loop. The first call opens it."""
        if self._desk is None:
            self._desk = open_desk(self.layout, self._socket, self._owner)
        return self._desk

    def _has_news(self, deadline_ns: int) -> bool:
        """Wait for a new cycle. Return False at the deadline, or when the ring has ended."""
        if not self._ring(CYCLES).wait(self._seen, deadline_ns):
            return False
        self._seen = self.number
        return True

    def _ring(self, which: int) -> Ring:
        if self._rings is None:
            raise RuntimeError("the reader is closed")
        return self._rings[which]
