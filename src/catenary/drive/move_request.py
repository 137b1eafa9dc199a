"""Requests of `move_to` and `move_by`, with all checks before the motion starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from catenary.drive.axis import Axis
from catenary.drive.homing import home_axis, stop_homing
from catenary.drive.limits import BRAKE_TIME
from catenary.drive.motions import (
    first_motion,
    move_cyclic,
    move_profile,
    stop_cyclic,
    stop_profile,
)
from catenary.drive.move import Part
from catenary.drive.port import AxisPort
from catenary.drive.profile import Motion, Rates, load_ruckig, make_profile, make_stop
from catenary.errors import DriveError
from catenary.wire.cia402 import Mode

Values: TypeAlias = float | Sequence[float] | npt.NDArray[np.float64]

SLACK = 1e-9  # relative tolerance of a limit, for rounding errors
WAIT_TIMEOUT = (2.0, 10.0)  # default: factor of the expected duration, and additional seconds


@dataclass(frozen=True, slots=True)
class RateOptions:
    """Options of a move: one value, or one per moving axis; None for the default of each axis."""

    velocity: Values | None = None
    acceleration: Values | None = None
    jerk: Values | None = None


def values_of(name: str, value: Values, count: int) -> list[float]:
    """Return one finite number per axis.

    Args:
        name: name of the option, for messages.
        value: one number, or one per axis.
        count: number of axes.

    Raises:
        ValueError: The number of values is wrong, or a value is not finite.
    """
    row = np.asarray(value, dtype=np.float64)
    if row.ndim == 0:
        row = np.full(count, float(row))
    if row.shape != (count,):
        raise ValueError(
            f"{name}={value!r}: give one number, or {count} numbers, one per moving axis"
        )
    if not np.isfinite(row).all():
        raise ValueError(f"{name}={value!r} must be finite")
    return [float(each) for each in row]


def make_parts(
    axes: Sequence[Axis], ports: Sequence[AxisPort], goals: Sequence[float], options: RateOptions
) -> tuple[list[Part], float]:
    """Check a move and make the motion of each axis.

    Args:
        axes: axes that move.
        ports: interface to each axis.
        goals: goal of each axis.
        options: rates of the move.

    Returns:
        Motion of each axis, and the default timeout of a wait [s].

    Raises:
        ValueError: A goal or rate is not valid or beyond a limit, a rate has no default, a jerk is
            given in PP, or the mode is neither CSP nor PP.
        DriveError: An axis is not enabled, or a law or a stream sets its targets.
        ConfigurationError: The jerk is limited, and ruckig is not installed or finds no motion.
    """
    if options.jerk is not None:
        load_ruckig()
    rates = _rates(axes, options)
    parts = [
        _part(axis, port, goal, rate)
        for axis, port, goal, rate in zip(axes, ports, goals, rates, strict=True)
    ]
    longest = max(
        make_profile(Motion(port.position), goal, rate._replace(jerk=None)).duration
        for port, goal, rate in zip(ports, goals, rates, strict=True)
    )
    return parts, WAIT_TIMEOUT[0] * longest + WAIT_TIMEOUT[1]


def make_homing_part(axis: Axis, port: AxisPort) -> Part:
    """Check a homing and make the motion of its axis.

    Args:
        axis: axis to home.
        port: interface to the axis.

    Raises:
        ValueError: The axis was made without "hm", or is already homing.
        DriveError: The axis is not enabled, or a law or a stream sets its targets.
    """
    if Mode.HM not in axis.modes:
        raise ValueError(f"{axis.name} was made without mode 'hm'; add Drives(other_modes=['hm'])")
    before = port.requested_mode
    if before == Mode.HM:
        raise ValueError(f"{axis.name} is already homing; wait for the end, or use move.stop()")
    require_enabled(port)
    return Part(port, math.nan, home_axis(port, before), lambda: stop_homing(port, before))


def require_enabled(port: AxisPort) -> None:
    """Raise DriveError if an axis does not follow its targets, or if a law or stream sets them."""
    if port.is_led:
        raise DriveError(
            f"{port.name} cannot move: a law or a stream sets its targets",
            hint="end it first: stop() of the run that loop.start() returned, or stream.close()",
        )
    if port.jogged:
        raise DriveError(
            f"{port.name} cannot move: an operator jogs the axis",
            hint="wait until Drives.jogged is False for the axis",
        )
    if not port.followed or port.stop_cause() is not None:
        raise DriveError(
            f"{port.name} cannot move: it is not enabled ({port.state_text()})",
            hint="call arm.enable(), then iterate the loop until arm.enabled.all()",
        )


def default_acceleration(axis: Axis) -> float | None:
    """Return `acceleration_limit`, or else the velocity limit / 0.25 s; None without both."""
    if axis.options.acceleration_limit is not None:
        return axis.options.acceleration_limit
    velocity = default_velocity(axis)
    return None if velocity is None else velocity / BRAKE_TIME


def default_velocity(axis: Axis) -> float | None:
    """Return the velocity limit; None if there is none, or if the application gave `math.inf`."""
    return None if axis.options.velocity_limit == math.inf else axis.bounds.velocity.value


def _part(axis: Axis, port: AxisPort, goal: float, rates: Rates) -> Part:
    mode = port.requested_mode
    if mode not in (Mode.CSP, Mode.PP):
        raise ValueError(
            f"{axis.name} is in mode {Mode(mode).name.lower()}, but a move needs csp or pp; use "
            'Drives(mode="csp"), or call arm.switch("csp") first'
        )
    require_enabled(port)
    _check_goal(axis, goal)
    if mode == Mode.PP:
        if rates.jerk is not None:
            raise ValueError(
                f"{axis.name}: jerk= is not possible in mode pp, where the drive computes the "
                "motion (0x6081, 0x6083, 0x6084); omit jerk=, or use mode csp"
            )
        steps = move_profile(port, goal, rates)
        return Part(port, goal, steps, lambda: stop_profile(port), mode=mode)
    _check_rest(axis, port, rates)
    steps = move_cyclic(port, goal, rates)
    return Part(port, goal, steps, lambda: stop_cyclic(port, rates), mode=mode)


def _check_goal(axis: Axis, goal: float) -> None:
    beyond = _beyond(axis, goal)
    if beyond is not None:
        raise ValueError(f"{axis.name}: goal {goal:.6g} {axis.units.names.position} is {beyond}")


def _check_rest(axis: Axis, port: AxisPort, rates: Rates) -> None:
    """Raise ValueError if a moving axis cannot stop before a position limit."""
    motion = first_motion(port)
    rest = make_stop(motion, rates).goal
    beyond = _beyond(axis, rest)
    if beyond is not None and (rest - motion.position) * motion.velocity > 0:
        names = axis.units.names
        raise ValueError(
            f"{axis.name}: with acceleration {rates.acceleration:.6g} {names.acceleration}, the "
            f"axis stops from {motion.velocity:.4g} {names.velocity} at {rest:.6g} "
            f"{names.position}, {beyond}; use a larger acceleration"
        )


def _beyond(axis: Axis, position: float) -> str | None:
    """Return the position limit that a position exceeds, as text; None if it exceeds neither."""
    bounds, unit = axis.bounds, axis.units.names.position
    for name, limit, sign in (
        ("position_min", bounds.position_min.value, -1.0),
        ("position_max", bounds.position_max.value, 1.0),
    ):
        if limit is not None and sign * (position - limit) > SLACK * max(1.0, abs(limit)):
            return f"beyond {name} {limit:.6g} {unit}"
    return None


def _rates(axes: Sequence[Axis], options: RateOptions) -> list[Rates]:
    columns: dict[str, list[float | None]] = {}
    for name in ("velocity", "acceleration", "jerk"):
        value: Values | None = getattr(options, name)
        count = len(axes)
        columns[name] = [None] * count if value is None else list(values_of(name, value, count))
    return [
        Rates(
            _rate(axis, "velocity", velocity, default_velocity(axis)),
            _rate(axis, "acceleration", acceleration, default_acceleration(axis)),
            None if jerk is None else _positive(axis, "jerk", jerk),
        )
        for axis, velocity, acceleration, jerk in zip(axes, *columns.values(), strict=True)
    ]


def _rate(axis: Axis, name: str, value: float | None, known: float | None) -> float:
    """Return a rate after a check of its range; the default if it is not given.

    Raises:
        ValueError: The rate is not positive or above its limit, or there is no default.
    """
    unit = getattr(axis.units.names, name)
    if value is None:
        if known is None:
            raise ValueError(
                f"{axis.name}: the move has no {name}; give {name}= [{unit}], or "
                f"Drives({name}_limit=...)"
            )
        return known
    limit = axis.bounds.velocity.value if name == "velocity" else axis.options.acceleration_limit
    if limit is not None and value > limit * (1 + SLACK):
        raise ValueError(
            f"{axis.name}: {name} {value:.6g} {unit} is above {name}_limit {limit:.6g} {unit}"
        )
    return _positive(axis, name, value)


def _positive(axis: Axis, name: str, value: float) -> float:
    if not 0 < value < math.inf:
        raise ValueError(f"{axis.name}: {name} must be positive, not {value}")
    return value
