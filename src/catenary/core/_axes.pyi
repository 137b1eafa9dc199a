"""Axes and columns: conversion between process images and arrays. Owned by Engine."""

from typing import Final

# Bits of axis_flags; bits 6 and 7 hold the requested state in force (0 disabled, 1 enabled,
# 2 quick stop, 3 reset).
AXIS_FOLLOWED: Final[int]  # set-points are followed: enabled, requested mode in force, bit 12
AXIS_LIMITED: Final[int]  # the last set-point sent was limited
AXIS_DROPPED: Final[int]  # the core stopped the axis since the last request
AXIS_REFUSED: Final[int]  # the target was NaN, infinite or beyond the step limit
AXIS_FALLBACK: Final[int]  # no valid set-point, or the command is returning to the set-points
AXIS_MODE_REFUSED: Final[int]  # the drive did not show the last requested mode

class Axes:
    """Owner of the axis records and column tables."""

    def __init__(self, plan: object) -> None: ...
