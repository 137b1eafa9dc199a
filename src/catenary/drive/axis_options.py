"""Keywords of `Drives` as values, and the axes made from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias, TypeVar

from catenary.bus import SubDevice
from catenary.drive.arguments import (
    PdoList,
    axis_modes,
    axis_names,
    cycles_between,
    force_and_torque,
    known,
    start_up_list,
    written_pdos,
)
from catenary.drive.axis import MEASURED, Axis
from catenary.drive.homing import HomingMethod
from catenary.drive.limits import LimitOptions
from catenary.drive.modules import Modules, chosen_modules, described
from catenary.drive.objects import AxisObject
from catenary.drive.units import AxisUnits, per_axis
from catenary.plan.cycle import OnLoss
from catenary.plan.request import WrittenPdo
from catenary.plan.start_up_object import StartUp

V = TypeVar("V")
PerAxis: TypeAlias = V | Sequence[V]

UNITS = tuple(field.name for field in fields(AxisUnits))
LIMITS = tuple(field.name for field in fields(LimitOptions))


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisOptions:
    """Options of `Drives` with one value for all axes, or a sequence with one per axis."""

    mode: PerAxis[str]
    counts_per_turn: PerAxis[float]
    gear_ratio: PerAxis[float]
    direction: PerAxis[int]
    offset: PerAxis[float]
    velocity_unit: PerAxis[float | None]
    rated_torque: PerAxis[float | None]
    metres_per_turn: PerAxis[float | None]
    position_min: PerAxis[float | None]
    position_max: PerAxis[float | None]
    velocity_limit: PerAxis[float | None]
    torque_limit: PerAxis[float | None]
    force_limit: PerAxis[float | None]
    step_limit: PerAxis[float | None]
    acceleration_limit: PerAxis[float | None]
    deceleration_limit: PerAxis[float | None]
    torque_slope: PerAxis[float | None]
    on_loss: PerAxis[OnLoss | None]
    homing: PerAxis[HomingMethod | None]

    def each(self, name: str, n: int) -> tuple[Any, ...]:
        """Return an option of each of n axes. Raises ValueError for a wrong number of values."""
        return per_axis(name, getattr(self, name), n)

    def units(self, n: int) -> list[AxisUnits]:
        """Return the scales of n axes. Raises ValueError if an option is not valid."""
        rows = zip(*(self.each(name, n) for name in UNITS), strict=True)
        return [AxisUnits(**dict(zip(UNITS, row, strict=True))) for row in rows]

    def limits(self, n: int) -> list[LimitOptions]:
        """Return the limits of n axes. The force limit of a linear axis is in `torque_limit`.

        Raises:
            ValueError: The number of values is wrong, or a force or torque limit does not fit the
                axis.
        """
        columns = {name: self.each(name, n) for name in LIMITS}
        columns["torque_limit"] = force_and_torque(
            self.each("force_limit", n), columns["torque_limit"], self.each("metres_per_turn", n)
        )
        rows = zip(*columns.values(), strict=True)
        return [LimitOptions(**dict(zip(columns, row, strict=True))) for row in rows]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonOptions:
    """Options of `Drives` that all axes share."""

    names: Sequence[str] | None
    other_modes: Sequence[str]
    measured: Sequence[str] | None
    columns: Mapping[str, AxisObject]
    required: bool
    divider: int
    pdos: PdoList
    start_up: Sequence[StartUp]
    modules: Modules | None = None
    optional_columns: Mapping[str, AxisObject] = field(default_factory=dict)


def _pdos(sub: SubDevice, common: CommonOptions) -> tuple[WrittenPdo, ...]:
    """Return the PDOs of the option `pdos` for one device, whose PDOs may have other names."""
    if not common.pdos:
        return ()
    device = described(sub, chosen_modules(sub, common.modules))
    return written_pdos(common.pdos, common.columns, device)


def make_axes(
    sources: Sequence[tuple[SubDevice, int]], options: AxisOptions, common: CommonOptions
) -> tuple[Axis, ...]:
    """Return the axes of `Drives`.

    Args:
        sources: Device and slot of each axis.
        options: Options with one value per axis.
        common: Options that all axes share.

    Raises:
        ConfigurationError: A slot does not accept a module.
        TypeError: The option `pdos`, `modules` or `start_up` has the wrong type.
        ValueError: An option is not valid, or a required one is missing.
    """
    n = len(sources)
    units, limits = options.units(n), options.limits(n)
    names = axis_names(sources, common.names)
    measured = known(tuple(MEASURED) if common.measured is None else common.measured)
    axes = tuple(
        Axis(
            name=names[k],
            device=sub.position,
            slot=slot,
            modes=axis_modes(options.each("mode", n)[k], common.other_modes),
            units=units[k],
            options=limits[k],
            measured=measured,
            measured_required=common.measured is not None,
            columns=common.columns,
            optional_columns=common.optional_columns,
            divider=cycles_between("divider", common.divider),
            required=common.required,
            homing=options.each("homing", n)[k],
            pdos=_pdos(sub, common),
            objects=start_up_list(common.start_up),
            modules=chosen_modules(sub, common.modules),
        )
        for k, (sub, slot) in enumerate(sources)
    )
    for axis in axes:
        axis.options.check(axis.name, axis.modes, axis.units.names)
    return axes
