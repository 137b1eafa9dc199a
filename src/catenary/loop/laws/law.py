"""`@cat.law`: a control law, plain Python here, compiled on the robot."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import TypeAlias

from catenary.errors import LawError

LawFunction: TypeAlias = Callable[..., object]  # of the arguments that it names

ARGUMENTS = ("actual", "target", "memory", "time", "parameters", "enabled", "dt", "ok", "n")
"""What a law may ask for, by name."""


class Law:
    """A function of the arguments it names, called once a cycle between the inputs and the outputs:

    `actual`: n, ok, dt [s], and per axis position [rad], velocity [rad/s], torque [N·m], enabled;
    `target`: position, velocity, torque per axis, to be written. Both: columns by name
    (`actual["following_error"][i]`, `target["Output 1"] = 1`), or as the arrays reals, integers and
    bits. `memory`: float64, the law's own, kept from cycle to cycle; `parameters`: float64, changed
    by the application while it runs; `time` [s] since its first cycle; `enabled`, `dt`, `ok`, `n`:
    as in `actual`. The axes are those of all Drives of the loop, in their order.

    It returns True (or a number other than 0) when it has finished, else False, 0 or nothing.
    Calling it is calling the function: as Python, with all of Python's errors.
    """

    def __init__(self, function: LawFunction) -> None:
        self.function = function
        functools.update_wrapper(self, function)
        self.arguments = arguments_of(function)

    def __call__(self, *arguments: object, **named: object) -> object:
        return self.function(*arguments, **named)

    def __repr__(self) -> str:
        return f"<law {self}>"

    def __str__(self) -> str:
        return getattr(self.function, "__name__", "law")


def law(function: LawFunction) -> Law:
    """Makes a control law of a function: see `Law`. `loop.run(pd, memory=[...])` runs it."""
    return function if isinstance(function, Law) else Law(function)


def arguments_of(function: LawFunction) -> tuple[str, ...]:
    """The names the function asks for. TypeError: no function; LawError: a name no law has."""
    if not inspect.isfunction(function):
        raise TypeError(f"a law is made of a plain function, not of {function!r}")
    parameters = inspect.signature(function).parameters.values()
    for parameter in parameters:
        if parameter.name not in ARGUMENTS or parameter.kind is not parameter.POSITIONAL_OR_KEYWORD:
            raise LawError(
                f"law {function.__name__}: a law has no argument {str(parameter)!r}",
                hint=f"name those it needs, of {', '.join(ARGUMENTS)}",
            )
    return tuple(parameter.name for parameter in parameters)
