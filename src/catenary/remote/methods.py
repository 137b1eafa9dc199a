"""Table of the methods, and the types of their arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, get_type_hints

import msgspec

from catenary.remote import (
    devices,
    laws,
    loop_state,
    motion,
    objects,
    operation,
    states,
    virtual_segment,
)
from catenary.remote.listener import Peer
from catenary.remote.program import Program

Method = Callable[..., Any]  # takes a Program and arguments; returns a result or a generator

METHODS: Mapping[str, Method] = {
    "hello": loop_state.hello,
    "devices": devices.devices,
    "axes": loop_state.axes,
    "objects": objects.objects,
    "sdo_read": objects.sdo_read,
    "sdo_write": objects.sdo_write,
    "set_state": states.set_state,
    "reset_error": states.reset_error,
    "registers": devices.registers,
    "diagnosis": devices.diagnosis,
    "emergencies": devices.emergencies,
    "events": loop_state.events,
    "clear_counters": devices.clear_counters,
    "timing": loop_state.timing,
    "clocks": loop_state.clocks,
    "plan": loop_state.plan,
    "laws": laws.laws,
    "set_parameters": laws.set_parameters,
    "modes": operation.modes,
    "set_mode": operation.set_mode,
    "run_preset": operation.run_preset,
    "home": motion.home,
    "move": motion.move,
    "virtual_cable": virtual_segment.virtual_cable,
    "virtual_power": virtual_segment.virtual_power,
    "virtual_push": virtual_segment.virtual_push,
}
PEER = "peer"  # argument of the methods that name the client to the program


class Methods:
    """Methods of a program, with checked arguments."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._arguments = {name: _arguments(name, method) for name, method in METHODS.items()}

    def start(self, name: str, params: Mapping[str, Any], peer: Peer) -> Any:
        """Call a method. Return its result, or a generator of type `program.Work`.

        Args:
            name: Name of the method.
            params: Arguments by name.
            peer: Process of the client.

        Raises:
            ValueError: The method is unknown, or an argument is unknown, missing or of the wrong
                type.
        """
        if name not in METHODS:
            raise ValueError(f"unknown method {name!r}; methods: {', '.join(METHODS)}")
        try:
            given = msgspec.convert(params, self._arguments[name])
        except msgspec.ValidationError as error:
            raise ValueError(f"{name}: {error}") from error
        more = {PEER: peer} if PEER in inspect.signature(METHODS[name]).parameters else {}
        return METHODS[name](self._program, **msgspec.structs.asdict(given), **more)


def _arguments(name: str, method: Method) -> type[msgspec.Struct]:
    """Return a type with the arguments of a method, except the program and the client."""
    hints = get_type_hints(method)
    fields: list[Any] = []
    for each in list(inspect.signature(method).parameters.values())[1:]:
        if each.name == PEER:
            continue
        required = each.default is inspect.Parameter.empty
        kind = hints[each.name]
        fields.append((each.name, kind) if required else (each.name, kind, each.default))
    return msgspec.defstruct(name, fields, kw_only=True, forbid_unknown_fields=True)
