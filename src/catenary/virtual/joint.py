"""Joint of a plant, and the motor that drives it."""

from __future__ import annotations

import math
from typing import Literal

import msgspec


class Joint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Joint of the model, and the motor that drives it.

    Motor angle [rad] = direction · gear · (joint position - zero).

    The brake closes `brake_delay` [s] after the drive removes the torque. It opens when the drive
    enters operation enabled. Without power it is closed.

    Attributes:
        name: Name of the joint in the model.
        gear: Gear ratio, motor angle per joint angle. For a slide joint, the unit is [rad/m].
        direction: 1 or -1.
        zero: Joint position at which the motor angle is 0 [rad or m].
        start: Initial position of the joint [rad or m]; None: the position in the model.
        brake: Holding torque of the brake at the joint [N·m]. 0: no brake. None: the maximum
            torque of the motor at the joint.
        brake_delay: Closing time of the brake [s].
        axis: (position of the servo, axis number); None: the next axis on the line.
    """

    name: str
    gear: float = 1.0
    direction: Literal[1, -1] = 1
    zero: float = 0.0
    start: float | None = None
    brake: float | None = None
    brake_delay: float = 0.0
    axis: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        if not 0 < self.gear < math.inf:
            raise ValueError(f"joint {self.name!r}: gear must be positive, not {self.gear}")
        if self.direction not in (1, -1):
            raise ValueError(
                f"joint {self.name!r}: direction must be 1 or -1, not {self.direction}"
            )
        if not math.isfinite(self.zero) or not math.isfinite(self.start or 0.0):
            raise ValueError(
                f"joint {self.name!r}: zero and start must be finite, "
                f"not {self.zero} and {self.start}"
            )
        if self.brake is not None and not 0 <= self.brake < math.inf:
            raise ValueError(f"joint {self.name!r}: brake must be at least 0 N·m, not {self.brake}")
        if not 0 <= self.brake_delay <= 10:
            raise ValueError(
                f"joint {self.name!r}: brake_delay must be 0 to 10 s, not {self.brake_delay}"
            )

    @property
    def ratio(self) -> float:
        return self.direction * self.gear
