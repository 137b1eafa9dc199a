"""Drives: n CiA 402 axes over any mix of devices and slots, as one set of arrays in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from catenary.drive import start_up
from catenary.drive.arguments import (
    AxisSource,
    axis_limits,
    axis_modes,
    axis_name,
    axis_sources,
    clock_wish,
    cycles_between,
    known,
    mode_of,
    named_columns,
)
from catenary.drive.axis import MEASURED, Axis, column_bank
from catenary.drive.homing import HomingMethod, Timed, run_homing
from catenary.drive.objects import AxisObject
from catenary.drive.state_machine import Goal
from catenary.drive.units import AxisUnits, one_each, per_axis
from catenary.drive.values import Array, AxisValues
from catenary.plan.cycle import Bank
from catenary.plan.wish import DC, ImageLayout, PdoWish, Views, WishTables
from catenary.wire.cia402 import IN_FAULT, Mode, State

V = TypeVar("V")
PerAxis: TypeAlias = V | Sequence[V]
Axes: TypeAlias = int | Sequence[int] | slice

STATES = {int(state): state for state in State}
ALL = slice(None)


class Drives:
    """A wish for n axes.

    `subs`: SubDevices with all of their axes, or `(SubDevice, slot)` for single ones.
    `mode`: "csp", "csv" or "cst", one for all or one for each; `other_modes` may be switched to
    while the loop runs ("hm" too: `home`). Every further option is one value for all axes, or one
    for each:

    `counts_per_turn` of the motor's encoder; `gear_ratio` motor turns per joint turn; `direction`
    1 or -1; `offset` [rad] of the joint where the drive says 0; `velocity_unit` [rad/s of the
    motor] of one raw velocity count (None: one position count per second); `rated_torque` [N·m]
    (None: read from 0x6076).
    Limits at the joint, enforced by the core whatever is written: `position_min`, `position_max`
    [rad], `velocity_limit` [rad/s], `torque_limit` [N·m].

    `measured`: which of position, velocity and torque the drives must give; None: all three, where
    a drive cannot give velocity or torque it reads NaN (velocity: estimated). `columns`: further
    objects, by a name of `NAMED_COLUMNS` or as `(name, AxisObject)`:
    `arm.actual["following_error"]`.

    `required=False`: the loop goes on without a drive that vanishes; what is not `present` holds
    its last values and follows nothing, and must be enabled again when it is back. `every`: the
    drives are exchanged every so many cycles of the loop.

    `homing`: a `HomingMethod`, how the drive finds its home.

    `dc`: distributed clocks; True: as each device's SII says, or a `DC` for all of them.
    """

    def __init__(
        self,
        subs: Iterable[AxisSource],
        *,
        counts_per_turn: PerAxis[float],
        mode: PerAxis[str] = "csp",
        other_modes: Sequence[str] = (),
        gear_ratio: PerAxis[float] = 1.0,
        direction: PerAxis[int] = 1,
        offset: PerAxis[float] = 0.0,
        velocity_unit: PerAxis[float | None] = None,
        rated_torque: PerAxis[float | None] = None,
        position_min: PerAxis[float | None] = None,
        position_max: PerAxis[float | None] = None,
        velocity_limit: PerAxis[float | None] = None,
        torque_limit: PerAxis[float | None] = None,
        homing: PerAxis[HomingMethod | None] = None,
        measured: Sequence[str] | None = None,
        columns: Sequence[str | tuple[str, AxisObject]] = (),
        required: bool = True,
        every: int = 1,
        dc: DC | bool = False,
    ) -> None:
        sources = axis_sources(subs)
        n = len(sources)
        units = map(
            AxisUnits,
            per_axis("counts_per_turn", counts_per_turn, n),
            per_axis("gear_ratio", gear_ratio, n),
            per_axis("direction", direction, n),
            per_axis("offset", offset, n),
            per_axis("velocity_unit", velocity_unit, n),
            per_axis("rated_torque", rated_torque, n),
        )
        limits = map(
            axis_limits,
            per_axis("position_min", position_min, n),
            per_axis("position_max", position_max, n),
            per_axis("velocity_limit", velocity_limit, n),
            per_axis("torque_limit", torque_limit, n),
        )
        first_modes = (mode,) * n if isinstance(mode, str) else one_each("mode", mode, n)
        self.subs = tuple(sub for sub, _ in sources)
        self._columns = named_columns(columns)
        self._clock = clock_wish(dc)
        self._axes = tuple(
            Axis(
                name=axis_name(sub, slot),
                device=sub.position,
                slot=slot,
                modes=axis_modes(first, other_modes),
                units=unit,
                limits=limit,
                measured=known(tuple(MEASURED) if measured is None else measured),
                measured_required=measured is not None,
                columns=self._columns,
                every=cycles_between("every", every),
                required=required,
                homing=home,
            )
            for (sub, slot), first, unit, limit, home in zip(
                sources,
                first_modes,
                units,
                limits,
                per_axis("homing", homing, n),
                strict=True,
            )
        )
        self.actual = AxisValues("actual")
        self.target = AxisValues("target")
        self._views: Views | None = None
        self._units: npt.NDArray[np.intp] = np.zeros(0, np.intp)

    def __len__(self) -> int:
        return len(self._axes)

    def __repr__(self) -> str:
        return f"Drives({', '.join(self.names)})"

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(axis.name for axis in self._axes)

    @property
    def state(self) -> tuple[State | None, ...]:
        """The CiA 402 state of every axis, as of the last `next(loop)`; None: its statusword codes
        none."""
        return tuple(STATES.get(value) for value in self._bound().axis_state.tolist())

    @property
    def enabled(self) -> npt.NDArray[np.bool_]:
        """(n,) which axes follow their set-points now."""
        return (self._bound().axis_flags & 1).astype(np.bool_)

    @property
    def limited(self) -> npt.NDArray[np.bool_]:
        """(n,) whose set-points the core had to limit in the last cycle."""
        return (self._bound().axis_flags & 2).astype(np.bool_)

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """(n,) whose devices answered in their last exchange."""
        return self._bound().unit_valid[self._units].astype(np.bool_)

    @property
    def faults(self) -> tuple[int, ...]:
        """The numbers of the axes that are in fault."""
        states = self._bound().axis_state.tolist()
        return tuple(i for i, state in enumerate(states) if state in IN_FAULT)

    # What follows is committed with the targets, by the next `next(loop)`.

    def enable(self, axes: Axes = ALL) -> None:
        """Asks for axes to be enabled; each starts from where it stands."""
        self._ask(Goal.ENABLED, axes)

    def disable(self, axes: Axes = ALL) -> None:
        """Asks for axes to be switched off."""
        self._ask(Goal.DISABLED, axes)

    def quick_stop(self, axes: Axes = ALL) -> None:
        """Asks for axes to brake as their 0x605A says; they stay still until enabled again."""
        self._ask(Goal.QUICK_STOP, axes)

    def reset_faults(self, axes: Axes = ALL) -> None:
        """Asks those axes that are in fault to forget it; nothing moves before `enable`."""
        chosen = set(np.atleast_1d(np.arange(len(self))[axes]).tolist())
        self._ask(Goal.RESET, sorted(chosen & set(self.faults)))

    def switch(self, mode: str, axes: Axes = ALL) -> None:
        """Asks axes to change to `mode`, one of those the Drives were made with."""
        wanted = mode_of(mode)
        for axis in np.atleast_1d(np.arange(len(self))[axes]).tolist():
            if wanted not in self._axes[axis].modes:
                raise ValueError(f"{self.names[axis]}: make Drives with other_modes=[{mode!r}]")
        self._bound().mode_target[axes] = wanted

    def home(self, loop: Iterable[Timed], axes: Axes = ALL, *, timeout: float = 30.0) -> None:
        """Lets enabled axes find their homes themselves (mode 6, "hm" in `other_modes`), and waits,
        iterating `loop`; then they hold, in the mode they had, positions counted from the new zero.

        DriveError names an axis that reports an error, drops out, or is not home within `timeout`
        [s]; the search is over then. ValueError: made without "hm".
        """
        chosen = np.atleast_1d(np.arange(len(self))[axes])
        for axis in chosen.tolist():
            if Mode.HM not in self._axes[axis].modes:
                raise ValueError(f"{self.names[axis]}: make Drives with other_modes=['hm']")
        run_homing(self._bound(), self.names, loop, chosen, timeout)

    # plan.wish.Wish

    def pdos(self, period_ns: int) -> Mapping[int, PdoWish]:
        """The objects wished for, by device position. Reads 0x6076 and 0x60C2 of the drives
        (PRE-OP or later): what the start-up list and the torque scale need."""
        self._axes = tuple(
            start_up.with_rated_torque(axis, sub)
            for axis, sub in zip(self._axes, self.subs, strict=True)
        )
        wishes: dict[int, PdoWish] = {}
        for axis, sub in zip(self._axes, self.subs, strict=True):
            wish = axis.pdo_wish(start_up.downloads(axis, sub, period_ns * axis.every))
            wishes[axis.device] = (
                joined(wishes[axis.device], wish) if axis.device in wishes else wish
            )
            wishes[axis.device] = replace(wishes[axis.device], clock=self._clock)
        return wishes

    def tables(self, layout: ImageLayout) -> WishTables:
        """Axes in their order; columns by name, then by axis, so that a name is one array."""
        self._units = np.array([layout.sync_unit(axis.device) for axis in self._axes], np.intp)
        return WishTables(
            axes=tuple(axis.plan(layout) for axis in self._axes),
            output_columns=tuple(
                axis.column(name, layout)
                for name, wanted in self._columns.items()
                if wanted.output
                for axis in self._axes
            ),
            input_columns=tuple(
                axis.column(name, layout)
                for name, wanted in self._columns.items()
                if not wanted.output
                for axis in self._axes
            ),
        )

    def bind(self, views: Views) -> None:
        """Receives the arrays of the loop that opens."""
        self._views = views
        self.actual.bind(
            views.actual_position,
            views.actual_velocity,
            views.actual_torque,
            views.mode_actual,
            self._slices(views.input_reals, views.input_integers, output=False),
        )
        self.target.bind(
            views.target_position,
            views.target_velocity,
            views.target_torque,
            views.mode_target,
            self._slices(views.output_reals, views.output_integers, output=True),
        )

    def _slices(self, reals: Array, integers: Array, *, output: bool) -> dict[str, Array]:
        """Each column's part of its bank's array."""
        used = {Bank.REAL: 0, Bank.INTEGER: 0}
        slices: dict[str, Array] = {}
        for name, wanted in self._columns.items():
            if wanted.output is not output:
                continue
            bank = column_bank(wanted)
            array = reals if bank is Bank.REAL else integers
            slices[name] = array[used[bank] : used[bank] + len(self)]
            used[bank] += len(self)
        return slices

    def _ask(self, goal: Goal, axes: Axes) -> None:
        views = self._bound()
        views.goal[axes] = goal
        views.request[axes] += 1  # a goal that dropped comes back only by a new request

    def _bound(self) -> Views:
        if self._views is None:
            raise RuntimeError("the drives have no values before a Loop is open")
        return self._views


def joined(first: PdoWish, second: PdoWish) -> PdoWish:
    """The wishes of two axes of one device."""
    return replace(
        first,
        outputs=first.outputs + second.outputs,
        inputs=first.inputs + second.inputs,
        start_up=first.start_up + second.start_up,
    )
