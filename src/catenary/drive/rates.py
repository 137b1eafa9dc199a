"""Profile rates and torque limit in the process data, as columns whose initial values are limits.

A rate that is mapped without a request is also written, since a drive with a rate of 0 would not
move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from catenary.drive.axis import Axis
from catenary.drive.move_request import default_acceleration
from catenary.drive.objects import MAX_TORQUE, PROFILE_OBJECTS, AxisObject
from catenary.drive.values import AxisValues
from catenary.plan.cycle import Column
from catenary.plan.request import ImageLayout, Reals

PRESET = {**PROFILE_OBJECTS, "max_torque": MAX_TORQUE}


class RateColumns:
    """Owner of the columns of rates.

    Some are columns that the application requested; additional columns follow these.
    """

    def __init__(
        self, axes: Sequence[Axis], columns: Mapping[str, AxisObject], layout: ImageLayout
    ) -> None:
        taken = {(column.index, column.subindex) for column in columns.values()}
        self._axes = tuple(axes)
        self._named = {name for name, known in PRESET.items() if columns.get(name) == known}
        self._mapped = tuple(
            (name, i)
            for name, rate in PROFILE_OBJECTS.items()
            if (rate.index, rate.subindex) not in taken
            for i, axis in enumerate(axes)
            if axis.uses_profile and axis.maps(rate, layout)
        )
        self.columns: tuple[Column, ...] = tuple(
            axes[i].column(name, PROFILE_OBJECTS[name], layout) for name, i in self._mapped
        )

    def bind(self, target: AxisValues, reals: Reals) -> None:
        """Connect the columns to the arrays of a new loop, and write the initial values.

        Args:
            target: columns by name.
            reals: all real output columns.
        """
        self._target = target
        self._rates = reals[len(reals) - len(self._mapped) :]
        for index, axis in enumerate(self._axes):
            self._preset(index, axis)

    def put(self, axis: int, name: str, value: float) -> bool:
        """Write a rate of an axis.

        Args:
            axis: number of the axis.
            name: name of the rate, such as "profile_velocity".
            value: rate in the units of the axis.

        Returns:
            False if the rate is not in the process data.
        """
        if name in self._named:
            self._target[name][axis] = value
        elif (name, axis) in self._mapped:
            self._rates[self._mapped.index((name, axis))] = value
        else:
            return False
        return True

    def _preset(self, index: int, axis: Axis) -> None:
        bounds = axis.bounds
        fastest = 2**31 * abs(axis.units.velocity_scale)
        acceleration = default_acceleration(axis) or bounds.acceleration.value
        self.put(index, "profile_velocity", bounds.velocity.value or fastest)
        self.put(index, "profile_acceleration", acceleration or fastest)
        self.put(index, "profile_deceleration", acceleration or fastest)
        if "max_torque" in self._named:
            rated = 1000 * abs(axis.units.torque_scale)
            self.put(index, "max_torque", bounds.torque.value or rated)
