"""Publication of the cycles of a loop for other processes."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from catenary.errors import ShareError
from catenary.plan.sink import Incident, SinkLayout
from catenary.share import folder, memory
from catenary.share._rows import CycleWriter, Ring
from catenary.share.choice import Names
from catenary.share.command_table import Desk, Values, make_desk
from catenary.share.commands import (
    AxisCommand,
    Commanded,
    CommandReader,
    LeaseEnd,
    apply,
    places_of,
)
from catenary.share.desk_socket import DeskSocket
from catenary.share.events import SharedEvent, encode_event, read_events
from catenary.share.extrapolation import Extrapolation
from catenary.share.layout import ShareLayout, decode_head, encode_head, make_layout
from catenary.share.memory import Segment
from catenary.share.operation import Operation
from catenary.share.operator_request import OperatorRequest
from catenary.share.process import this_process

HISTORY = 2.0  # [s]
OTHERS_WRITE = 0o022  # never granted: a user who truncates the file would crash the loop


class Share:
    """Owner of a name under which other processes find the cycles of a loop.

        with cat.Share("arm") as share, cat.Loop(arm, period=1e-3, sink=share) as loop:
            for cycle in loop: ...

    Other processes call `cat.attach("arm")`. Readers cannot delay the loop.

    A share serves one loop at a time. Each loop that opens it creates a new segment, whose cycles
    are numbered from 1. Readers of the previous segment detect its end and must attach again.

    Args:
        name: name of the share.
        history: time span of the cycles that readers can access [s].
        mode: permissions as for chmod. 0o600: this user only. 0o640: the group can read.
            0o660: the group can read and command. Only this user can ever write to the cycles.
        jog: accept jogs from clients, and their requests to enable and reset axes. They can always
            stop and disable axes.

        modes: operating modes that operators can request: names, or description by name.
        presets: presets that operators can request, in the same form.

    Raises:
        ShareError: on entry, if the name belongs to a running process or another user.
        TypeError: `mode` is not a number, or a name or description is not a text.
        ValueError: an argument is out of range.
    """

    def __init__(
        self,
        name: str,
        *,
        history: float = HISTORY,
        mode: int = 0o600,
        jog: bool = False,
        modes: Names = (),
        presets: Names = (),
    ) -> None:
        if not history > 0:
            raise ValueError(f"history={history} s: must be positive")
        if not isinstance(mode, int):
            raise TypeError(f"mode={mode!r}: permissions are a number; operating modes are modes=")
        if not 0 <= mode <= 0o777:
            raise ValueError(f"mode={mode:#o}: must be permissions as for chmod, such as 0o600")
        self.name = name
        self._file = folder.file_name(folder.STATE, name)
        self._socket_file = folder.file_name(folder.SOCKET, name)
        self._history = history
        self._permissions = mode
        self._jog = jog
        self._operation = Operation(modes, presets, self._report_accepted)
        self._entered = False
        self._pid = 0  # process that entered the block
        self._segment: Segment | None = None
        self._desk: Desk | None = None
        self._socket: DeskSocket | None = None
        self._commands: CommandReader | None = None
        self._extrapolation = Extrapolation((), period=1.0)
        self._layout: ShareLayout | None = None
        self._cycles: CycleWriter | None = None
        self._events: Ring | None = None
        self._reporting = threading.Lock()

    def __enter__(self) -> Self:
        self._refuse_taken()
        self._entered = True
        self._pid = os.getpid()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._entered = False
        if self.is_inherited:
            return
        self.close()
        if self._segment is not None:
            self._segment.unlink()
        self._segment = self._desk = None

    # Commands of other processes. Only the thread that iterates the loop calls these methods.

    def apply(self, *drives: Commanded) -> list[LeaseEnd]:
        """Write the newest command of each axis into the targets of drives. Never blocks.

            for cycle in loop:
                for end in share.apply(arm):
                    print(end)

        Axes whose lease has ended hold their commanded position. Return these leases, so that the
        application can react.
        """
        reader, number = self._reader(), 0 if self._cycles is None else self._cycles.newest
        commands, ended = reader.commands(), reader.ended()
        moving = self._extrapolation.follow(commands, ended, number)
        if commands or ended or moving:
            places = places_of(drives)
            if commands or ended:
                apply(commands, ended, places, self.layout.axes, self._commanded_position())
            self._extrapolation.write(places, number)
        return ended

    def commands(self) -> list[AxisCommand]:
        """Read the new commands of valid leases, and end the leases that are over.

        Return the commands, grouped by client, oldest first. Never blocks.
        """
        return self._reader().commands()

    def ended(self) -> list[LeaseEnd]:
        """Return the leases that have ended since the last call, as detected by `commands`."""
        return self._reader().ended()

    def _reader(self) -> CommandReader:
        if self._commands is None:
            raise RuntimeError(
                f"the share {self.name!r} cannot read commands before a Loop is open"
            )
        return self._commands

    def _commanded_position(self) -> Values:
        """Return the commanded positions of the newest cycle [rad], shape (axes,).

        They are NaN before the first cycle and after the loop has closed.
        """
        newest = self.newest()
        if newest is None:
            return np.full(len(self.layout.axes), np.nan)
        commanded: Values = newest["commanded_position"]
        return commanded

    def newest(self) -> np.void | None:
        """Return the newest cycle, as `Reader.read`; None if there is none yet, or no loop.

        Any thread may call it.
        """
        cycles = self._cycles
        number, row = cycles.copy() if cycles is not None else (0, b"")
        return np.frombuffer(row, self._dtype)[0] if number else None

    # Operating modes and presets. Only the process of the loop calls these methods.

    @property
    def mode(self) -> str | None:
        """Operating mode of the program; None until the program sets it.

        A new mode is published to readers, and becomes an event `ModeChanged`. Setting it raises
        ValueError for a mode that `modes` does not name, and RuntimeError in a forked child.
        """
        return self._operation.mode

    @mode.setter
    def mode(self, name: str) -> None:
        if self._entered and self.is_inherited:
            raise RuntimeError(
                f"the mode of the share {self.name!r} belongs to process {self._pid}; set it there"
            )
        before = self._operation.change_mode(name)
        if before == name:
            return
        after = "" if before is None else f", after {before!r}"
        details = {"mode": name, "before": before}
        self._report_now("ModeChanged", f"operating mode {name!r}{after}", details)

    def requests(self) -> Sequence[OperatorRequest]:
        """Return the request of an operator that has arrived since the last call, if any.

            for cycle in loop:
                for request in share.requests():
                    if request.kind == "mode" and request.accept():
                        share.mode = request.name

        Never blocks, and takes no lock. Accept or refuse each request within 1 s; its client then
        receives an error. Until then, requests of other clients are refused.
        """
        return self._operation.take()

    @property
    def operation(self) -> Operation:
        """Operating modes and presets, for the service of the share."""
        return self._operation

    @property
    def layout(self) -> ShareLayout:
        """Layout of the data of the current loop, or of the last one."""
        if self._layout is None:
            raise RuntimeError(f"the share {self.name!r} has no layout before a Loop is open")
        return self._layout

    # plan.sink.Sink

    def open(self, layout: SinkLayout) -> object:
        """Create and publish the segment of a loop. Return its sink capsule. Called by the loop.

        Raises:
            RuntimeError: the share is not entered, or already belongs to a loop.
            ShareError: the name is taken, or the memory is full.
        """
        if not self._entered:
            raise RuntimeError(
                f"the share is not entered; use a with block: with cat.Share({self.name!r}) ..."
            )
        if self._cycles is not None:
            raise RuntimeError(
                f"the share {self.name!r} already belongs to a loop; use one share for each loop"
            )
        made = self._make_layout(layout)
        segment, desk, listening = self._make_files(made)
        blocks = (layout.record_size, layout.actual_size, layout.target_size)
        rows, events = made.rows, made.events
        cycles = CycleWriter(
            segment.memory,
            rows.offset,
            rows.count,
            rows.size,
            blocks,
            writable=True,
            motion=desk.motion_place,
            jog=self._jog,
        )
        self._publish(segment, listening)
        self._socket = listening
        self._segment, self._layout, self._cycles = segment, made, cycles
        self._dtype = made.dtype
        self._desk, self._commands = desk, CommandReader(desk, made)
        self._extrapolation = Extrapolation(made.axes, made.period)
        self._events = Ring(segment.memory, events.offset, events.count, events.size, writable=True)
        return cycles.capsule

    def append(self, row: bytes) -> None:
        """Append a row to a share that no loop writes, such as the share of a sensor.

        Only one thread may call this.

        Raises:
            RuntimeError: the share is not open.
            ValueError: the row is too long.
        """
        if self._cycles is None:
            raise RuntimeError(f"the share {self.name!r} is not open")
        self._cycles.write(row)

    def report(self, incident: Incident) -> None:
        """Append an event; a no-op if no loop is open. Called by the loop from any thread."""
        with self._reporting:
            if self._events is not None and self._cycles is not None:
                number = self._events.newest + 1
                self._events.write(encode_event(incident, number, self._cycles.newest))

    def close(self) -> None:
        """End the segment and all leases. Called by the loop. A no-op in a forked child.

        The data remains readable until the next loop opens or the `with` block ends.
        """
        if self.is_inherited:
            return
        self._operation.detach()
        with self._reporting:
            for ring in (self._events, self._cycles):
                if ring is not None:
                    ring.end()
            self._cycles = self._events = None
            if self._desk is not None:
                self._desk.end_all()
            if self._socket is not None:
                self._socket.close()
                self._socket = None

    @property
    def permissions(self) -> int:
        """Permissions of the share as for chmod: the argument `mode`."""
        return self._permissions

    def shared_events(self, after: int) -> tuple[Iterator[SharedEvent], int]:
        """Copy the events of the open loop after serial `after`: see `events.read_events`."""
        with self._reporting:
            return (iter(()), 0) if self._events is None else read_events(self._events, after)

    @property
    def is_inherited(self) -> bool:
        """True in a forked child, which must not end the share of its parent."""
        return self._pid != os.getpid()

    def _report_accepted(self, request: OperatorRequest) -> None:
        details = {"kind": request.kind, "name": request.name, "client": request.client}
        message = f"{request.client} requested {request.kind} {request.name!r}: accepted"
        self._report_now("RequestAccepted", message, details)

    def _report_now(self, kind: str, message: str, details: Mapping[str, object]) -> None:
        """Append an event with the time of the newest cycle."""
        newest = self.newest()
        now = 0.0 if newest is None else float(newest["scheduled_ns"]) * 1e-9
        self.report(Incident(kind, message, now, details=details))

    def _make_layout(self, layout: SinkLayout) -> ShareLayout:
        return make_layout(
            self.name,
            layout,
            history=self._history,
            opened=time.time(),
            writer=this_process(),
            jog=self._jog,
            operation=self._operation,
        )

    def _make_files(self, made: ShareLayout) -> tuple[Segment, Desk, DeskSocket]:
        """Create the file and the socket as drafts. Raises ShareError if the memory is full."""
        where = folder.own_folder()
        mode = self._permissions & ~OTHERS_WRITE
        folder.prepare(where, mode)
        segment = memory.create(where, made.size, mode)
        try:
            head = encode_head(made)
            segment.memory[: len(head)] = head
            if made.modes:
                self._operation.attach(segment.memory, made.mode_offset)
            desk, descriptor = make_desk(made)
            return segment, desk, DeskSocket(where, descriptor, self._permissions)
        except BaseException:
            segment.path.unlink()
            raise

    def _publish(self, segment: Segment, listening: DeskSocket) -> None:
        """Rename the drafts, the socket first, so that a reader of the segment can connect."""
        where = segment.path.parent
        try:
            with folder.deciding(where):
                self._refuse_taken()
                listening.publish(where / self._socket_file)
                segment.publish(where / self._file)
        except BaseException as error:
            segment.path.unlink(missing_ok=True)
            listening.close()
            if isinstance(error, PermissionError):  # the sticky bit protects files of other users
                raise self._belongs_to_another(where / self._file) from error
            raise

    def _refuse_taken(self) -> None:
        """Raise ShareError if the name is taken. A share of this user's dead writer is replaced.

        The name is taken if its file belongs to a running writer or another user, or is not a
        valid share.
        """
        if self._segment is not None and self._segment.is_published:
            return
        path = folder.own_folder() / self._file
        try:
            found = memory.open_segment(path, (os.geteuid(),))
            layout = decode_head(found.memory, found.size)
        except FileNotFoundError:
            return
        except PermissionError as error:
            raise self._belongs_to_another(path) from error
        except ShareError as error:
            raise ShareError(
                f"{path} exists and cannot be replaced: {error.message}",
                hint="choose another name, or remove it",
            ) from error
        if layout.writer.is_alive:
            raise ShareError(
                f"the share {self.name!r} belongs to {layout.writer}, which is running",
                hint="choose another name, or end that process first",
            )

    def _belongs_to_another(self, path: Path) -> ShareError:
        return ShareError(
            f"the share {self.name!r} belongs to another user: {path}",
            hint="choose another name",
        )
