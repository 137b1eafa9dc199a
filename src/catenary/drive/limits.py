"""Limits and reactions of an axis, from options, from limits of the drive and from defaults."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from catenary.drive.settings import OwnLimits
from catenary.drive.units import ROTARY, AxisUnits, UnitNames
from catenary.errors import ConfigurationError
from catenary.plan.cycle import AxisLimits, OnLoss
from catenary.wire.cia402 import Mode

BRAKE_TIME = 0.25  # [s] from velocity_limit to standstill, if no deceleration is known
BRAKE_TIMES = (1e-3, 2.5)  # [s] outside this range, 0x6085 probably has another unit
REACTIONS: tuple[OnLoss, ...] = ("quick_stop", "disable", "csp_hold")
POSITIVE = (
    "velocity_limit",
    "torque_limit",
    "acceleration_limit",
    "deceleration_limit",
    "torque_slope",
    "step_limit",
)
NEEDS_VELOCITY = (Mode.CSV, Mode.CST, Mode.PV)
INFINITE = ("velocity_limit", "torque_limit")  # options that may be infinite


@dataclass(frozen=True, slots=True)
class LimitOptions:
    """Options of `Drives` for the limits and reactions of one axis; None if not given.

    The units below are those of a rotary axis. A linear axis has m and N instead.
    """

    position_min: float | None = None  # [rad]
    position_max: float | None = None  # [rad]
    velocity_limit: float | None = None  # [rad/s]
    torque_limit: float | None = None  # [N·m]
    acceleration_limit: float | None = None  # [rad/s²]
    deceleration_limit: float | None = None  # [rad/s²]
    torque_slope: float | None = None  # [N·m/s]
    step_limit: float | None = None  # [rad]
    on_loss: OnLoss | None = None

    def check(self, name: str, modes: Sequence[Mode], units: UnitNames = ROTARY) -> None:
        """Check the options of one axis.

        Args:
            name: name of the axis, for messages.
            modes: modes that the axis may use.
            units: names of its units, for messages.

        Raises:
            ValueError: An option is not valid, or a required option is missing.
        """
        self._check_positions(name, units)
        for option in POSITIVE:
            value = getattr(self, option)
            if value is not None and not value > 0:
                raise ValueError(f"{name}: {_shown(option, units)} must be positive, not {value}")
            if value == math.inf and option not in INFINITE:
                raise ValueError(f"{name}: {_shown(option, units)} must be finite, not {value}")
        if self.on_loss is not None and self.on_loss not in REACTIONS:
            known = ", ".join(map(repr, REACTIONS))
            raise ValueError(f"{name}: unknown on_loss={self.on_loss!r}; use one of {known}")
        unlimited = [mode.name for mode in modes if mode in NEEDS_VELOCITY]
        if self.velocity_limit is None and unlimited:
            raise ValueError(
                f"{name}: velocity_limit= [{units.velocity}] at the joint is required in "
                f"{' and '.join(unlimited)}; write Drives(velocity_limit=...), or math.inf for no "
                "limit"
            )
        if self.velocity_limit == math.inf and Mode.CSP in modes and self.step_limit is None:
            raise ValueError(
                f"{name}: velocity_limit=inf in CSP needs step_limit= [{units.position}], the "
                "largest difference between two set-points; without it, wrong targets are not "
                "detected"
            )

    def _check_positions(self, name: str, units: UnitNames) -> None:
        for option in ("position_min", "position_max"):
            value = getattr(self, option)
            if value is not None and math.isnan(value):
                raise ValueError(
                    f"{name}: {option} must be a number [{units.position}], not {value}"
                )
        low, high = self.position_min, self.position_max
        if low is not None and high is not None and low >= high:
            raise ValueError(f"{name}: position_min {low} must be below position_max {high}")

    def lacks_velocity(self, modes: Sequence[Mode]) -> bool:
        """Return True if an axis in CSP or PP has no `velocity_limit` from the application."""
        return self.velocity_limit is None and not {Mode.CSP, Mode.PP}.isdisjoint(modes)


@dataclass(frozen=True, slots=True)
class Chosen:
    """Limit in force and its source, for the plan report."""

    value: float | None  # None for no limit
    source: str = "none"


@dataclass(frozen=True, slots=True)
class AxisBounds:
    """Limits and reactions in force for one axis, each with its source."""

    position_min: Chosen  # [rad]
    position_max: Chosen  # [rad]
    velocity: Chosen  # [rad/s]
    torque: Chosen  # [N·m]
    step: Chosen  # [rad]; if None, the core computes it from the velocity limit
    acceleration: Chosen  # [rad/s²]
    deceleration: Chosen  # [rad/s²]
    torque_slope: Chosen  # [N·m/s]
    on_loss: OnLoss

    @property
    def limits(self) -> AxisLimits:
        """Limits for the core."""
        return AxisLimits(
            self.position_min.value,
            self.position_max.value,
            self.velocity.value,
            self.torque.value,
            self.step.value,
        )


def make_bounds(
    name: str,
    options: LimitOptions,
    modes: Sequence[Mode],
    own: OwnLimits,
    units: AxisUnits,
) -> AxisBounds:
    """Combine options, limits of the drive and defaults.

    Limits of the drive can only tighten the options.

    Args:
        name: name of the axis, for messages.
        options: options of the application.
        modes: modes that the axis may use.
        own: plausible limits of the drive.
        units: units of the axis, with their defaults.

    Raises:
        ConfigurationError: velocity_limit is infinite and no deceleration is known.
    """
    position_min, position_max = _positions(options, own)
    velocity = _tightest(options.velocity_limit, own.velocity, own.velocity_source, min)
    default = units.defaults.velocity_limit
    if options.lacks_velocity(modes) and not (velocity.value or math.inf) < default:
        velocity = Chosen(default, "default")
    deceleration = _deceleration(name, options, velocity.value, own, units)
    return AxisBounds(
        position_min=position_min,
        position_max=position_max,
        velocity=velocity,
        torque=_tightest(options.torque_limit, own.torque, own.torque_source, min),
        step=_given(options.step_limit),
        acceleration=_given(options.acceleration_limit)
        if options.acceleration_limit is not None
        else Chosen(deceleration.value, "as the deceleration"),
        deceleration=deceleration,
        torque_slope=_given(options.torque_slope),
        on_loss=options.on_loss or "quick_stop",
    )


def _shown(option: str, units: UnitNames) -> str:
    """Return the name of an option for the application (force_limit for a linear axis)."""
    return units.torque_limit if option == "torque_limit" else option


def _given(value: float | None) -> Chosen:
    return Chosen(None) if value is None else Chosen(value, "option")


def _tightest(
    option: float | None, own: float | None, source: str, pick: Callable[[float, float], float]
) -> Chosen:
    """Return the tighter of an option and a limit of the drive. Infinity sets no limit."""
    if option is not None and not math.isfinite(option):
        option = None
    if own is None or (option is not None and pick(option, own) == option):
        return _given(option)
    return Chosen(own, source)


def _positions(options: LimitOptions, own: OwnLimits) -> tuple[Chosen, Chosen]:
    """Return the tighter position limits.

    Limits of the drive are ignored if they contradict the options.
    """
    low = _tightest(options.position_min, own.position_min, own.position_source, max)
    high = _tightest(options.position_max, own.position_max, own.position_source, min)
    if low.value is None or high.value is None or low.value < high.value:
        return low, high
    contradicted = f"option; {own.position_source} contradicts it"
    return Chosen(options.position_min, contradicted), Chosen(options.position_max, contradicted)


def _deceleration(
    name: str, options: LimitOptions, velocity: float | None, own: OwnLimits, units: AxisUnits
) -> Chosen:
    """Return the deceleration from the option, from a plausible 0x6085, or from BRAKE_TIME.

    Without any velocity limit, return the default, or raise ConfigurationError if `velocity_limit`
    is infinite.
    """
    if options.deceleration_limit is not None:
        return _given(options.deceleration_limit)
    if own.deceleration is not None and _is_plausible(own.deceleration, velocity):
        return Chosen(own.deceleration, "0x6085 of the drive")
    if velocity is not None:
        return Chosen(velocity / BRAKE_TIME, f"default, velocity limit / {BRAKE_TIME:g} s")
    if options.velocity_limit is None:
        return Chosen(units.defaults.deceleration, "default")
    raise ConfigurationError(
        f"{name}: velocity_limit is infinite, and the drive has no plausible deceleration (0x6085)",
        hint=f"write Drives(deceleration_limit=...) in {units.names.acceleration} at the joint",
    )


def _is_plausible(deceleration: float, velocity: float | None) -> bool:
    if velocity is None:
        return True
    return BRAKE_TIMES[0] <= velocity / deceleration <= BRAKE_TIMES[1]
