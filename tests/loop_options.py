"""Options of a Loop as flat keyword arguments, for test helpers that pass options on."""

from __future__ import annotations

from dataclasses import fields

from catenary.loop import ClockOptions, Scheduling, StopPolicy

GROUPS = {"stop": StopPolicy, "scheduling": Scheduling, "clocks": ClockOptions}


def grouped(options: dict[str, object]) -> dict[str, object]:
    """Return the keyword arguments of a Loop: {"late_limit": 0} becomes stop=StopPolicy(...)."""
    found = dict(options)
    for group, made in GROUPS.items():
        names = [field.name for field in fields(made) if field.name in found]
        if names:
            found[group] = made(**{name: found.pop(name) for name in names})  # type: ignore[arg-type]
    return found
