"""Methods about the running law and its parameters."""

from __future__ import annotations

import math

from catenary.remote import messages
from catenary.remote.program import Program


def laws(program: Program) -> list[messages.LawEntry]:
    """Return the law that was started last. Its parameters are named by their index."""
    run = program.network.session.laws.current
    if run is None:
        return []
    parameters = {
        str(index): messages.Parameter(value=value, minimum=None, maximum=None, unit="")
        for index, value in enumerate(run.parameters.tolist())
    }
    return [messages.LawEntry(name=str(run.law), running=run.running, parameters=parameters)]


def set_parameters(program: Program, law: str, values: dict[str, float]) -> messages.Done:
    """Set parameters of the running law, all together before one step."""
    run = program.network.session.laws.current
    if run is None or str(run.law) != law or not run.running:
        raise ValueError(f"the law {law!r} does not run")
    row = run.parameters
    for name, value in values.items():
        if not (name.isdecimal() and int(name) < len(row)):
            raise ValueError(f"the law {law!r} has no parameter {name!r}; it has {len(row)}")
        if not math.isfinite(value):
            raise ValueError(f"parameter {name!r}: {value} is not a finite number")
        row[int(name)] = value
    run.parameters = row
    return messages.Done()
