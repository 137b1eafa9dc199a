"""Texts of diagnosis messages (ETG.2000, DiagMessage): templates with placeholders as in printf.

`%d`, `%u`, `%x`, `%X`, `%c`, `%s` and the formats of floats take the parameters in order. `%2$d`
and `%2` take the second parameter. The space is not a flag: "90 % during the start" has no
placeholder. The templates come from files, so widths are bounded.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from catenary.wire.diagnosis_history import DiagnosisMessage, Parameter, ParameterKind
from catenary.wire.drive_error import error_text

PLACEHOLDER = re.compile(
    r"%(?:(?P<place>\d{1,3})\$)?(?P<flags>[-+#0]*)(?P<width>\d*)(?:\.(?P<precision>\d*))?"
    r"(?:hh|h|ll|l|I64|q)?(?P<form>[diouxXcsSeEfFgGp])|%(?P<number>\d{1,3})|%(?P<percent>%)"
)
WIDTH_MAX = 64
TEXT_MAX = 1000  # characters of a message
FIRST_SURROGATE = 0xD800
FLOATS, TEXTS, UNSIGNED = "eEfFgG", "sSc", "oxX"
Value = int | float | str | bytes


def message_text(message: DiagnosisMessage, texts: Mapping[int, str]) -> str:
    """Return the text of a message: that of its text ID, or a description of its numbers.

    Args:
        message: Decoded message.
        texts: Texts of the device by text ID, from its ESI.
    """
    values = [parameter_value(each, texts) for each in message.parameters]
    template = texts.get(message.text_id)
    if template is not None:
        return formatted(template, values)
    shown = f"text 0x{message.text_id:04X}" if message.text_id else "no text"
    if message.error_code is not None:
        shown = f"error 0x{message.error_code:04X} ({error_text(message.error_code)}), {shown}"
    else:
        shown = f"code 0x{message.code:08X}, {shown}"
    return f"{shown}, parameters {', '.join(map(_plain, values))}" if values else shown


def parameter_value(parameter: Parameter, texts: Mapping[int, str]) -> Value:
    """Return the value of a parameter. A text ID becomes its text, if it is known.

    Args:
        parameter: Parameter of a message.
        texts: Texts of the device by text ID.
    """
    value = parameter.value
    if parameter.kind is ParameterKind.TEXT_ID and isinstance(value, int):
        return texts.get(value, f"text 0x{value:04X}")
    return value


def formatted(template: str, values: Sequence[Value]) -> str:
    """Return a template with its placeholders replaced by values.

    A placeholder without a value stays as it is. Values without a placeholder are appended.

    Args:
        template: Text with placeholders.
        values: Values of the parameters.
    """
    used: set[int] = set()
    position = 0

    def replacement(match: re.Match[str]) -> str:
        nonlocal position
        if match["percent"]:
            return "%"
        chosen = match["place"] or match["number"]
        if chosen is None:
            place, position = position, position + 1
        else:
            place = int(chosen) - 1
        if not 0 <= place < len(values):
            return match[0]
        used.add(place)
        return _plain(values[place]) if match["number"] else _printed(match, values[place])

    text = PLACEHOLDER.sub(replacement, template[:TEXT_MAX])
    others = [_plain(value) for place, value in enumerate(values) if place not in used]
    return (f"{text} ({', '.join(others)})" if others else text)[:TEXT_MAX]


def _printed(match: re.Match[str], value: Value) -> str:
    """Return a value in the format of a placeholder, or plainly if the format does not fit."""
    width = min(int(match["width"] or 0), WIDTH_MAX)
    form = match["form"]
    if form in TEXTS:
        letter = form == "c" and isinstance(value, int) and 0 <= value < FIRST_SURROGATE
        text = chr(int(value)) if letter else _plain(value)
        return text.ljust(width) if "-" in match["flags"] else text.rjust(width)
    if not isinstance(value, int | float):
        return _plain(value)
    precision = match["precision"]
    dot = "" if precision is None else f".{min(int(precision or 0), WIDTH_MAX)}"
    flags = "".join(dict.fromkeys(match["flags"]))
    if form in FLOATS:
        return f"%{flags}{width or ''}{dot}{form}" % float(value)
    if isinstance(value, float):
        return _plain(value)
    form = {"u": "d", "i": "d", "p": "x"}.get(form, form)
    if value < 0 and form in UNSIGNED:
        value += 1 << (32 if value >= -(1 << 31) else 64)  # as in C
    return f"%{flags}{width or ''}{dot}{form}" % value


def _plain(value: Value) -> str:
    if isinstance(value, bytes):
        return value.hex(" ")
    return f"{value:g}" if isinstance(value, float) else str(value)
