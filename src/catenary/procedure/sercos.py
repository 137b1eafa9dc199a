"""Parameters and procedure commands of SERCOS drives, IEC 61800-7-204, through SoE."""

from __future__ import annotations

from typing import Any

from catenary.errors import DecodeError, MailboxError, ResponseTimeout, SoeError
from catenary.model.sercos import Parameter
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.soe import Target, read, write
from catenary.procedure.station import Deadline, Pace
from catenary.wire.sercos import (
    START,
    Attribute,
    CommandState,
    decode_attribute,
    split_list,
)
from catenary.wire.sercos_errors import NOT_AVAILABLE
from catenary.wire.sercos_values import Value, decode_value, encode_value
from catenary.wire.soe import Element

COMMAND_TIMEOUT = 10.0  # [s] until a procedure command ends
COMMAND_PAUSE, COMMAND_PAUSE_MAX = 1e-3, 50e-3  # [s] between two readings of its state
TYPED = Element.ATTRIBUTE | Element.VALUE
ALL = Element(0xFF)
_STATE = 2  # [bytes]
# Element number in the error codes 0x2001 "no name" to 0x8001 "no default value"
_OPTIONAL = {
    2: Element.NAME,
    4: Element.UNIT,
    5: Element.MINIMUM,
    6: Element.MAXIMUM,
    8: Element.DEFAULT,
}
_NO_STATE = 0x7014


def read_parameter(target: Target, elements: Element = ALL) -> Procedure[Parameter]:
    """Read elements of an IDN with one request, without those that the drive does not have.

    If a drive refuses a request for several elements, they are read one after the other.

    Args:
        target: The IDN.
        elements: Elements to read, at least the attribute.

    Raises:
        SoeError: The drive refuses the request.
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or its answer contradicts the attribute.
    """
    missing = Element(0)
    for _ in _ABSENCES:
        try:
            data = yield from read(target, elements & ~missing)
            return _parameter(target, elements & ~missing, data)
        except SoeError as error:
            absent = _absent(error.code)
            if not absent & elements & ~missing:
                break
            missing |= absent
    return (yield from _read_one_by_one(target, elements & ~missing))


_ABSENCES = range(len(_OPTIONAL) + 2)  # each optional element and the state, then the answer


def _absent(code: int) -> Element:
    """Return the optional element that an error code reports as missing; 0 for other codes."""
    if code == _NO_STATE:
        return Element.STATE
    if code & 0xFFF != NOT_AVAILABLE:
        return Element(0)
    return _OPTIONAL.get(code >> 12, Element(0))


def _read_one_by_one(target: Target, elements: Element) -> Procedure[Parameter]:
    found, data = Element(0), b""
    for element in Element:
        if not elements & element:
            continue
        try:
            part = yield from read(target, element)
        except SoeError as error:
            unreadable = element is Element.VALUE and _is_unreadable(error)
            if element in (Element.ATTRIBUTE, Element.VALUE) and not unreadable:
                raise
            continue
        found, data = found | element, data + part
    return _parameter(target, found, data)


def _is_unreadable(error: SoeError) -> bool:
    """Return True for a value that cannot be read, for example of some procedure commands."""
    return error.code >> 12 == 7


def _parameter(target: Target, elements: Element, data: bytes) -> Parameter:
    """Return the parameter of an answer. Raises MailboxError if the answer is not valid."""
    try:
        return _decoded(target, elements, data)
    except DecodeError as error:
        raise MailboxError(
            f"{target}: invalid answer: {error.message}",
            hint="its firmware is at fault; `catenary capture` records the bytes",
        ) from error


def _decoded(target: Target, elements: Element, data: bytes) -> Parameter:
    found: dict[str, Any] = {}
    if Element.STATE in elements:
        found["state"] = _state(data[:_STATE])
        data = data[_STATE:]
    if Element.NAME in elements:
        text, _, data = split_list(data)
        found["name"] = _text(text)
    if Element.ATTRIBUTE not in elements:
        raise DecodeError("no attribute")
    attribute = decode_attribute(data[:4])
    data = data[4:]
    if not attribute.is_command:
        found.pop("state", None)
    if Element.UNIT in elements:
        text, _, data = split_list(data)
        found["unit"] = _text(text)
    for element, field in (
        (Element.MINIMUM, "minimum"),
        (Element.MAXIMUM, "maximum"),
        (Element.VALUE, "value"),
        (Element.DEFAULT, "default"),
    ):
        if element in elements:
            part, data = _split_value(attribute, data)
            found[field] = decode_value(attribute, part)
            if element is Element.VALUE and attribute.is_list:
                found["list_limit"] = int.from_bytes(part[2:4], "little")
    if data:
        raise DecodeError(f"{len(data)} bytes after the last element")
    return Parameter(target.idn, attribute, drive=target.drive, **found)


def _split_value(attribute: Attribute, data: bytes) -> tuple[bytes, bytes]:
    """Return the bytes of one value, and the remaining ones."""
    if not attribute.is_list:
        return data[: attribute.size], data[attribute.size :]
    _content, _maximum, rest = split_list(data)
    return data[: len(data) - len(rest)], rest


def _state(data: bytes) -> CommandState:
    if len(data) != _STATE:
        raise DecodeError(f"data state: needs {_STATE} bytes, received {len(data)}")
    return CommandState(int.from_bytes(data, "little"))


def _text(content: bytes) -> str:
    return content.rstrip(b"\x00").decode("latin-1")


def read_value(target: Target) -> Procedure[Value]:
    """Read the value of an IDN as a displayed number, a text or a list.

    Raises:
        SoeError: The drive refuses the request.
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or its answer contradicts the attribute.
    """
    found = yield from read_parameter(target, TYPED)
    if found.value is None:
        data = yield from read(target)  # raises the refusal
        return decode_value(found.attribute, data)
    return found.value


def write_value(target: Target, value: Value) -> Procedure[None]:
    """Write the value of an IDN. Its attribute is read first.

    Raises:
        SoeError: The drive refuses the value.
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol.
        ValueError: The value does not fit.
        TypeError: The value has the wrong type.
    """
    data = yield from read(target, Element.ATTRIBUTE)
    try:
        attribute = decode_attribute(data)
    except DecodeError as error:
        raise MailboxError(f"{target}: invalid attribute: {error.message}") from error
    if attribute.is_command:
        raise ValueError(f"{target} is a procedure command: use command()")
    try:
        encoded = encode_value(attribute, value)
    except (ValueError, TypeError) as error:
        raise type(error)(f"{target}: {error}") from None
    yield from write(target, encoded)


def run_command(target: Target, timeout: float = COMMAND_TIMEOUT) -> Procedure[None]:
    """Start a procedure command, wait for its end, and clear it.

    Args:
        target: IDN of the command.
        timeout: Longest time until the command ends [s]. Then it is cancelled.

    Raises:
        SoeError: The drive refuses the command, or the command fails.
        ResponseTimeout: The command does not end, or the device does not answer.
        MailboxError: The device violates the protocol.
    """
    try:
        yield from write(target, int(START).to_bytes(_STATE, "little"))
    except (ResponseTimeout, MailboxError):
        yield from _cancel(target)  # it may have started
        raise
    try:
        state = yield from _await_end(target, Deadline(timeout))
    except (SoeError, ResponseTimeout, MailboxError):
        yield from _cancel(target)
        raise
    if not _has_ended(state):
        cancelled = yield from _cancel(target)
        raise _stuck(target, state, timeout, cancelled)
    if CommandState.FAILED in state:
        yield from _cancel(target)
        raise _failed(target, state)
    yield from write(target, bytes(_STATE))


def _await_end(target: Target, deadline: Deadline) -> Procedure[CommandState]:
    """Return the state of a command at its end, or at the deadline."""
    pace = Pace(COMMAND_PAUSE, COMMAND_PAUSE_MAX)
    while True:
        data = yield from read(target, Element.STATE)
        state = _checked_state(target, data)
        if _has_ended(state) or deadline.passed_at(target.channel.received_ns):
            return state
        yield after(pace.pause())


def _has_ended(state: CommandState) -> bool:
    done = CommandState.SET in state and CommandState.PENDING not in state
    return done or CommandState.FAILED in state


def _cancel(target: Target) -> Procedure[bool]:
    """Clear a command after an error. Return False if the drive refuses: the first error counts."""
    try:
        yield from write(target, bytes(_STATE))
    except (SoeError, ResponseTimeout, MailboxError):
        return False
    return True


def _checked_state(target: Target, data: bytes) -> CommandState:
    try:
        return _state(data)
    except DecodeError as error:
        raise MailboxError(f"{target}: invalid answer: {error.message}") from error


def _failed(target: Target, state: CommandState) -> SoeError:
    return SoeError(
        f"{target}: the procedure command failed (state 0x{int(state):04X})",
        position=target.channel.station.position,
        idn=target.idn,
        drive=target.drive,
        code=int(state),
        hint="S-0-0095 describes the cause; for S-0-0127 and S-0-0128, the lists S-0-0021 and "
        "S-0-0022 contain the invalid IDNs",
    )


def _stuck(target: Target, state: CommandState, timeout: float, cancelled: bool) -> ResponseTimeout:
    end = "it was cancelled" if cancelled else "it could not be cancelled, and may still run"
    return ResponseTimeout(
        f"{target}: the procedure command has not ended after {timeout:g} s "
        f"(state 0x{int(state):04X}); {end}",
        hint="allow more time if the command needs it; S-0-0095 describes the state of the drive",
    )
