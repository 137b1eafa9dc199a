"""Text that describes the limits and reactions of an axis, for `print(loop.plan)`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.drive.limits import AxisBounds, Chosen
from catenary.drive.units import AxisUnits, UnitNames
from catenary.plan.axis_report import AxisReport
from catenary.wire.cia402 import Mode

STEP_SHARE = 2.0  # default step limit, as a factor of the distance at the velocity limit


def axis_report(
    name: str,
    modes: Sequence[Mode],
    bounds: AxisBounds,
    reactions: Sequence[str],
    exchange_ns: int,
    units: AxisUnits,
) -> AxisReport:
    """Return the description of one axis.

    Args:
        name: name of the axis.
        modes: modes that the axis may use; the first one is the mode at the start.
        bounds: limits in force.
        reactions: lines of text about the reactions of the drive.
        exchange_ns: time between two exchanges of the device [ns].
        units: units of the axis.
    """
    lines = (
        *_limits(bounds, units.names),
        *_fallback(modes, bounds, exchange_ns, units),
        *reactions,
    )
    return AxisReport(name, tuple(map(int, modes)), lines)


def _limits(bounds: AxisBounds, names: UnitNames) -> Iterator[str]:
    yield (
        f"limits: position from {_shown(bounds.position_min, names.position)} "
        f"to {_shown(bounds.position_max, names.position)}"
    )
    yield f"limits: velocity {_shown(bounds.velocity, names.velocity)}"
    quantity = "torque" if names.torque_limit == "torque_limit" else "force"
    yield f"limits: {quantity} {_shown(bounds.torque, names.torque)}"


def _fallback(
    modes: Sequence[Mode], bounds: AxisBounds, exchange_ns: int, units: AxisUnits
) -> Iterator[str]:
    names = units.names
    if Mode.CSP in modes:
        yield f"step limit {_shown(_step(bounds, exchange_ns, units), names.position)}"
    yield (
        f"fallback: deceleration {_shown(bounds.deceleration, names.acceleration)}, "
        f"acceleration {_shown(bounds.acceleration, names.acceleration)}"
    )
    if Mode.CST in modes:
        yield f"fallback: torque slope {_shown(bounds.torque_slope, names.torque_slope)}"
    yield f"on_loss: {bounds.on_loss}"


def _step(bounds: AxisBounds, exchange_ns: int, units: AxisUnits) -> Chosen:
    """Return the step limit between the set-points of two consecutive exchanges."""
    if bounds.step.value is not None or bounds.velocity.value is None:
        return bounds.step
    step = max(units.defaults.step_limit, STEP_SHARE * bounds.velocity.value * exchange_ns * 1e-9)
    return Chosen(step, "default")


def _shown(chosen: Chosen, unit: str) -> str:
    return "none" if chosen.value is None else f"{chosen.value:.4g} {unit} ({chosen.source})"
