"""Log of the values of every axis in every cycle; used by the compiled modules."""

from typing import Final

AXIS_FIELDS: Final[list[tuple[str, str]]]
"""The fields of one axis in a row of the log, without padding. Units: rad, rad/s, N·m."""
