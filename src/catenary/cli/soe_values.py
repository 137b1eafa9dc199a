"""Values of IDNs as text and JSON, and text as values, for `catenary soe`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from catenary.cli.failure import UsageError
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.model.sercos import Parameter
    from catenary.wire.sercos import Attribute
    from catenary.wire.sercos_values import Item, Value


def facts(found: Parameter) -> dict[str, object]:
    """Return the elements of a parameter for JSON."""
    attribute = found.attribute
    return {
        "idn": found.idn,
        "drive": found.drive,
        "name": found.name,
        "value": found.value,
        "unit": found.unit,
        "minimum": found.minimum,
        "maximum": found.maximum,
        "default": found.default,
        "format": attribute.display.name.lower(),
        "size": attribute.size,
        "list": attribute.is_list,
        "list_limit": found.list_limit,
        "command": attribute.is_command,
        "state": None if found.state is None else int(found.state),
        "decimals": attribute.decimals,
        "protected_in": list(found.protected_in),
    }


def line(row: dict[str, object]) -> str:
    """Return one line of the list with values."""
    if "error" in row:
        return f"{row['idn']}  {row['error']}"
    value, unit = row["value"], row["unit"]
    text = shown(value)
    name = escaped(str(row["name"]))
    return f"{row['idn']}  {name}: {text} {escaped(str(unit))}".rstrip()


def shown(value: object) -> str:
    """Return a value as text; the items of a list with commas."""
    if isinstance(value, list):
        return ", ".join(shown(each) for each in value)
    return escaped(value) if isinstance(value, str) else str(value)


def parsed(text: str, attribute: Attribute) -> Value:
    """Return the value of a text. Raises UsageError if it is not a number where one is needed."""
    from catenary.wire.sercos import Display

    if attribute.display is Display.TEXT:
        return text
    if attribute.is_list:
        items = (each.strip() for each in text.split(","))
        return [_item(each, attribute) for each in items if each]
    return _item(text, attribute)


def _item(text: str, attribute: Attribute) -> Item:
    from catenary.wire.sercos import Display

    if attribute.display is Display.IDN:
        return text
    try:
        return int(text, 0)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(
            f"{text!r} is not a number", hint="write numbers as decimal or 0x..."
        ) from error
