"""Explanations of the validation errors of msgspec, with key path, expected value and hint."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

from catenary.machine.schema import MachineTables, Table
from catenary.toml_lines import KeyPath

_PLACE = re.compile(r"(.*?)(?: - at `\$(.*)`)?", re.DOTALL)
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+)\]|\[(\.\.\.)\]")
_UNKNOWN = re.compile(r"Object contains unknown field `(.*)`", re.DOTALL)
_MISSING = re.compile(r"Object missing required field `(.*)`")
_WORDS: Mapping[str, str] = {
    **{"object": "a table", "array": "a list", "str": "text", "int": "a whole number"},
    **{"float": "a number", "bool": "true or false"},
}
ROLES = ("drives", "process_data")  # tables that contain one table per name
_HINTS: Mapping[str, str] = {
    "identity": "write identity = { vendor = ..., product = ... }; `catenary init` reads both",
    "format": 'write format = "catenary-machine/1" at the top of the file',
    "counts_per_turn": "write the encoder counts per motor turn, from the manual of the drive; in "
    'a file of `catenary init`, remove the "#" from the lines marked FILL IN',
}


class Explanation(msgspec.Struct, frozen=True):
    """Key path of an error in a file, message and hint."""

    path: KeyPath
    message: str
    hint: str = ""


def explain(error: msgspec.ValidationError, content: Mapping[str, object]) -> Explanation:
    """Return the explanation of a validation error.

    Args:
        error: error of msgspec.
        content: content of the file that caused the error.
    """
    path = _path(str(error), content)
    message = _message(str(error))
    unknown, missing = _UNKNOWN.fullmatch(message), _MISSING.fullmatch(message)
    if unknown is not None:
        return _explain_unknown(path, unknown[1])
    if missing is not None:
        text = f'key "{missing[1]}" is missing{_described((*path, missing[1]))}'
        return Explanation(path, text, _HINTS.get(missing[1], ""))
    found = _at(content, path)
    if message.startswith("Invalid enum value"):
        return _explain_choice(path, found)
    expected = re.sub(
        r"`([^`]*)`", lambda kinds: _in_words(kinds[1]), message.partition(", got")[0]
    )
    text = f"{expected[0].lower()}{expected[1:]}, found {_shown(found)}{_described(path)}"
    is_role = len(path) == 2 and path[0] in ROLES
    hint = f"add a name of your choice to the header: [{path[0]}.NAME]" if is_role else ""
    return Explanation(path, text, hint)


def _message(text: str) -> str:
    found = _PLACE.fullmatch(text)
    return found[1] if found is not None else text


def _path(text: str, content: Mapping[str, object]) -> KeyPath:
    """Return the path in an error text. msgspec writes `[...]` instead of a key that is a name."""
    found = _PLACE.fullmatch(text)
    path: KeyPath = ()
    for name, number, any_key in _STEP.findall(found[2] or "" if found is not None else ""):
        step = name or number
        path += (_failing_key(content, path, text) if any_key else int(step) if number else step,)
    return path


def _failing_key(content: Mapping[str, object], path: KeyPath, text: str) -> str:
    """Return the key of the table at `path` whose value causes the error; else the first key."""
    table = _at(content, path)
    assert isinstance(table, dict)
    for key, value in table.items():
        try:
            msgspec.convert(_with(content, path, {key: value}), MachineTables)
        except msgspec.ValidationError as error:
            if str(error) == text:
                return str(key)
    return str(next(iter(table)))


def _with(content: Any, path: KeyPath, value: object) -> Any:
    """Return the content with another value at `path`."""
    if not path:
        return value
    inner = _with(content[path[0]], path[1:], value)
    if isinstance(content, list):
        return [inner if i == path[0] else each for i, each in enumerate(content)]
    return {**content, path[0]: inner}


def _at(content: Any, path: KeyPath) -> object:
    for step in path:
        content = content[step]
    return content


def _explain_unknown(path: KeyPath, key: str) -> Explanation:
    table = next(_tables(_type_at(path)))
    near = get_close_matches(key, table.__struct_fields__, n=1)
    if near:
        return Explanation((*path, key), f'unknown key "{key}"; did you mean "{near[0]}"?')
    text = f'unknown key "{key}"'
    owner = _owner(key)
    keys = ", ".join(table.__struct_fields__)
    hint = f"{key} is a key of {owner}" if owner else f"the keys of this table are {keys}"
    return Explanation((*path, key), text, hint)


def _owner(key: str) -> str:
    """Return the header of the table that has a key; empty if no table has it."""
    for table in Table.__subclasses__():
        header = (table.__doc__ or "").partition(":")[0]
        if key in table.__struct_fields__ and header.startswith("["):
            return header
    return ""


def _explain_choice(path: KeyPath, found: object) -> Explanation:
    choices = [
        value
        for kind in _flat(_type_at(path))
        if get_origin(kind) is Literal
        for value in get_args(kind)
    ]
    expected = ", ".join(map(_shown, choices))
    return Explanation(path, f"{_shown(found)} is not one of {expected}{_described(path)}")


def _in_words(kinds: str) -> str:
    return " or ".join(_WORDS.get(kind, kind) for kind in kinds.split(" | "))


def _shown(value: object) -> str:
    """Return a value in TOML notation, or "a table" or "a list"."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else "a list"
    return f'"{value}"' if isinstance(value, str) else str(value)


def _described(path: KeyPath) -> str:
    """Return the description of a key from the schema, in parentheses; empty without one."""
    texts = [
        note.description
        for kind in _flat(_type_at(path))
        if get_origin(kind) is Annotated
        for note in get_args(kind)[1:]
        if isinstance(note, Meta) and note.description
    ]
    return f" ({texts[0]})" if texts else ""


def _type_at(path: KeyPath) -> Any:
    """Return the type of a key path in the schema; `object` if the schema lacks the path."""
    kind: Any = MachineTables
    for step in path:
        kind = next(_inner(kind, step), object)
    return kind


def _inner(kind: Any, step: str | int) -> Iterator[Any]:
    for each in _flat(kind):
        if get_origin(each) in (dict, list):
            yield get_args(each)[-1]
        elif isinstance(each, type) and issubclass(each, Table) and step in each.__struct_fields__:
            yield get_type_hints(each, include_extras=True)[str(step)]


def _tables(kind: Any) -> Iterator[type[Table]]:
    for each in _flat(kind):
        if isinstance(each, type) and issubclass(each, Table):
            yield each


def _flat(kind: Any) -> Iterator[Any]:
    """Yield a type and the members of its unions."""
    yield kind
    if get_origin(kind) in (Union, types.UnionType):
        for each in get_args(kind):
            yield from _flat(each)
    elif get_origin(kind) is Annotated:
        yield from _flat(get_args(kind)[0])


def quantities(table: type[Table]) -> dict[str, str | None]:
    """Return the dimension of each key of a table; None for a key that is not a quantity."""
    hints = get_type_hints(table, include_extras=True)
    return {name: _dimension(hints[name]) for name in table.__struct_fields__}


def _dimension(kind: Any) -> str | None:
    for each in _flat(kind):
        if get_origin(each) is list:
            found = _dimension(get_args(each)[0])
            if found is not None:
                return found
        for note in get_args(each)[1:] if get_origin(each) is Annotated else ():
            if isinstance(note, Meta) and note.extra is not None:
                return str(note.extra["dimension"])
    return None
