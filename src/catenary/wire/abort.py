"""SDO abort codes, ETG.1000.6 §5.6.2.7 table 41 and ETG.1020.

The hints are not part of the standard.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AbortCode:
    """An SDO abort code with the text of the standard and a hint."""

    code: int
    text: str
    hint: str = ""


_CODES = (
    AbortCode(0x05030000, "Toggle bit not changed", "a segment was lost or repeated; try again"),
    AbortCode(0x05040000, "SDO protocol timeout", "the device waited too long; try again"),
    AbortCode(0x05040001, "Client/server command specifier not valid or unknown"),
    AbortCode(0x05040005, "Out of memory"),
    AbortCode(0x06010000, "Unsupported access to an object"),
    AbortCode(0x06010001, "Attempt to read a write-only object"),
    AbortCode(
        0x06010002,
        "Attempt to write a read-only object",
        "some objects are writable only in PRE-OP",
    ),
    AbortCode(
        0x06010003,
        "Subindex cannot be written, subindex 0 must be 0 for write access",
        "write 0 to subindex 0 first",
    ),
    AbortCode(
        0x06010004,
        "Complete access not supported for objects of variable length",
        "access the subindices one by one",
    ),
    AbortCode(0x06010005, "Object length exceeds mailbox size"),
    AbortCode(
        0x06010006,
        "Object mapped to RxPDO, SDO download blocked",
        "write it as process data, or remove it from the mapping",
    ),
    AbortCode(0x06020000, "The object does not exist in the object dictionary", "check the index"),
    AbortCode(0x06040041, "The object cannot be mapped into the PDO"),
    AbortCode(
        0x06040042,
        "The number and length of the objects to be mapped would exceed the PDO length",
        "map fewer objects",
    ),
    AbortCode(0x06040043, "General parameter incompatibility"),
    AbortCode(0x06040047, "General internal incompatibility in the device"),
    AbortCode(0x06060000, "Access failed due to a hardware error"),
    AbortCode(
        0x06070010,
        "Data type does not match, length of service parameter does not match",
        "check the type: the written length differs from the object's",
    ),
    AbortCode(
        0x06070012,
        "Data type does not match, length of service parameter too high",
        "check the type: the object is shorter",
    ),
    AbortCode(
        0x06070013,
        "Data type does not match, length of service parameter too low",
        "check the type: the object is longer",
    ),
    AbortCode(0x06090011, "Subindex does not exist", "check the subindex"),
    AbortCode(0x06090030, "Value range of parameter exceeded", "check the value"),
    AbortCode(0x06090031, "Value of parameter written too high", "check the value"),
    AbortCode(0x06090032, "Value of parameter written too low", "check the value"),
    AbortCode(
        0x06090033,
        "Detected and configured module ident lists (0xF050 and 0xF030) do not match",
        "check which modules are plugged in",
    ),
    AbortCode(0x06090036, "Maximum value is less than minimum value"),
    AbortCode(0x08000000, "General error"),
    AbortCode(0x08000020, "Data cannot be transferred or stored to the application"),
    AbortCode(
        0x08000021,
        "Data cannot be transferred or stored to the application because of local control",
        "another program or a panel controls the device",
    ),
    AbortCode(
        0x08000022,
        "Data cannot be transferred or stored to the application in the present device state",
        "try again in PRE-OP",
    ),
    AbortCode(
        0x08000023,
        "Object dictionary dynamic generation fails or no object dictionary is present",
    ),
)

ABORT_CODES = {entry.code: entry for entry in _CODES}


def abort_code(code: int) -> AbortCode:
    """Return the meaning of an SDO abort code. Unknown codes have a generic text."""
    return ABORT_CODES.get(code) or AbortCode(
        code, "Unknown abort code", "see the manual of the device"
    )
