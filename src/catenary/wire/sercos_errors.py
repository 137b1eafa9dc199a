"""Error codes of SERCOS service channels, IEC 61800-7-204, with their meanings.

The upper four bits are the number of the element, the lower ones the kind of the error. Texts as in
the manuals of Bosch Rexroth (IndraDrive).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

NOT_AVAILABLE = 0x01  # kind of error: the IDN has no such element
NO_IDN = 0x1001
INVALID_ACCESS = 0x1009
TOO_SHORT, TOO_LONG, READ_ONLY, PROTECTED = 0x7002, 0x7003, 0x7004, 0x7005
TOO_SMALL, TOO_LARGE, INVALID_VALUE = 0x7006, 0x7007, 0x7008
PASSWORD, CYCLIC = 0x7009, 0x700A
COMMAND_ACTIVE, NOT_INTERRUPTIBLE, NOT_EXECUTABLE, INVALID_PARAMETERS = (
    0x7010,
    0x7011,
    0x7012,
    0x7013,
)
DRIVE_NUMBER, GENERAL_ERROR, NO_ELEMENT = 0x800A, 0x800B, 0x800C


class Meaning(NamedTuple):
    """Meaning of an error code, and the next step."""

    text: str
    hint: str = ""


ELEMENTS = (
    *("service channel", "IDN", "name", "attribute", "unit", "minimum", "maximum", "value"),
    "default value",
)
KINDS = {
    0x01: "does not exist",
    0x02: "is too short",
    0x03: "is too long",
    0x04: "cannot be changed",
    0x05: "is write-protected at this time",
}
_STATES = "the attribute shows the states in which it is protected: catenary soe info"
_LIMITS = "the limits are those of `catenary soe info`"
SPECIAL: Mapping[int, Meaning] = {
    0x0001: Meaning("service channel not open"),
    0x0009: Meaning("invalid access to closing the service channel"),
    NO_IDN: Meaning(
        "the drive has no such IDN", "`catenary soe list` shows its IDNs; check the drive number"
    ),
    INVALID_ACCESS: Meaning("invalid access to the IDN"),
    TOO_SHORT: Meaning("the value is too short", "the attribute states its size"),
    TOO_LONG: Meaning(
        "the value is too long", "the attribute states its size, a list its maximum length"
    ),
    READ_ONLY: Meaning("the value cannot be changed (read-only)"),
    PROTECTED: Meaning("the value is write-protected at this time", _STATES),
    TOO_SMALL: Meaning("the value is smaller than the minimum", _LIMITS),
    TOO_LARGE: Meaning("the value is larger than the maximum", _LIMITS),
    INVALID_VALUE: Meaning(
        "the value is invalid", "an IDN, a combination of bits or an item is not permitted"
    ),
    PASSWORD: Meaning("the value is protected by a password", "see S-0-0267 and the manual"),
    CYCLIC: Meaning(
        "the value is write-protected because it is exchanged cyclically",
        "remove the IDN from S-0-0024, or set it in the process data",
    ),
    0x700B: Meaning("invalid indirect addressing, for example of a data container"),
    0x700C: Meaning("the value is write-protected because of other settings"),
    COMMAND_ACTIVE: Meaning("the procedure command is already active", "wait for its end"),
    NOT_INTERRUPTIBLE: Meaning("the procedure command cannot be interrupted"),
    NOT_EXECUTABLE: Meaning(
        "the procedure command cannot be executed at this time",
        "it may need another state of the drive, for example without enable",
    ),
    INVALID_PARAMETERS: Meaning(
        "the procedure command cannot be executed: invalid parameters",
        "the lists S-0-0021 and S-0-0022 contain the invalid IDNs",
    ),
    # Codes of SoE that SERCOS does not have; numbers as in SOEM (ec_print.c)
    0x7014: Meaning("the IDN has no data state"),
    DRIVE_NUMBER: Meaning("invalid drive number", "a device with one drive has only drive 0"),
    GENERAL_ERROR: Meaning("general error", "the drive may read only one element at a time"),
    NO_ELEMENT: Meaning("the request names no element"),
}


def error_meaning(code: int) -> Meaning:
    """Return the meaning of an error code, also if only its element or its kind is known."""
    known = SPECIAL.get(code)
    if known is not None:
        return known
    element, kind = code >> 12, code & 0x0FFF
    if element < len(ELEMENTS) and kind in KINDS:
        return Meaning(f"the {ELEMENTS[element]} {KINDS[kind]}")
    return Meaning("code of the vendor", "the manual of the drive explains this code")
