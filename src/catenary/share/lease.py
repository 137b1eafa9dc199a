"""Leases: the right to command axes of a loop in another process for a limited time."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType

import numpy as np
import numpy.typing as npt

from catenary.errors import LeaseError
from catenary.share.command_table import (
    COMMANDS,
    EXTRAPOLATE,
    PLACES,
    QUANTITIES,
    Desk,
    Reason,
)
from catenary.share.jog import (
    STATES,
    Jog,
    State,
    StateRequest,
    checked_values,
    press,
    request_state,
)
from catenary.share.layout import ShareLayout
from catenary.share.process import this_process
from catenary.share.sweep import Sweep

LOCK_TIMEOUT_NS = 2_000_000_000  # a running owner unlocks much earlier; a dead one loses the lock


class Lease:
    """Right to command some axes. `Reader.lease` creates it.

    It ends when it is released or not renewed in time, or when its process or the loop ends.

        with arm.lease(axes=["1 Servo"], for_=0.5) as command:
            command.send(position=[0.3])       # also renews the lease
    """

    def __init__(self, desk: Desk, layout: ShareLayout, axes: Sequence[int], for_: float) -> None:
        self.axes = tuple(layout.axes[axis] for axis in axes)
        self._layout = layout
        self._desk = desk
        self._numbers = list(axes)
        self._for_ns = round(for_ * 1e9)
        self._pid = os.getpid()
        self._jogs: dict[int, Jog] = {}  # the last one of each axis
        with locked(desk):
            try:
                self._place = self._take_place()
                self._serial = self._take_axes()
            except (ValueError, OverflowError) as error:
                raise LeaseError(
                    f"the desk of the share {layout.name!r} is damaged: {error}",
                    hint="another client has overwritten it; restart the loop",
                ) from error

    def send(
        self,
        position: npt.ArrayLike | None = None,
        *,
        velocity: npt.ArrayLike | None = None,
        torque: npt.ArrayLike | None = None,
        extrapolate: bool = False,
    ) -> None:
        """Send set-points for the axes of the lease, and renew the lease.

        The loop applies the set-points in the next cycle in which it reads commands. Each value is
        a scalar or has shape (axes,), in the order of the lease. A quantity that is
        None is not commanded.

        Args:
            position: positions [rad].
            velocity: velocities [rad/s].
            torque: torques [N·m].
            extrapolate: True: the positions continue with the velocities until the next command,
                for at most 20 ms; then the velocities become 0. Use it if the client sends more
                slowly than the loop cycles.

        Raises:
            LeaseError: the lease has ended, the loop does not read commands, or the desk is locked
                for too long.
            ValueError: a value has the wrong shape or is not finite, no value is given, or
                `extrapolate` lacks positions or velocities.
        """
        if extrapolate and (position is None or velocity is None):
            raise ValueError("extrapolate=True needs position= and velocity=")
        row = np.zeros((), self._desk.row)
        given_values = zip(QUANTITIES, (position, velocity, torque), strict=True)
        for bit, (name, given) in enumerate(given_values):
            row[name] = np.nan
            if given is not None:
                row[name][self._numbers] = self._checked(name, given)
                row["quantities"] |= np.uint64(1 << bit)
        if not row["quantities"]:
            raise ValueError("nothing to send; pass position=, velocity= or torque=")
        if extrapolate:
            row["quantities"] |= np.uint64(EXTRAPOLATE)
        row["lease"] = self._serial
        self._renew(row.tobytes())

    def jog(
        self,
        axis: str | int,
        velocity: float,
        *,
        distance: float | None = None,
        acceleration: float | None = None,
        sweep: Sweep | None = None,
        token: int | None = None,
    ) -> Jog:
        """Request a motion of one axis by the core of the loop, and renew the lease.

        The axis must be enabled, at rest, and in mode csp, csv or pv. While it is jogged, it
        ignores the targets of the application. The motion needs heartbeats: see `Jog.beat`. Read
        the answer of the core in `Jog.status`.

        Args:
            axis: name or number of an axis of the lease.
            velocity: signed velocity, limited to the limit of the axis [rad/s or m/s].
            distance: distance to move [rad or m]; None: move until release.
            acceleration: acceleration, limited to that of the axis [rad/s² or m/s²]; None: that of
                the axis.
            sweep: sine of changing frequency, whose amplitude is `velocity`; it has no `distance`.
                None: constant velocity.
            token: the token that the operator's device has echoed; None: the newest token, for a
                program on this machine.

        Returns:
            Handle of the jog.

        Raises:
            LeaseError: the lease has ended, or the desk is locked for too long.
            ValueError: the axis is not part of the lease, or a value is out of range.
        """
        [number] = self._numbers_of([axis])
        values = checked_values(velocity, distance, acceleration, sweep)
        if sweep is not None:
            sweep.check_period(self._layout.period)
        words = self._desk.motion
        self._check_loop()
        with self._renewed():
            serial = press(words, number, values, token)
        jog = Jog(words, number, serial, self.renew, self._layout.axes[number])
        self._jogs[number] = jog
        return jog

    def request(self, state: State, axes: Sequence[str | int] | None = None) -> StateRequest:
        """Request a state of axes from the core of the loop, and renew the lease.

        A later request of the application replaces it. "enable" and "reset" are refused unless the
        share was opened with `jog=True`. An axis in mode cst cannot be enabled in this way.

        Args:
            state: "disable", "enable", "quick_stop" or "reset" (disabled, with a fault reset).
            axes: names or numbers of axes of the lease; None: all of them.

        Returns:
            Handle of the request.

        Raises:
            LeaseError: the lease has ended, or the desk is locked for too long.
            ValueError: the state is unknown, or an axis is not part of the lease.
        """
        if state not in STATES:
            raise ValueError(f"state={state!r}: must be one of {', '.join(STATES)}")
        numbers = self._numbers if axes is None else self._numbers_of(axes)
        words = self._desk.motion
        self._check_loop()
        with self._renewed():
            if state == "quick_stop":
                words.stopper.store(0, self._pid)
            requests = {number: request_state(words, number, STATES[state]) for number in numbers}
        return StateRequest(words, requests)

    def renew(self) -> None:
        """Renew the lease for its full duration.

        Raises LeaseError if the lease or the loop's process has ended, or if the desk is locked for
        too long.
        """
        self._check_loop()
        self._renew(None)

    def release(self) -> None:
        """Release the axes and their jogs. A no-op if the lease has ended, or in a forked child.

        Raises LeaseError if the desk is locked for too long.
        """
        if os.getpid() != self._pid:
            return
        for jog in self._jogs.values():
            jog.release()
        with locked(self._desk):
            if self._is_valid():
                free(self._desk, self._place, Reason.RELEASED)

    def __enter__(self) -> Lease:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def _renew(self, row: bytes | None) -> None:
        """Renew the lease, and write a row unless it is None."""
        with self._renewed():
            if row is None:
                return
            self._check_taken()
            self._desk.rings[self._place].write(row)

    @contextmanager
    def _renewed(self) -> Iterator[None]:
        """Lock the desk for a block, after the renewal of the lease.

        The mutex protects the place against reassignment.
        """
        desk, place = self._desk, self._place
        with locked(desk):
            now = time.monotonic_ns()
            if not self._is_valid() or desk.deadlines_ns.load(place) <= now:
                raise LeaseError(
                    f"the lease on {', '.join(self.axes)} has ended: "
                    f"{desk.reason(place, self._serial)}",
                    hint="take a new lease; call send() or renew() at least every "
                    f"{self._for_ns * 1e-9:g} s, or pass a longer for_=",
                )
            desk.deadlines_ns.store(place, now + self._for_ns)
            yield

    def _numbers_of(self, axes: Sequence[str | int]) -> list[int]:
        """Return the indices of axes in the layout. Raises ValueError for an axis without lease."""
        numbers = axis_numbers(self._layout, axes)
        for number in numbers:
            if number not in self._numbers:
                raise ValueError(
                    f"axis {self._layout.axes[number]!r} is not part of this lease on "
                    f"{', '.join(self.axes)}"
                )
        return numbers

    def _check_taken(self) -> None:
        """Raise LeaseError if the loop does not read commands.

        The process of the loop is checked only if commands are waiting.
        """
        waiting = self._desk.rings[self._place].newest - self._desk.taken.load(self._place)
        if waiting:
            self._check_loop()
        if waiting >= COMMANDS:
            raise LeaseError(
                f"the loop has not read the last {COMMANDS} commands",
                hint="its body must call share.apply(drives) or share.commands()",
            )

    def _check_loop(self) -> None:
        """Raise LeaseError if the process of the loop has died: its answers stay in the desk."""
        if not self._layout.writer.is_alive:
            raise LeaseError(f"the loop's process has died: {self._layout.writer}")

    def _is_valid(self) -> bool:
        return self._desk.is_valid(self._place, self._serial)

    def _checked(self, name: str, given: npt.ArrayLike) -> npt.NDArray[np.float64]:
        values = np.asarray(given, dtype=np.float64)
        if values.shape not in ((), (len(self.axes),)):
            raise ValueError(
                f"{name} has shape {values.shape}; pass a scalar or shape ({len(self.axes)},)"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"{name} contains NaN or infinity; set-points must be finite")
        return values

    def _take_place(self) -> int:
        """Free the places and axes of leases that have ended, then return a free place.

        The caller holds the mutex. Raises LeaseError if no place is free.
        """
        desk, now = self._desk, time.monotonic_ns()
        for place, serial in enumerate(desk.leases.load_all()):
            if serial and not desk.is_valid(place, serial):
                free(desk, place, desk.reason(place, serial))
            elif serial and (reason := desk.ending(place, now)):
                free(desk, place, reason)
        leases = desk.leases.load_all()
        orphans = ~np.isin(desk.holders, leases)  # entries of a client that was killed
        desk.holders[orphans] = 0
        if 0 in leases:
            return leases.index(0)
        raise LeaseError(
            f"the share {self._layout.name!r} already has {PLACES} clients with a lease"
        )

    def _take_axes(self) -> int:
        """Take the axes and return the serial of the new lease. The caller holds the mutex.

        Raises LeaseError if an axis is already leased.
        """
        desk = self._desk
        for axis in self._numbers:
            if holder := desk.holders[axis]:
                place = desk.leases.load_all().index(int(holder))
                left = (desk.deadlines_ns.load(place) - time.monotonic_ns()) * 1e-9
                raise LeaseError(
                    f"axis {self._layout.axes[axis]!r} is leased to {desk.client(place)} for "
                    f"another {max(left, 0.0):.3f} s",
                    hint="wait until that lease is released or expires",
                )
        serial = max(*desk.leases.load_all(), int(desk.places["last"].max())) + 1
        me, entry = this_process(), desk.places[self._place]
        entry["pid"], entry["start_time"] = me.pid, me.start_time
        entry["command"] = me.command.encode()[:64]
        desk.holders[self._numbers] = serial
        desk.deadlines_ns.store(self._place, time.monotonic_ns() + self._for_ns)
        desk.leases.store(self._place, serial)  # publishes the complete lease to the loop
        return serial


@contextmanager
def locked(desk: Desk) -> Iterator[None]:
    """Lock the desk for a block.

    Raises LeaseError if the lock is not free in time, or if the mutex is damaged.
    """
    try:
        taken = desk.mutex.lock(LOCK_TIMEOUT_NS)
    except OSError as error:
        raise LeaseError(f"the mutex of the desk is damaged: {error.strerror}") from error
    if taken is None:
        raise LeaseError(
            f"another client has locked the desk for {LOCK_TIMEOUT_NS * 1e-9:g} s",
            hint="a debugger or SIGSTOP may have stopped that client: continue or end it",
        )
    try:
        yield
    finally:
        desk.mutex.unlock()


def free(desk: Desk, place: int, reason: Reason) -> None:
    """Free a place and its axes. The caller holds the mutex."""
    entry, serial = desk.places[place], desk.leases.load(place)
    entry["reason"] = reason
    entry["last"] = serial
    desk.leases.store(place, 0)  # before the holders: the loop reads the lease after them
    desk.holders[desk.holders == serial] = 0


def axis_numbers(layout: ShareLayout, axes: Sequence[str | int] | None) -> list[int]:
    """Return the indices of axes in the layout; None selects all axes.

    Raises ValueError if an axis is unknown or repeated, or if `axes` is empty or a string.
    """
    if axes is None:
        return list(range(len(layout.axes)))
    if isinstance(axes, str):
        raise ValueError(f"axes must be a list of names, not the string {axes!r}")
    known = {name: number for number, name in enumerate(layout.axes)}
    numbers = []
    for axis in axes:
        number = known.get(axis) if isinstance(axis, str) else axis
        if number is None or not 0 <= number < len(layout.axes):
            existing = ", ".join(map(repr, layout.axes))
            raise ValueError(
                f"the share {layout.name!r} has no axis {axis!r}; its axes are {existing}"
            )
        numbers.append(number)
    if not numbers or len(set(numbers)) != len(numbers):
        raise ValueError(f"axes={list(axes)!r}: pass at least one axis, and each axis only once")
    return numbers


def lease_of(
    desk: Desk, layout: ShareLayout, axes: Sequence[str | int] | None, for_: float
) -> Lease:
    """Take a lease on axes. See `Reader.lease` for the arguments and errors.

    Args:
        desk: desk of the loop.
        layout: layout of the share.
        axes: names or numbers of the axes; None: all axes.
        for_: time until the lease expires, counted from the last renewal [s].
    """
    if not 0 < for_ <= 3600:
        raise ValueError(f"for_={for_} s: must be positive and at most 3600 s")
    return Lease(desk, layout, axis_numbers(layout, axes), for_)
