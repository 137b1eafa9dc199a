"""Loop side of the desk: commands of clients, and leases that have ended."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from catenary.share.command_table import EXTRAPOLATE, QUANTITIES, Desk, Reason, Values
from catenary.share.layout import ShareLayout
from catenary.share.process import Process

ALIVE_CHECK_NS = 20_000_000  # interval at which client processes are checked


class Targets(Protocol):
    """Arrays that commands are written to: the `target` of `Drives`."""

    @property
    def position(self) -> Values: ...
    @property
    def velocity(self) -> Values: ...
    @property
    def torque(self) -> Values: ...


class Commanded(Protocol):
    """Part of `Drives` that commands need."""

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def target(self) -> Targets: ...


Places: TypeAlias = Mapping[str, tuple[Targets, int]]


@dataclass(frozen=True, slots=True)
class AxisCommand:
    """Set-points of a client. A quantity that is not commanded is None."""

    axes: tuple[int, ...]  # indices, in the order of the layout
    position: Values | None  # [rad], one for each of `axes`
    velocity: Values | None  # [rad/s]
    torque: Values | None  # [N·m]
    client: Process
    extrapolate: bool = False  # True: the positions continue with the velocities


@dataclass(frozen=True, slots=True)
class LeaseEnd:
    """A lease that has ended. Its client no longer commands the axes."""

    axes: tuple[str, ...]
    reason: Reason
    client: Process

    def __str__(self) -> str:
        return f"lease on {', '.join(self.axes)} of {self.client}: {self.reason}"


@dataclass(slots=True)
class _Known:
    """A lease that the loop has recorded."""

    serial: int
    axes: tuple[int, ...]
    client: Process


class CommandReader:
    """Reader of the commands and leases of all clients.

    Only the thread that iterates the loop uses it. It never blocks.
    """

    def __init__(self, desk: Desk, layout: ShareLayout) -> None:
        self._desk = desk
        self._layout = layout
        self._known: dict[int, _Known] = {}  # by number of the place
        self._ended: list[LeaseEnd] = []
        self._next_check_ns = 0

    def commands(self) -> list[AxisCommand]:
        """Read the new commands of valid leases, and end the leases that are over.

        Return the commands, grouped by client, oldest first.
        """
        self._follow_leases()
        return [
            command for place, known in self._known.items() for command in self._read(place, known)
        ]

    def ended(self) -> list[LeaseEnd]:
        """Return the leases that have ended since the last call, as detected by `commands`."""
        ended, self._ended = self._ended, []
        return ended

    def _read(self, place: int, known: _Known) -> list[AxisCommand]:
        desk = self._desk
        taken = desk.taken.load(place)
        rows, lost = desk.rings[place].copy_after(taken)
        array = np.frombuffer(rows, desk.row)
        array = array[array["lease"] <= known.serial]  # read those of a new lease later
        if not len(array):
            return []
        desk.taken.store(place, taken + lost + len(array))
        return [self._command(row, known) for row in array if row["lease"] == known.serial]

    def _command(self, row: np.void, known: _Known) -> AxisCommand:
        axes = list(known.axes)
        position, velocity, torque = (
            row[name][axes] if int(row["quantities"]) >> bit & 1 else None
            for bit, name in enumerate(QUANTITIES)
        )
        extrapolate = bool(int(row["quantities"]) & EXTRAPOLATE)
        return AxisCommand(known.axes, position, velocity, torque, known.client, extrapolate)

    def _follow_leases(self) -> None:
        """Record new leases, and end those that are over."""
        leases = self._desk.leases.load_all()
        if not self._known and not any(leases):
            return
        now = time.monotonic_ns()
        check_clients = now >= self._next_check_ns
        if check_clients:
            self._next_check_ns = now + ALIVE_CHECK_NS
        for place, serial in enumerate(leases):
            known = self._known.get(place)
            if known is not None and known.serial != serial:
                self._forget(place, self._desk.reason(place, known.serial))
            if serial and self._desk.is_valid(place, serial) and self._record(place, serial):
                self._end_if_over(place, serial, now, check_clients)

    def _record(self, place: int, serial: int) -> bool:
        """Record a lease if it is new. Return False if the place has changed meanwhile."""
        if place in self._known:
            return True
        axes = tuple(np.flatnonzero(self._desk.holders == serial).tolist())
        client = self._desk.client(place)
        if self._desk.leases.load(place) != serial:
            return False  # the data read may belong to another lease
        self._known[place] = _Known(serial, axes, client)
        return True

    def _end_if_over(self, place: int, serial: int, now: int, check_client: bool) -> None:
        if self._desk.deadlines_ns.load(place) > now and not check_client:
            return
        reason = self._desk.ending(place, now)
        if reason is not None:
            self._desk.end(place, serial, reason)
            self._forget(place, reason)

    def _forget(self, place: int, reason: Reason) -> None:
        known = self._known.pop(place)
        names = tuple(self._layout.axes[axis] for axis in known.axes)
        self._ended.append(LeaseEnd(names, reason, known.client))


def places_of(drives: Sequence[Commanded]) -> Places:
    """Return the targets of drives, and the indices in them, by name of the axis."""
    return {name: (each.target, k) for each in drives for k, name in enumerate(each.names)}


def apply(
    commands: Sequence[AxisCommand],
    ended: Sequence[LeaseEnd],
    places: Places,
    axes: Sequence[str],
    commanded: npt.NDArray[np.float64],
) -> None:
    """Write commands into the targets of drives.

    First, axes whose lease has ended hold their commanded position, with zero velocity and torque.
    Then the newest command of each axis is written: another client may already have leased it.

    Args:
        commands: new commands, oldest first.
        ended: leases that have ended.
        places: targets of the drives, and indices in them, by name of the axis.
        axes: names of the axes, in the order of the layout.
        commanded: commanded positions [rad], shape (axes,). NaN leaves the target
            position unchanged.
    """
    for name in (name for end in ended for name in end.axes if name in places):
        target, k = places[name]
        held = commanded[axes.index(name)]
        target.position[k] = held if np.isfinite(held) else target.position[k]
        target.velocity[k] = target.torque[k] = 0.0
    for command in commands:
        for quantity in QUANTITIES:
            values: Values | None = getattr(command, quantity)
            if values is None:
                continue
            for axis, value in zip(command.axes, values.tolist(), strict=True):
                if axes[axis] in places:
                    target, k = places[axes[axis]]
                    getattr(target, quantity)[k] = value
