"""Drives: CiA 402 axes and SERCOS drives of any devices, as one set of arrays in SI units."""

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
from catenary.drive.measuring_move import end_at_edge
from catenary.drive.modules import Modules
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
from catenary.drive.probe import Edge, Probe, Probes
from catenary.drive.probe_port import ProbePort
from catenary.drive.probe_request import check_probe, chosen_axis, probe_request
from catenary.drive.rates import RateColumns
from catenary.drive.request import Request
from catenary.drive.sercos_reset import SercosResets
from catenary.drive.sercos_start_up import with_sercos
from catenary.drive.state_machine import RequestedState
from catenary.drive.touch_probe import (
    FUNCTION_COLUMN,
    SOURCES,
    TouchProbe,
    optional_columns,
    required_columns,
    touch_probe_option,
    with_offered,
)
from catenary.drive.values import Array, AxisValues
from catenary.plan.cycle import Bank, OnLoss
from catenary.plan.request import DeviceRequest, DistributedClock, ImageLayout, RequestTables, Views
from catenary.plan.start_up_object import StartUp
from catenary.plan.stop_reason import StopReason
from catenary.types import INT, UDINT
from catenary.wire.cia402 import IN_FAULT, AxisState

V = TypeVar("V")
Axes: TypeAlias = int | Sequence[int] | slice

STATES = {int(state): state for state in AxisState}
ALL = slice(None)
HOMING_TIMEOUT = 60.0  # [s] default of `loop.wait` for a homing


class Drives(Request):
    """Process-data request for n axes.

    `subs` is a list of SubDevices with all of their axes, or of `(SubDevice, slot)` for single
    axes. A SERCOS drive is an axis, too. Its mode is "csp", "csv" or "cst", and options that need
    CiA 402 are refused (docs/how_to/soe.md).

    Options for all axes:

    - `names`: one name per axis, for errors, events and logs. The default is position, device and
      slot.
    - `other_modes`: modes to which the axes may change while the loop runs ("hm": see `home`).
    - `measured`: which of position, velocity and torque the drives must supply. By default, all
      three are requested. A missing velocity is then estimated, and a missing torque reads NaN.
    - `columns`: additional objects, as names of `NAMED_COLUMNS` or as
      `{name: (index, subindex, type)}`, with the index for slot 0. Read a column as
      `arm.actual["following_error"]`; write it as `arm.target["torque_offset"] = 0.5`. Objects that
      CiA 402 does not define are inputs, except `Channel(index, subindex, type, output=True)`.
    - `touch_probe`: True or a `TouchProbe` to exchange the touch probes (0x60B8): see `probe`.
    - `required`: if False, the loop continues without a lost drive. Its axes keep their last
      values. Enable them again when they are `present`.
    - `divider`: n to exchange in every n-th cycle of the loop.
    - `dc`: distributed clocks. True uses the settings in the ESI or SII of each device. A
      `DistributedClock` applies to all devices.
    - `pdos`: PDOs to assign on each device, `[0x1701, 0x1B01]`, or with their entries (index,
      subindex, bits), `{0x1600: [(0x6040, 0, 16), (0x607A, 0, 32)]}`. They are written even if the
      SII declares them fixed. If a direction has no PDOs in this option, Catenary chooses them.
      Names of PDOs, or the name of a mapping of the ESI file, follow the rules of the file.
    - `start_up`: `StartUp` objects to write to each device before SAFE-OP.
    - `modules`: module of each slot of a modular device, by name, type or ident; None for an empty
      slot. The device must be scanned with its ESI file. By default, the modules that it reports.

    Options with one value for all axes, or a sequence with one value per axis:

    - `mode`: mode at the start: "csp", "csv", "cst", "pp" or "pv".
    - `counts_per_turn`: encoder counts per turn of the motor.
    - `gear_ratio`: motor turns per joint turn.
    - `metres_per_turn` [m]: travel of a linear axis per turn of the gear output. The units of the
      axis are then m, m/s and N instead of rad, rad/s and N·m. None means a rotary axis.
    - `direction`: 1, or -1 if the joint turns opposite to the motor.
    - `offset` [rad]: position of the joint where the drive reads 0.
    - `velocity_unit` [rad/s of the motor]: value of one raw velocity count. The default is one
      position count per second.
    - `rated_torque` [N·m of the motor]: by default, it is read from 0x6076.
    - `homing`: a `HomingMethod`.

    Limits at the joint, which the core enforces. Plausible limits of the drive can only tighten
    them:

    - `position_min`, `position_max` [rad].
    - `velocity_limit` [rad/s]: required for CSV, CST and PV. For CSP and PP, the default is 2π
      rad/s (0.1 m/s), with a warning. `math.inf` means no limit.
    - `torque_limit` [N·m], or `force_limit` [N] for a linear axis.
    - `step_limit` [rad]: largest difference between two CSP set-points. A larger step is refused.
      The default is twice the distance in one exchange at `velocity_limit`, and at least 0.1 rad
      (5 mm). The option is required in CSP if `velocity_limit` is infinite.

    Reactions to a loss of set-points. They do not change the set-points that you write:

    - `deceleration_limit` [rad/s²]: the default is a plausible 0x6085 of the drive, otherwise
      `velocity_limit` / 0.25 s. If `velocity_limit` is infinite and the drive has no plausible
      limit either, the option is required.
    - `acceleration_limit` [rad/s²]: the default is the deceleration. It also limits the moves,
      which use `velocity_limit` / 0.25 s if this option is not given.
    - `torque_slope` [N·m/s]: slope of the torque in CST on the return to the set-points. By
      default, the torque returns at once.
    - `on_loss`: reaction when the core stops an axis: "quick_stop" (default), "disable", or
      "csp_hold" (change to CSP and hold the position). It is required in CST if the quick stop of
      the drive (0x605A) does not brake.

    Before a loop is open, the state of the axes and all requests raise RuntimeError. After the loop
    is closed, requests raise it again.

    Raises:
        TypeError: An option has the wrong type.
        ValueError: An option is not valid, or a required option is missing.
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
        touch_probe: TouchProbe | bool = False,
        required: bool = True,
        divider: int = 1,
        dc: DistributedClock | bool = False,
        pdos: PdoList = (),
        start_up: Sequence[StartUp] = (),
        modules: Modules | None = None,
    ) -> None:
        sources = axis_sources(subs, modules)
        super().__init__([sub for sub, _ in sources])
        self._touch_probe = touch_probe_option(touch_probe)
        self._columns = {**named_columns(columns), **required_columns(self._touch_probe)}
        self._optional = optional_columns(self._touch_probe)
        self._mapped = self._columns  # with those of `_optional` that all drives map
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
            modules=modules,
            optional_columns=self._optional,
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
        self._is_read = False  # True if the settings were read for the next plan
        self._actual = AxisValues("actual")
        self._target = AxisValues("target")
        self._views: Views | None = None
        self._rates: RateColumns | None = None
        self._measures_velocity: list[bool] = []
        self._ports: tuple[AxisPort, ...] = ()
        self._moves: Moves | None = None
        self._probes: Probes | None = None
        self._resets = SercosResets()
        self._units: npt.NDArray[np.intp] = np.zeros(0, np.intp)

    def __len__(self) -> int:
        return len(self._axes)

    def __repr__(self) -> str:
        return f"Drives({', '.join(self.names)})"

    @property
    def actual(self) -> AxisValues:
        """Actual values of the axes at the last `next(loop)`."""
        return self._actual

    @property
    def target(self) -> AxisValues:
        """Targets of the axes. Write into the arrays: `arm.target.position[:] = ...`."""
        return self._target

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each axis, for errors, events and logs."""
        return tuple(axis.name for axis in self._axes)

    @property
    def state(self) -> tuple[AxisState | None, ...]:
        """CiA 402 state of each axis at the last `next(loop)`.

        None if the statusword does not encode a valid state.
        """
        return tuple(STATES.get(value) for value in self._bound().axis_state.tolist())

    @property
    def enabled(self) -> npt.NDArray[np.bool_]:
        """Array (n,) with True for each axis that follows its set-points and is `present`.

        A single lost exchange makes it False for that cycle, although the axis continues to follow
        its set-points. Use `stopped` to react to axes that were stopped.
        """
        return (self._bound().axis_flags & 1).astype(np.bool_) & self.present

    @property
    def jogged(self) -> npt.NDArray[np.bool_]:
        """Array (n,) with True for each axis that an operator moves (`catenary.Share(jog=True)`).

        Such an axis ignores its targets, and is not `enabled`. Its targets follow the commanded
        values. At the end of the jog, it holds until a target is committed for it.
        """
        return self._bound().jogged.astype(np.bool_)

    @property
    def limited(self) -> npt.NDArray[np.bool_]:
        """Array (n,) with True for each axis whose set-points were limited in the last cycle."""
        return (self._bound().axis_flags & 2).astype(np.bool_)

    @property
    def stopped(self) -> tuple[StopReason | None, ...]:
        """For each axis, the reason why the core stopped it; None if it did not.

        The next request for the axis clears the reason.
        """
        reasons = self._bound().stop_reason.tolist()
        return tuple(StopReason(reason) if reason else None for reason in reasons)

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """Array (n,) with True for each axis whose device replied in its last exchange."""
        return self._bound().unit_valid[self._units].astype(np.bool_)

    @property
    def faults(self) -> tuple[int, ...]:
        """Numbers of the axes in fault."""
        states = self._bound().axis_state.tolist()
        return tuple(i for i, state in enumerate(states) if state in IN_FAULT)

    # The next call of `next(loop)` commits these requests together with the targets.

    def enable(self, axes: Axes = ALL) -> None:
        """Request that axes be enabled, after a fault reset if an axis is in fault.

        Each axis starts from its actual position.
        """
        self._request("enable", RequestedState.ENABLED, axes)

    def disable(self, axes: Axes = ALL) -> None:
        """Request that axes be disabled."""
        self._request("disable", RequestedState.DISABLED, axes)

    def quick_stop(self, axes: Axes = ALL) -> None:
        """Request a quick stop. The drive determines the ramp and the final state (0x605A)."""
        self._request("quick_stop", RequestedState.QUICK_STOP, axes)

    def reset_faults(self, axes: Axes = ALL) -> None:
        """Request a fault reset for the axes in fault. They stay disabled until `enable`."""
        chosen = set(self._numbers(axes))
        self._request("reset_faults", RequestedState.RESET, sorted(chosen & set(self.faults)))

    def switch(self, mode: str, axes: Axes = ALL) -> None:
        """Request a change of the mode of operation.

        Until the drive reports the new mode, it continues in the old mode without fresh set-points.
        A halt that a failed move has left set is cleared.

        Args:
            mode: the start mode or one of `other_modes`.
            axes: numbers of the axes.

        Raises:
            ValueError: The mode is unknown, or the axis was made without it.
            IndexError: An axis does not exist.
            RuntimeError: The loop is not open.
        """
        new_mode = mode_of(mode)
        for axis in self._numbers(axes):
            if new_mode not in self._axes[axis].modes:
                raise ValueError(
                    f"{self.names[axis]} was made without mode {mode!r}; add "
                    f"Drives(other_modes=[{mode!r}])"
                )
        views = self._of_open_loop("switch()")
        chosen = self._numbers(axes)
        views.mode_target[chosen] = new_mode
        views.controlword_bits[chosen] &= ~HALT & 0xFFFF

    # Moves: the loop must be iterated, by loop.wait(move) or by a `for` statement.

    def move_to(
        self,
        position: Values,
        *,
        velocity: Values | None = None,
        acceleration: Values | None = None,
        jerk: Values | None = None,
        until: Probe | None = None,
        axes: Axes = ALL,
    ) -> Move:
        """Start to move axes to a position, where they come to rest.

        Each axis moves as fast as its limits allow, so the axes do not arrive together. In CSP, the
        loop computes the motion and writes `target.position`. The velocity profile is a trapezoid,
        or has limited jerk. In PP, the drive computes the motion. If an axis is already moving, the
        new move replaces the present one and continues from its velocity.

        Args:
            position: goal [rad or m]; one value, or one for each of `axes`.
            velocity: largest velocity [rad/s or m/s]; None for `velocity_limit`.
            acceleration: acceleration and deceleration [rad/s² or m/s²]; None for
                `acceleration_limit`, or for `velocity_limit` / 0.25 s if there is no such limit.
            jerk: largest jerk [rad/s³ or m/s³]; None for a trapezoid. Only for CSP. A value needs
                `pip install 'catenary[traj]'`.
            until: probe from `arm.probe`. The move begins when the probe is armed, and stops when
                the probe has captured its edge. If all axes reach their goals without an edge, the
                move fails.
            axes: numbers of the axes.

        Returns:
            Handle of the move: pass it to `loop.wait`, or poll its `done`.

        Raises:
            ValueError: A goal or rate is not valid or beyond a limit, a rate has no default,
                `axes` is empty, the mode is neither CSP nor PP, or `until` has already ended or
                is continuous.
            IndexError: An axis does not exist.
            DriveError: An axis is not enabled, or a law or a stream sets its targets.
            ConfigurationError: `jerk` is given, and ruckig is not installed or finds no motion.
            RuntimeError: The loop is not open.
        """
        chosen = self._movable(axes)
        goals = values_of("position", position, len(chosen))
        return self._move(chosen, goals, RateOptions(velocity, acceleration, jerk), until)

    def move_by(
        self,
        distance: Values,
        *,
        velocity: Values | None = None,
        acceleration: Values | None = None,
        jerk: Values | None = None,
        until: Probe | None = None,
        axes: Axes = ALL,
    ) -> Move:
        """Start to move axes by a distance from the goal of their present move.

        An axis at rest starts from its target.

        Args:
            distance: distance [rad or m]; one value, or one for each of `axes`.
            velocity: largest velocity, as for `move_to`.
            acceleration: acceleration and deceleration, as for `move_to`.
            jerk: largest jerk, as for `move_to`.
            until: probe that stops the move, as for `move_to`.
            axes: numbers of the axes.

        Returns:
            Handle of the move, as for `move_to`.

        Raises:
            ValueError: A goal or rate is not valid or beyond a limit, a rate has no default,
                `axes` is empty, the mode is neither CSP nor PP, or `until` has already ended or
                is continuous.
            IndexError: An axis does not exist.
            DriveError: An axis is not enabled, or a law or a stream sets its targets.
            ConfigurationError: `jerk` is given, and ruckig is not installed or finds no motion.
            RuntimeError: The loop is not open.
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
        return self._move(chosen, goals, RateOptions(velocity, acceleration, jerk), until)

    def home(self, axes: Axes = ALL) -> Move:
        """Start the homing of enabled axes by their drives (mode 6, "hm" in `other_modes`).

        Afterwards, the axes hold their position in their previous mode, and positions count from
        the new zero.

        Returns:
            Handle of the move, as for `move_to`. Its error names an axis that reports a homing
            error or is no longer enabled.

        Raises:
            ValueError: The drives were made without "hm", an axis is already homing, or `axes` is
                empty.
            IndexError: An axis does not exist.
            DriveError: An axis is not enabled, or a law or a stream sets its targets.
            RuntimeError: The loop is not open.
        """
        chosen = self._movable(axes)
        moves = self._moving()
        parts = {i: make_homing_part(self._axes[i], self._ports[i]) for i in chosen}
        return moves.begin(parts, HOMING_TIMEOUT)

    def probe(
        self,
        number: int = 1,
        *,
        edge: Edge = "rising",
        source: str | int = "input",
        continuous: bool = False,
        axis: int | None = None,
    ) -> Probe:
        """Arm a touch probe: the drive stores its position at the next edge.

        The drives must be made with `touch_probe=`. The probe works in any state of the axis. A law
        or a stream cannot start while it is armed.

        Args:
            number: probe of the drive, 1 or 2.
            edge: "rising", "falling" or "both", which captures one edge of each kind.
            source: "input" (that of the probe), "index_pulse" (of the encoder), or a code of the
                manual for 0x60D0, which is written by SDO.
            continuous: True to capture all edges until `stop()` of the handle.
            axis: number of the axis; None for the only one.

        Returns:
            Handle of the probe: pass it to `loop.wait`, or poll its `done` and `events`.

        Raises:
            ValueError: An argument is not valid, the probe is in use, or the position of an edge
                is not in the process data.
            DriveError: A law or a stream sets the outputs.
            RuntimeError: The loop is not open.
        """
        views = self._of_open_loop("probe()")
        index = chosen_axis(axis, self.names)
        request = probe_request(self._touch_probe, number, edge, source, continuous)
        assert self._probes is not None  # bound together with the views
        port = ProbePort(
            self._ports[index],
            index,
            number,
            self.actual.columns,
            self.target[FUNCTION_COLUMN],
            system_time=views.system_time if self._clock is not None else lambda: None,
            write_source=partial(self._write_probe_source, index),
        )
        check_probe(port, request)
        return self._probes.begin(index, Probe(port, request))

    def _write_probe_source(self, index: int, number: int, source: int) -> Pending[None]:
        place = self._axes[index].index(SOURCES)
        return self._subs[index].sdo.request_write(place, number, source, type=INT)

    def _move(
        self,
        chosen: Sequence[int],
        goals: Sequence[float],
        rates: RateOptions,
        until: Probe | None,
    ) -> Move:
        moves = self._moving()
        axes, ports = [self._axes[i] for i in chosen], [self._ports[i] for i in chosen]
        parts, timeout = make_parts(axes, ports, goals, rates)
        if until is not None:
            end_at_edge(parts, until)
        return moves.begin(dict(zip(chosen, parts, strict=True)), timeout)

    def _numbers(self, axes: Axes) -> list[int]:
        """Return the numbers of the chosen axes. Raises IndexError if an axis does not exist."""
        choice = axes if isinstance(axes, slice) else np.asarray(axes)
        if not isinstance(choice, slice) and choice.size == 0:
            return []
        try:
            numbers: list[int] = np.atleast_1d(np.arange(len(self))[choice]).tolist()
        except IndexError:
            known = ", ".join(f"{i}: {name}" for i, name in enumerate(self.names))
            raise IndexError(f"axes={axes!r}: no such axis; the axes are {known}") from None
        return numbers

    def _movable(self, axes: Axes) -> list[int]:
        """Return the numbers of the chosen axes. Raises ValueError if the choice is empty."""
        chosen = self._numbers(axes)
        if not chosen:
            raise ValueError(f"axes={axes!r} selects no axis; give at least one")
        return chosen

    def _moving(self) -> Moves:
        self._of_open_loop("a move")
        assert self._moves is not None  # bound together with the views
        return self._moves

    # plan.request.ProcessDataRequest

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the process-data request of each device, by position.

        The call reads the drives by SDO (PRE-OP or later): rated torque, reactions, limits, mode
        and interpolation time.

        Raises:
            ConfigurationError: A required rated torque or deceleration is unknown, a quick stop in
                CST may not brake, or 0x60C2 cannot represent the period.
            SdoAbort: A drive refuses to read an object that it has.
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
        """Read rated torque and settings once per plan, although the plan calls `pdos` twice."""
        if self._is_read:
            return
        self._axes = with_sercos(self._axes, self.subs, self._period_ns)
        if self._touch_probe is not None:
            pairs = zip(self._axes, self.subs, strict=True)
            self._axes = tuple(with_offered(axis, sub) for axis, sub in pairs)
        rated = [
            own_objects.with_rated_torque(axis, sub)
            for axis, sub in zip(self._axes, self.subs, strict=True)
        ]
        self._axes = own_objects.with_settings(rated, self.subs)
        self._is_read = True

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return the axes and columns for the core.

        The columns of one name are consecutive, one per axis, so that each name is one array. The
        next call of `pdos` reads the drives again.

        Raises:
            MappingError: A required object is not in the process data.
        """
        self._is_read = False  # the next plan reads the settings again
        self._mapped = self._columns | {
            name: column
            for name, column in self._optional.items()
            if all(axis.maps(column, layout) for axis in self._axes)
        }
        self._units = np.array([layout.sync_unit(axis.device) for axis in self._axes], np.intp)
        self._rates = RateColumns(self._axes, self._columns, layout)
        self._measures_velocity = [axis.maps(ACTUAL_VELOCITY, layout) for axis in self._axes]
        return RequestTables(
            axes=tuple(axis.plan(layout) for axis in self._axes),
            output_columns=(
                *(
                    axis.column(name, column, layout)
                    for name, column in self._mapped.items()
                    if column.output
                    for axis in self._axes
                ),
                *self._rates.columns,
            ),
            input_columns=tuple(
                axis.column(name, column, layout)
                for name, column in self._mapped.items()
                if not column.output
                for axis in self._axes
            ),
            axis_reports=tuple(axis.report(self._period_ns) for axis in self._axes),
        )

    def bind(self, views: Views) -> None:
        """Connect the request to the arrays of a newly opened loop, and write the initial rates."""
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
        assert rates is not None  # `tables` runs before `bind`
        rates.bind(self.target, views.output_reals)
        self._moves = Moves(views.movers)
        self._probes = Probes(views.movers)
        self._ports = tuple(
            self._port(views, i, axis, partial(rates.put, i)) for i, axis in enumerate(self._axes)
        )

    def _port(self, views: Views, index: int, axis: Axis, put_rate: PutRate) -> AxisPort:
        """Return the interface of moves to an axis."""
        sdo, period = self._subs[index].sdo, self._period_ns * 1e-9

        def write(place: int, value: int) -> Pending[None]:
            return sdo.request_write(axis.index(place), 0, value, type=UDINT)

        measures_velocity = self._measures_velocity[index]
        facts = AxisFacts(axis.name, axis.units, period, period * axis.divider, measures_velocity)
        return AxisPort(views, index, facts, write=write, put_rate=put_rate)

    def _slices(self, reals: Array, integers: Array, *, output: bool) -> dict[str, Array]:
        """Return, for each column by name, its part of the bank array."""
        used = {Bank.REAL: 0, Bank.INTEGER: 0}
        slices: dict[str, Array] = {}
        for name, column in self._mapped.items():
            if column.output is not output:
                continue
            bank = column_bank(column)
            array = reals if bank is Bank.REAL else integers
            slices[name] = array[used[bank] : used[bank] + len(self)]
            used[bank] += len(self)
        return slices

    def _request(self, call: str, state: RequestedState, axes: Axes) -> None:
        views = self._of_open_loop(f"{call}()")
        chosen = self._numbers(axes)
        if state in (RequestedState.ENABLED, RequestedState.RESET):
            in_fault = set(self.faults).intersection(chosen)
            self._resets.request([(self._subs[k], self._axes[k]) for k in sorted(in_fault)])
        views.requested_state[chosen] = state
        views.request[chosen] += 1  # only a new request clears a stop of the core

    def _of_open_loop(self, call: str) -> Views:
        """Return the views for a request. Raises RuntimeError if the loop is not open."""
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
        idns=first.idns + second.idns,
    )
