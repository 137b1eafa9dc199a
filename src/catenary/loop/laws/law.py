"""Control laws: Python functions marked with `@cat.law`, compiled before their first use."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import TypeAlias

from catenary.errors import LawError

LawFunction: TypeAlias = Callable[..., object]  # its arguments are among ARGUMENTS

ARGUMENTS = ("actual", "target", "memory", "time", "parameters", "enabled", "dt", "ok", "n")
"""Names of the arguments that a law may have."""


class Law:
    """Control law: a function that runs once per cycle, between the inputs and the outputs.

    The function names the arguments that it needs:

        actual: n, ok, dt [s], and per axis position [rad], velocity [rad/s], torque [N·m], enabled.
        target: position, velocity and torque per axis, which the law writes.
        memory: State of the law, float64. It is kept from cycle to cycle.
        parameters: Values from the application, float64. They may change while the law runs.
        time: Time since the first cycle of the law [s].
        enabled, dt, ok, n: The same as in `actual`.

    `actual` and `target` also have columns by name (`actual["following_error"][i]`,
    `target["Output 1"] = 1`), or all columns as the arrays reals, integers and bits. The axes are
    those of all Drives of the loop, in order.

    The law returns True or another non-zero integer when it has finished, otherwise False, 0 or
    None. A direct call of a Law runs the function as Python, with Python's errors.
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
    """Make a control law from a function: see `Law`. Run it with `loop.run(pd, memory=[...])`.

    A Law is returned unchanged.

    Raises:
        TypeError: The object is not a plain function.
        LawError: An argument of the function is not one of those of `Law`.
    """
    return function if isinstance(function, Law) else Law(function)


def arguments_of(function: LawFunction) -> tuple[str, ...]:
    """Return the names of the function's arguments.

    Raises:
        TypeError: The object is not a plain function.
        LawError: The name of an argument is not in `ARGUMENTS`, or the argument is not an ordinary
            positional one.
    """
    if not inspect.isfunction(function):
        raise TypeError(f"a law must be a plain function, not {function!r}")
    parameters = inspect.signature(function).parameters.values()
    for parameter in parameters:
        if parameter.name not in ARGUMENTS or parameter.kind is not parameter.POSITIONAL_OR_KEYWORD:
            raise LawError(
                f"law {function.__name__}: invalid argument {str(parameter)!r}",
                hint=f"use only arguments named {', '.join(ARGUMENTS)}",
            )
    return tuple(parameter.name for parameter in parameters)
