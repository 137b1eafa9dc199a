"""Methods about the running law and its parameters."""

from __future__ import annotations

import math

from catenary.loop.laws.law import Law, Parameter
from catenary.remote import messages
from catenary.remote.program import Program


def laws(program: Program) -> list[messages.LawEntry]:
    """Return the law that was started last."""
    run = program.network.session.laws.current
    if run is None:
        return []
    values = run.parameters.tolist()
    parameters = {
        each.name: messages.Parameter(
            value=value,
            minimum=limit(each.minimum),
            maximum=limit(each.maximum),
            unit=each.unit,
        )
        for each, value in zip(parameters_of(run.law, len(values)), values, strict=True)
    }
    return [messages.LawEntry(name=str(run.law), running=run.running, parameters=parameters)]


def set_parameters(program: Program, law: str, values: dict[str, float]) -> messages.Done:
    """Set parameters of the running law, all together before one step."""
    run = program.network.session.laws.current
    if run is None or str(run.law) != law or not run.running:
        raise ValueError(f"the law {law!r} does not run")
    row = run.parameters
    known = {each.name: k for k, each in enumerate(parameters_of(run.law, len(row)))}
    for name, value in values.items():
        if name not in known:
            names = ", ".join(known) or "none"
            raise ValueError(f"the law {law!r} has no parameter {name!r}; its parameters: {names}")
        check_value(parameters_of(run.law, len(row))[known[name]], value)
        row[known[name]] = value
    run.parameters = row
    return messages.Done()


def parameters_of(law: Law, count: int) -> tuple[Parameter, ...]:
    """Return the parameters of a law. Those without names are named by their index."""
    return law.parameters or tuple(Parameter(str(index)) for index in range(count))


def check_value(parameter: Parameter, value: float) -> None:
    """Raise ValueError if a parameter must not have a value."""
    if not math.isfinite(value):
        raise ValueError(f"parameter {parameter.name!r}: {value} is not a finite number")
    if not parameter.minimum <= value <= parameter.maximum:
        raise ValueError(
            f"parameter {parameter.name!r}: {value:g} is outside of its range "
            f"{parameter.minimum:g} to {parameter.maximum:g} {parameter.unit}".rstrip()
        )


def limit(value: float) -> float | None:
    """Return a limit; None if it is infinite."""
    return value if math.isfinite(value) else None
