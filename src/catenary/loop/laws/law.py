"""Control laws: Python functions marked with `@cat.law`, compiled before their first use."""

from __future__ import annotations

import functools
import inspect
import math
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TypeAlias, overload

from catenary.errors import LawError

LawFunction: TypeAlias = Callable[..., object]  # its arguments are among ARGUMENTS
Laws: TypeAlias = "Sequence[Law | LawFunction] | Sequence[Sequence[Law | LawFunction]]"

ARGUMENTS = ("actual", "target", "memory", "time", "parameters", "enabled", "dt", "ok", "n")
"""Names of the arguments that a law may have."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """Name of a parameter of a law, and the values that an operator may set.

    Args:
        name: Name, such as "stiffness".
        minimum: Smallest value.
        maximum: Largest value.
        unit: Unit of the value, such as "N·m/rad".

    Raises:
        ValueError: The name is empty, or `minimum` is not below `maximum`.
    """

    name: str
    minimum: float = -math.inf
    maximum: float = math.inf
    unit: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("the name of a parameter is empty")
        if not self.minimum < self.maximum:
            raise ValueError(
                f"parameter {self.name!r}: minimum {self.minimum} is not below {self.maximum}"
            )


@dataclass(frozen=True, slots=True)
class CompiledLaw:
    """Machine code of a law. Keep the object while the address is in use."""

    address: int
    code: object


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

    def __init__(self, function: LawFunction, parameters: Sequence[Parameter | str] = ()) -> None:
        self.function = function
        functools.update_wrapper(self, function)
        self.arguments = arguments_of(function)
        self.parameters = named_parameters(parameters)
        self.compiled: dict[Hashable, CompiledLaw] = {}  # by layout and dependencies

    def __call__(self, *arguments: object, **named: object) -> object:
        return self.function(*arguments, **named)

    def __repr__(self) -> str:
        return f"<law {self}>"

    def __str__(self) -> str:
        return getattr(self.function, "__name__", "law")


@overload
def law(function: LawFunction) -> Law: ...


@overload
def law(*, parameters: Sequence[Parameter | str]) -> Callable[[LawFunction], Law]: ...


def law(
    function: LawFunction | None = None, *, parameters: Sequence[Parameter | str] = ()
) -> Law | Callable[[LawFunction], Law]:
    """Make a control law from a function: see `Law`. Run it with `loop.run(pd, memory=[...])`.

        @cat.law(parameters=[cat.Parameter("stiffness", 0, 40, "N·m/rad"), "damping"])
        def pd(actual, target, memory, parameters): ...

    A Law is returned unchanged.

    Args:
        function: Function to use.
        parameters: Names of the values in `parameters`, in their order. Other programs show and
            set them by name, for example the operator's page.

    Raises:
        TypeError: The object is not a plain function.
        ValueError: A name is used twice.
        LawError: An argument of the function is not one of those of `Law`.
    """
    if function is None:
        return functools.partial(Law, parameters=parameters)
    return function if isinstance(function, Law) else Law(function)


def laws_of_networks(laws: Laws, count: int) -> list[list[Law]]:
    """Return the laws of every network.

    Args:
        laws: Laws for all networks, or one list of laws for each network.
        count: Number of networks.

    Raises:
        TypeError: A law is not a plain function, or `laws` contains laws and lists.
        ValueError: The number of lists is not the number of networks.
    """
    lists = [each for each in laws if isinstance(each, Sequence)]
    if not lists:
        return [[law(each) for each in laws if not isinstance(each, Sequence)]] * count
    if len(lists) != len(laws):
        raise TypeError("laws: give either laws or one list of laws for each network, not both")
    if len(lists) != count:
        raise ValueError(f"laws: {len(lists)} lists for {count} networks; give one for each")
    return [[law(each) for each in its] for its in lists]


def named_parameters(given: Sequence[Parameter | str]) -> tuple[Parameter, ...]:
    """Return the parameters, with names as parameters without limits.

    Raises ValueError if a name is used twice.
    """
    found = tuple(each if isinstance(each, Parameter) else Parameter(each) for each in given)
    twice = [name for name, count in Counter(each.name for each in found).items() if count > 1]
    if twice:
        raise ValueError(f"parameters: the name {twice[0]!r} is used twice")
    return found


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
