"""Axes and columns: between process images and arrays; owned by Engine."""

from typing import Final

# Bits of axis_flags; bits 6 and 7 hold the goal in force (0 disabled, 1 enabled, 2 quick stop,
# 3 reset).
AXIS_FOLLOWED: Final[int]  # set-points are followed: enabled, in the asked mode, bit 12
AXIS_LIMITED: Final[int]  # the set-point sent last was limited
AXIS_DROPPED: Final[int]  # the goal dropped to disabled by itself since the last request
AXIS_REFUSED: Final[int]  # the committed target was NaN or infinite
AXIS_FALLBACK: Final[int]  # no fresh target: holding (position) or ramping to zero

class Axes:
    """Owns the axis records and column tables."""

    def __init__(self, plan: object) -> None: ...
