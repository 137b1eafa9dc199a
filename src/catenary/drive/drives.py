"""Drives: n CiA 402 axes over any mix of devices and slots, as one set of arrays in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from catenary.bus import Pending
from catenary.drive import start_up as own_objects
from catenary.drive.arguments import (
    AxisSource,
    Columns,
    PdoList,
    axis_sources,
    clock_request,
    mode_of,
    named_columns,
    warn_of_default_velocity,
)
from catenary.drive.axis import Axis, column_bank
from catenary.drive.axis_options import AxisOptions, CommonOptions, PerAxis, make_axes
from catenary.drive.homing import HomingMethod
from catenary.drive.motions import HALT
from catenary.drive.move import Move, Moves
from catenary.drive.move_request import (
    RateOptions,
    Values,
    make_homing_part,
    make_parts,
    values_of,
)
from catenary.drive.objects import ACTUAL_VELOCITY
from catenary.drive.port import AxisFacts, AxisPort, PutRate
from catenary.drive.rates import RateColumns
from catenary.drive.request import Request
from catenary.drive.state_machine import RequestedState
from catenary.drive.values import Array, AxisValues
from catenary.plan.cycle import Bank, OnLoss
from catenary.plan.request import DeviceRequest, DistributedClock, ImageLayout, RequestTables, Views
from catenary.plan.start_up_object import StartUp
from catenary.plan.stop_reason import StopReason
from catenary.types import UDINT
from catenary.wire.cia402 import IN_FAULT, AxisState

V = TypeVar("V")
Axes: TypeAlias = int | Sequence[int] | slice

STATES = {int(state): state for state in AxisState}
ALL = slice(None)
HOMING_PATIENCE = 60.0  # [s] default timeout of a wait


class Drives(Request):
    """Process-data request for n axes.

    `subs`: SubDevices with all of their axes, or `(SubDevice, slot)` for single axes.

    Options for all axes:

    - `names`: one per axis, for errors, events and logs. None: position, device and slot.
    - `other_modes`: modes that the axes may change to while the loop runs ("hm": see `home`).
    - `measured`: position, velocity, torque that the drives must supply. None: all three; a
      velocity that the drive lacks is estimated, a torque reads NaN.
    - `columns`: further objects: names of `NAMED_COLUMNS`, or `{name: (index, subindex, type)}` as
      for `ProcessData`; the index is that of slot 0. Read them as `arm.actual["following_error"]`,
      write them as `arm.target["torque_offset"] = 0.5`. Objects that CiA 402 does not define are
      read; to write one, give `Channel(index, subindex, type, output=True)`.
    - `required`: False: the loop continues without a lost drive. Its axes hold their last values;
      enable them again when it is `present`.
    - `divider`: cycles of the loop between two exchanges.
    - `dc`: distributed clocks. True: as each device's SII states; or a `DistributedClock` for all
      of them.
    - `pdos`: PDOs of each device, instead of a search: `[0x1701, 0x1B01]`, or with their entries
      `{0x1600: [(0x6040, 0, 16), (0x607A, 0, 32)]}` (index, subindex, bits). They are written even
      if the SII says that this is impossible. A direction without PDOs here is searched.
    - `start_up`: `StartUp` objects that are written to each device before SAFE-OP.

    Options with one value for all axes, or a sequence of one per axis:

    - `mode`: "csp", "csv", "cst", "pp" or "pv" at the start.
    - `counts_per_turn`: counts of the motor's encoder per turn.
    - `gear_ratio`: motor turns per joint turn.
    - `metres_per_turn` [m]: travel of a linear axis per turn of the gear's output side. The axis
      then has m, m/s and N where rad, rad/s and N·m are stated here. None: a rotary axis.
    - `direction`: 1, or -1 if the joint turns against the motor.
    - `offset` [rad]: position of the joint where the drive reads 0.
    - `velocity_unit` [rad/s of the motor]: one raw velocity count. None: one position count per s.
    - `rated_torque` [N·m of the motor]. None: read from 0x6076.
    - `homing`: a `HomingMethod`.

    Limits at the joint. The core enforces them; plausible limits of the drive only tighten them:

    - `position_min`, `position_max` [rad].
    - `velocity_limit` [rad/s]: required for CSV, CST and PV. CSP and PP without it: 2π rad/s
      (0.1 m/s) and a warning. `math.inf`: none.
    - `torque_limit` [N·m]; `force_limit` [N] of a linear axis.
    - `step_limit` [rad]: largest difference between two CSP set-points; a larger one is refused.
      None: max(0.1 rad (5 mm), twice the way at `velocity_limit`). Required if `velocity_limit`
      is infinite.

    Fallback and return after a loss of set-points; they never shape your set-points:

    - `deceleration_limit` [rad/s²]. None: a plausible 0x6085 of the drive, else
      `velocity_limit` / 0.25 s.
    - `acceleration_limit` [rad/s²]. None: the deceleration. It limits moves, too; their default is
      this option, else `velocity_limit` / 0.25 s.
    - `torque_slope` [N·m/s] in CST. None: at once.
    - `on_loss`: reaction when the core stops an axis: "quick_stop" (None), "disable", or
      "csp_hold" (change to CSP and hold). Required in CST if the drive's quick stop (0x605A) does
      not brake.

    Raises:
        ValueError: An option is impossible, or a required one is missing.
    """

    def __init__(
        self,
        subs: Iterable[AxisSource],
        *,
        counts_per_turn: PerAxis[float],
        names: Sequence[str] | None = None,
        mode: PerAxis[str] = "csp",
        other_modes: Sequence[str] = (),
        gear_ratio: PerAxis[float] = 1.0,
        direction: PerAxis[int] = 1,
        offset: PerAxis[float] = 0.0,
        velocity_unit: PerAxis[float | None] = None,
        rated_torque: PerAxis[float | None] = None,
        metres_per_turn: PerAxis[float | None] = None,
        position_min: PerAxis[float | None] = None,
        position_max: PerAxis[float | None] = None,
        velocity_limit: PerAxis[float | None] = None,
        torque_limit: PerAxis[float | None] = None,
        force_limit: PerAxis[float | None] = None,
        step_limit: PerAxis[float | None] = None,
        acceleration_limit: PerAxis[float | None] = None,
        deceleration_limit: PerAxis[float | None] = None,
        torque_slope: PerAxis[float | None] = None,
        on_loss: PerAxis[OnLoss | None] = None,
        homing: PerAxis[HomingMethod | None] = None,
        measured: Sequence[str] | None = None,
        columns: Columns = (),
        required: bool = True,
        divider: int = 1,
        dc: DistributedClock | bool = False,
        pdos: PdoList = (),
        start_up: Sequence[StartUp] = (),
    ) -> None:
        sources = axis_sources(subs)
        super().__init__([sub for sub, _ in sources])
        self._columns = named_columns(columns)
        self._clock = clock_request(dc)
        common = CommonOptions(
            names=names,
            other_modes=other_modes,
            measured=measured,
            columns=self._columns,
            required=required,
            divider=divider,
            pdos=pdos,
            start_up=start_up,
        )
        options = AxisOptions(
            mode=mode,
            counts_per_turn=counts_per_turn,
            gear_ratio=gear_ratio,
            direction=direction,
            offset=offset,
            velocity_unit=velocity_unit,
            rated_torque=rated_torque,
            metres_per_turn=metres_per_turn,
            position_min=position_min,
            position_max=position_max,
            velocity_limit=velocity_limit,
            torque_limit=torque_limit,
            force_limit=force_limit,
            step_limit=step_limit,
            acceleration_limit=acceleration_limit,
            deceleration_limit=deceleration_limit,
            torque_slope=torque_slope,
            on_loss=on_loss,
            homing=homing,
        )
        self._axes = make_axes(sources, options, common)
        warn_of_default_velocity(self._axes)
        self._period_ns = 0
        self._is_read = False  # settings of the drives, since the last plan
        self._actual = AxisValues("actual")
        self._target = AxisValues("target")
        self._views: Views | None = None
        self._rates: RateColumns | None = None
        self._measures_velocity: list[bool] = []
        self._ports: tuple[AxisPort, ...] = ()
        self._moves: Moves | None = None
        self._units: npt.NDArray[np.intp] = np.zeros(0, np.intp)

    def __len__(self) -> int:
        return len(self._axes)

    def __repr__(self) -> str:
        return f"Drives({', '.join(self.names)})"

    @property
    def actual(self) -> AxisValues:
        """Actual values of the axes, as of the last `next(loop)`."""
        return self._actual

    @property
    def target(self) -> AxisValues:
        """Targets of the axes: write into the arrays, `arm.target.position[:] = ...`."""
        return self._target

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each axis: in errors, events and logs."""
        return tuple(axis.name for axis in self._axes)

    @property
    def state(self) -> tuple[AxisState | None, ...]:
        """The CiA 402 state of every axis, as of the last `next(loop)`; None: its statusword codes
        none."""
        return tuple(STATES.get(value) for value in self._bound().axis_state.tolist())

    @property
    def enabled(self) -> npt.NDArray[np.bool_]:
        """(n,) True for each axis that follows its set-points now and is `present`.

        One lost exchange makes it False for that cycle, because `present` includes it. The axis
        goes on following; to act on stopped axes, use `stopped`.
        """
        return (self._bound().axis_flags & 1).astype(np.bool_) & self.present

    @property
    def limited(self) -> npt.NDArray[np.bool_]:
        """(n,) True for each axis whose set-points the core limited in the last cycle."""
        return (self._bound().axis_flags & 2).astype(np.bool_)

    @property
    def stopped(self) -> tuple[StopReason | None, ...]:
        """Reason of each axis that the core stopped, until your next request; else None."""
        reasons = self._bound().stop_reason.tolist()
        return tuple(StopReason(reason) if reason else None for reason in reasons)

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """(n,) True for each axis whose device answered in its last exchange."""
        return self._bound().unit_valid[self._units].astype(np.bool_)

    @property
    def faults(self) -> tuple[int, ...]:
        """Numbers of the axes in fault."""
        states = self._bound().axis_state.tolist()
        return tuple(i for i, state in enumerate(states) if state in IN_FAULT)

    # The next `next(loop)` commits the following requests together with the targets.

    def enable(self, axes: Axes = ALL) -> None:
        """Request that axes be enabled. Each starts from its actual position."""
        self._request("enable", RequestedState.ENABLED, axes)

    def disable(self, axes: Axes = ALL) -> None:
        """Request that axes be disabled."""
        self._request("disable", RequestedState.DISABLED, axes)

    def quick_stop(self, axes: Axes = ALL) -> None:
        """Request a quick stop. The ramp and the final state are the drive's (0x605A)."""
        self._request("quick_stop", RequestedState.QUICK_STOP, axes)

    def reset_faults(self, axes: Axes = ALL) -> None:
        """Request a fault reset of those axes that are in fault. Nothing moves before `enable`."""
        chosen = set(self._numbers(axes))
        self._request("reset_faults", RequestedState.RESET, sorted(chosen & set(self.faults)))

    def switch(self, mode: str, axes: Axes = ALL) -> None:
        """Request a change to `mode`, one of those that the Drives were made with.

        Until the drive shows the new mode, the old one continues without fresh set-points.
        """
        wanted = mode_of(mode)
        for axis in self._numbers(axes):
            if wanted not in self._axes[axis].modes:
                raise ValueError(f"{self.names[axis]}: make Drives with other_modes=[{mode!r}]")
        views = self._of_open_loop("switch()")
        chosen = self._numbers(axes)
        views.mode_target[chosen] = wanted
        views.controlword_bits[chosen] &= ~HALT & 0xFFFF

    # Moves: iterate the loop meanwhile, by loop.wait(move) or by your own `for`.

    def move_to(
        self,
        position: Values,
        *,
        velocity: Values | None = None,
        acceleration: Values | None = None,
        jerk: Values | None = None,
        axes: Axes = ALL,
    ) -> Move:
        """Start to move axes to a position, each as fast as the limits allow; they rest there.

        In CSP the loop computes the motion and writes `target.position` of these axes: a trapezoid
        of the velocity, or with limited jerk. In PP the drive computes it. A move replaces the
        present move of an axis, and continues from its velocity. The axes do not arrive together.

        Args:
            position: Goal, one or one for each of `axes` [rad], [m].
            velocity: Largest velocity [rad/s], [m/s]; None: `velocity_limit`.
            acceleration: Acceleration and deceleration [rad/s²], [m/s²]; None:
                `acceleration_limit`, else `velocity_limit` / 0.25 s.
            jerk: Largest jerk [rad/s³], [m/s³]; None: a trapezoid. Needs
                `pip install 'catenary[traj]'`.
            axes: Numbers of the axes.

        Returns:
            A handle for `loop.wait`, or to poll its `done`.

        Raises:
            ValueError: A goal or rate is beyond a limit, or the mode is neither CSP nor PP.
            DriveError: An axis is not enabled.
            ConfigurationError: `jerk` is given and ruckig is not installed.
        """
        chosen = self._movable(axes)
        goals = values_of("position", position, len(chosen))
        return self._move(chosen, goals, RateOptions(velocity, acceleration, jerk))

    def move_by(
        self,
        distance: Values,
        *,
        velocity: Values | None = None,
        acceleration: Values | None = None,
        jerk: Values | None = None,
        axes: Axes = ALL,
    ) -> Move:
        """Start to move axes by a distance from their goals, or from their targets at rest.

        Args:
            distance: Distance, one or one for each of `axes` [rad], [m].
            velocity: Largest velocity: see `move_to`.
            acceleration: Acceleration and deceleration: see `move_to`.
            jerk: Largest jerk: see `move_to`.
            axes: Numbers of the axes.

        Returns:
            A handle, and errors, as of `move_to`.
        """
        chosen = self._movable(axes)
        moves = self._moving()
        starts = [moves.goal(axis) for axis in chosen]
        goals = [
            step + (self._ports[axis].rest if start is None else start)
            for axis, start, step in zip(
                chosen, starts, values_of("distance", distance, len(chosen)), strict=True
            )
        ]
        return self._move(chosen, goals, RateOptions(velocity, acceleration, jerk))

    def home(self, axes: Axes = ALL) -> Move:
        """Let enabled axes find their homes by themselves (mode 6, "hm" in `other_modes`).

        Afterwards they hold in their former mode, with positions counted from the new zero.

        Returns:
            A handle, as of `move_to`. Its error names an axis that reports a homing error or is
            no longer enabled.

        Raises:
            ValueError: The drives were made without "hm", or an axis is homing already.
            DriveError: An axis is not enabled.
        """
        chosen = self._movable(axes)
        moves = self._moving()
        parts = {i: make_homing_part(self._axes[i], self._ports[i]) for i in chosen}
        return moves.begin(parts, HOMING_PATIENCE)

    def _move(self, chosen: Sequence[int], goals: Sequence[float], rates: RateOptions) -> Move:
        moves = self._moving()
        axes, ports = [self._axes[i] for i in chosen], [self._ports[i] for i in chosen]
        parts, patience = make_parts(axes, ports, goals, rates)
        return moves.begin(dict(zip(chosen, parts, strict=True)), patience)

    def _numbers(self, axes: Axes) -> list[int]:
        """Return the numbers of chosen axes. IndexError for a number without an axis."""
        wanted = axes if isinstance(axes, slice) else np.asarray(axes)
        if not isinstance(wanted, slice) and wanted.size == 0:
            return []
        try:
            numbers: list[int] = np.atleast_1d(np.arange(len(self))[wanted]).tolist()
        except IndexError:
            known = ", ".join(f"{i}: {name}" for i, name in enumerate(self.names))
            raise IndexError(f"axes={axes!r}: give numbers of the axes: {known}") from None
        return numbers

    def _movable(self, axes: Axes) -> list[int]:
        """Return the numbers of chosen axes. ValueError if the choice is empty."""
        chosen = self._numbers(axes)
        if not chosen:
            raise ValueError(f"axes={axes!r}: no axis to move")
        return chosen

    def _moving(self) -> Moves:
        self._of_open_loop("a move")
        assert self._moves is not None  # bound together with the views
        return self._moves

    # plan.request.ProcessDataRequest

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the process-data request of each device, by position.

        Reads the drives by SDO (PRE-OP or later): rated torque, reactions, limits, mode and
        interpolation time.
        """
        self._period_ns = period_ns
        self._read_drives()
        requests: dict[int, DeviceRequest] = {}
        for axis, sub in zip(self._axes, self.subs, strict=True):
            request = axis.device_request(
                own_objects.downloads(axis, sub, period_ns * axis.divider)
            )
            requests[axis.device] = (
                joined(requests[axis.device], request) if axis.device in requests else request
            )
            requests[axis.device] = replace(requests[axis.device], clock=self._clock)
        return requests

    def _read_drives(self) -> None:
        """Read rated torque and settings once per plan: `pdos` is called twice for each."""
        if self._is_read:
            return
        rated = [
            own_objects.with_rated_torque(axis, sub)
            for axis, sub in zip(self._axes, self.subs, strict=True)
        ]
        self._axes = own_objects.with_settings(rated, self.subs)
        self._is_read = True

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return the axes in their order; columns by name, then by axis: a name is one array."""
        self._is_read = False  # the next plan reads the settings again
        self._units = np.array([layout.sync_unit(axis.device) for axis in self._axes], np.intp)
        self._rates = RateColumns(self._axes, self._columns, layout)
        self._measures_velocity = [axis.maps(ACTUAL_VELOCITY, layout) for axis in self._axes]
        return RequestTables(
            axes=tuple(axis.plan(layout) for axis in self._axes),
            output_columns=(
                *(
                    axis.column(name, wanted, layout)
                    for name, wanted in self._columns.items()
                    if wanted.output
                    for axis in self._axes
                ),
                *self._rates.columns,
            ),
            input_columns=tuple(
                axis.column(name, wanted, layout)
                for name, wanted in self._columns.items()
                if not wanted.output
                for axis in self._axes
            ),
            axis_reports=tuple(axis.report(self._period_ns) for axis in self._axes),
        )

    def bind(self, views: Views) -> None:
        """Receive the arrays of the loop that opens."""
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
        rates = self._rates
        assert rates is not None  # the tables are made before they are bound
        rates.bind(self.target, views.output_reals)
        self._moves = Moves(views.movers)
        self._ports = tuple(
            self._port(views, i, axis, partial(rates.put, i)) for i, axis in enumerate(self._axes)
        )

    def _port(self, views: Views, index: int, axis: Axis, put_rate: PutRate) -> AxisPort:
        """Return the interface of an axis that moves use."""
        sdo, period = self._subs[index].sdo, self._period_ns * 1e-9

        def write(place: int, value: int) -> Pending[None]:
            return sdo.request_write(axis.index(place), 0, value, type=UDINT)

        measures_velocity = self._measures_velocity[index]
        facts = AxisFacts(axis.name, axis.units, period, period * axis.divider, measures_velocity)
        return AxisPort(views, index, facts, write=write, put_rate=put_rate)

    def _slices(self, reals: Array, integers: Array, *, output: bool) -> dict[str, Array]:
        """Return each column's part of its bank's array."""
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

    def _request(self, call: str, state: RequestedState, axes: Axes) -> None:
        views = self._of_open_loop(f"{call}()")
        chosen = self._numbers(axes)
        views.requested_state[chosen] = state
        views.request[chosen] += 1  # a dropped requested state returns only by a new request

    def _of_open_loop(self, call: str) -> Views:
        """Return the views for a request; RuntimeError if no cycle would send it."""
        views = self._bound()
        if not views.is_open():
            raise RuntimeError(
                f"{call}: the loop is closed, and its drives were stopped; open a loop first"
            )
        return views

    def _bound(self) -> Views:
        if self._views is None:
            raise RuntimeError("the drives have no values before a Loop is open")
        return self._views


def joined(first: DeviceRequest, second: DeviceRequest) -> DeviceRequest:
    """Return the combined requests of two axes of one device."""
    return replace(
        first,
        outputs=first.outputs + second.outputs,
        inputs=first.inputs + second.inputs,
        start_up=first.start_up + second.start_up,
    )
