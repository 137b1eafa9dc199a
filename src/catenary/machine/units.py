"""Conversion of physical quantities from text, such as "170 deg" or "500 us", to SI units.

A value that is a number, not text, is already in SI units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Final, Literal

Dimension = Literal[
    "time", "position", "velocity", "acceleration", "torque", "torque slope", "length", "force"
]

_TURN = 2.0 * math.pi
_DEGREE = math.pi / 180.0

# Units by physical quantity; the first one is the SI unit.
UNITS: Final[Mapping[str, Mapping[str, float]]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": _DEGREE, "turn": _TURN},
    "angular velocity": {
        **{"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": _DEGREE},
        **{"turn/s": _TURN, "rpm": _TURN / 60.0},
    },
    "angular acceleration": {"rad/s2": 1.0, "deg/s2": _DEGREE, "turn/s2": _TURN},
    "torque": {"N·m": 1.0, "mN·m": 1e-3, "kN·m": 1e3},
    "torque slope": {"N·m/s": 1.0},
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "cm": 1e-2},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0},
    "acceleration": {"m/s2": 1.0, "mm/s2": 1e-3},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "force slope": {"N/s": 1.0},
}
# Physical quantity of an option, for a rotary axis and for a linear axis.
QUANTITIES: Final[Mapping[Dimension, tuple[str, str]]] = {
    "time": ("time", "time"),
    "position": ("angle", "length"),
    "velocity": ("angular velocity", "velocity"),
    "acceleration": ("angular acceleration", "acceleration"),
    "torque": ("torque", "force"),
    "torque slope": ("torque slope", "force slope"),
    "length": ("length", "length"),
    "force": ("force", "force"),
}
_CHARACTERS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "*": "·", "°": "deg"})
SPELLINGS: Final[Mapping[str, str]] = {  # other spellings of a unit
    **{"rev": "turn", "sec": "s", "min-1": "rpm", "1/min": "rpm", "rev/s": "turn/s"},
    **{"Nm": "N·m", "mNm": "mN·m", "kNm": "kN·m", "Nm/s": "N·m/s"},
}
_TEXT = re.compile(r"\s*([-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf)\s*(.*?)\s*")


def to_si(value: float | str, dimension: Dimension, *, linear: bool = False) -> float:
    """Return a quantity in SI units.

    Args:
        value: number in SI units, or text with a unit, such as "90 deg/s".
        dimension: dimension of the option.
        linear: True for a linear axis, whose positions are lengths and whose torques are forces.

    Raises:
        ValueError: The value is not a quantity of this dimension. The message lists its units.
    """
    quantity = QUANTITIES[dimension][linear]
    if not isinstance(value, str):
        if math.isnan(value):
            raise ValueError(f"nan is not a number; expected {described(quantity)}")
        return float(value)
    found = _TEXT.fullmatch(value)
    if found is None:
        raise ValueError(f"{value!r} is not a number with a unit; expected {described(quantity)}")
    number, unit = float(found[1]), found[2]
    if not unit:
        raise ValueError(
            f"{value!r} has no unit; expected {described(quantity)}, or the number without quotes"
        )
    return number * _factor(value, unit, quantity)


def described(quantity: str) -> str:
    """Return a physical quantity with its units, such as "a time (s, ms, us, ns, min)"."""
    return f"{_article(quantity)} ({', '.join(UNITS[quantity])})"


def _usual(unit: str) -> str:
    plain = unit.translate(_CHARACTERS).replace("^2", "2")
    return SPELLINGS.get(plain, plain)


def _factor(value: str, unit: str, expected: str) -> float:
    factor = UNITS[expected].get(_usual(unit))
    if factor is not None:
        return factor
    for quantity, units in UNITS.items():
        if _usual(unit) in units:
            raise ValueError(f"{value!r} is {_article(quantity)}; expected {described(expected)}")
    near = get_close_matches(_usual(unit), UNITS[expected], n=1)
    guess = f"did you mean {near[0]!r}? Expected" if near else "expected"
    raise ValueError(f"{value!r}: unknown unit {unit!r}; {guess} {described(expected)}")


def _article(quantity: str) -> str:
    return f"{'an' if quantity[0] in 'aeiou' else 'a'} {quantity}"
