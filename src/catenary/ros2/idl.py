"""Types of Cyclone DDS for the messages: they carry the type name and the type information."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, get_args, get_origin, get_type_hints

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl_types
from msgspec import Struct

from catenary.ros2 import discovery
from catenary.ros2.messages import dds_name

types: Any = idl_types  # its annotations do not know that `sequence` and `array` are generic
PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "byte": types.uint8,
    "int32": types.int32,
    "uint32": types.uint32,
    "int64": types.int64,
    "float64": types.float64,
    "string": str,
}


@cache
def idl_type(message: type[Struct]) -> type[IdlStruct]:
    """Return the type of Cyclone DDS for a class of messages."""
    hints = get_type_hints(message, include_extras=True)
    fields = {name: _field_type(hints[name]) for name in message.__struct_fields__}
    made: type[IdlStruct] = make_idl_struct(message.__name__ + "_", _type_name(message), fields)
    return made


def _type_name(message: type[Struct]) -> str:
    if message.__module__ == discovery.__name__:
        return f"{discovery.PACKAGE}::msg::dds_::{message.__name__}_"
    return dds_name(message)


def _field_type(hint: Any) -> Any:
    if isinstance(hint, type) and issubclass(hint, Struct):
        return idl_type(hint)
    if get_origin(hint) is Sequence:
        return types.sequence[_field_type(get_args(hint)[0])]
    element, bracket, length = hint.__metadata__[0].rstrip("]").partition("[")
    primitive = PRIMITIVES[element]
    if not bracket:
        return primitive
    return types.array[primitive, int(length)] if length else types.sequence[primitive]
