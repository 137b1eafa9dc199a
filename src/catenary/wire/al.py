"""AL control and AL status, ETG.1000.6 §5.3, and AL status codes, ETG.1020."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from catenary.errors import DecodeError

STATE_MASK = 0x000F  # in AL control and AL status
ERROR_FLAG = 0x0010  # AL status: an error is pending; AL control: acknowledge it
_IDENTIFICATION = 0x0020


class AlState(IntEnum):
    """States of a SubDevice, with their codes in AL control and AL status."""

    INIT = 1
    PRE_OP = 2
    BOOT = 3
    SAFE_OP = 4
    OP = 8

    def __str__(self) -> str:
        return self.name.replace("_", "-")

    @classmethod
    def from_name(cls, text: str) -> AlState:
        """Return the state with a name such as "SAFE_OP", "SAFE-OP", "safeop" or "OPERATIONAL".

        Raises:
            ValueError: The text is not the name of a state. The message lists the names.
        """
        key = "".join(letter for letter in text.upper() if letter.isalpha())
        key = _LONG_NAMES.get(key, key)
        for state in cls:
            if state.name.replace("_", "") == key:
                return state
        raise ValueError(f"invalid state {text!r}: {', '.join(map(str, cls))}")


_LONG_NAMES = {
    "PREOPERATIONAL": "PREOP",
    "SAFEOPERATIONAL": "SAFEOP",
    "OPERATIONAL": "OP",
    "BOOTSTRAP": "BOOT",
}


@dataclass(frozen=True, slots=True)
class AlControl:
    """AL control (0x0120): the state that the MainDevice requests."""

    state: AlState
    acknowledge: bool = False  # acknowledge a pending error
    request_identification: bool = False  # explicit device identification, ETG.1020 §22

    @property
    def word(self) -> int:
        """Value of the register."""
        word = int(self.state)
        word |= ERROR_FLAG if self.acknowledge else 0
        word |= _IDENTIFICATION if self.request_identification else 0
        return word

    @classmethod
    def from_word(cls, word: int) -> AlControl:
        """Return the decoded register. Raises DecodeError if the state is invalid.

        Bits 6 to 15 are ignored.
        """
        return cls(_state(word), bool(word & ERROR_FLAG), bool(word & _IDENTIFICATION))


@dataclass(frozen=True, slots=True)
class AlStatus:
    """AL status (0x0130): the actual state of a SubDevice."""

    state: AlState
    error: bool = False  # the last request failed, or the state was left: see the AL status code
    identification: bool = False  # the AL status code holds the device identification

    @property
    def word(self) -> int:
        """Value of the register."""
        word = int(self.state)
        word |= ERROR_FLAG if self.error else 0
        word |= _IDENTIFICATION if self.identification else 0
        return word

    @classmethod
    def from_word(cls, word: int) -> AlStatus:
        """Return the decoded register. Raises DecodeError if the state is invalid.

        Bits 6 to 15 are ignored. A broadcast read combines the states of all devices with OR. The
        result may not be a valid state; decode it with `states_in`.
        """
        return cls(_state(word), bool(word & ERROR_FLAG), bool(word & _IDENTIFICATION))


def states_in(word: int) -> frozenset[AlState]:
    """Return the states that the OR of several AL status words can contain.

    INIT and PRE-OP together also look like BOOT, because BOOT = INIT | PRE-OP.
    """
    return frozenset(state for state in AlState if word & state == state)


@dataclass(frozen=True, slots=True)
class StatusCode:
    """An AL status code: the text of the standard, and a frequent cause or a hint."""

    code: int
    text: str
    cause: str = ""


def status_code(code: int) -> StatusCode:
    """Return the meaning of an AL status code. Unknown codes have a generic text."""
    if known := STATUS_CODES.get(code):
        return known
    text = "Vendor specific" if code >= 0x8000 else "Unknown"
    return StatusCode(code, f"{text} AL status code", "see the manual of the device")


def _state(word: int) -> AlState:
    try:
        return AlState(word & STATE_MASK)
    except ValueError:
        raise DecodeError(
            f"invalid EtherCAT state {word & STATE_MASK} (word 0x{word:04X})"
        ) from None


_CODES = (
    # ETG.1000.6 table 11 and ETG.1020 table "AL Status Codes". The standards give no causes.
    StatusCode(0x0000, "No error"),
    StatusCode(0x0001, "Unspecified error", "the device gives no details; see its manual"),
    StatusCode(0x0002, "No memory", "the mapping is larger than the device can hold"),
    StatusCode(
        0x0003, "Invalid device setup", "the configured modules differ from the plugged ones"
    ),
    StatusCode(
        0x0004, "Invalid revision", "the description belongs to another revision of the device"
    ),
    StatusCode(0x0006, "SII/EEPROM information does not match firmware", "update the EEPROM image"),
    StatusCode(
        0x0007, "Firmware update not successful, old firmware still running", "repeat the update"
    ),
    StatusCode(0x000E, "License error", "the licence is missing or has expired"),
    StatusCode(
        0x0011,
        "Invalid requested state change",
        "a state was skipped; the order is INIT, PRE-OP, SAFE-OP, OP",
    ),
    StatusCode(0x0012, "Unknown requested state", "AL control contained no valid state"),
    StatusCode(0x0013, "Bootstrap not supported", "the device has no BOOT state"),
    StatusCode(0x0014, "No valid firmware", "load a firmware in BOOT"),
    StatusCode(
        0x0015,
        "Invalid mailbox configuration (BOOT)",
        "SyncManagers 0 and 1 differ from the SII's bootstrap mailbox",
    ),
    StatusCode(
        0x0016,
        "Invalid mailbox configuration (PRE-OP)",
        "SyncManagers 0 and 1 differ from the SII's standard mailbox",
    ),
    StatusCode(
        0x0017,
        "Invalid SyncManager configuration",
        "address, length or control of a SyncManager differs from the mapping or the SII",
    ),
    StatusCode(0x0018, "No valid inputs available", "the application has no inputs yet"),
    StatusCode(
        0x0019, "No valid outputs", "no outputs arrived before or in OP: check that the loop runs"
    ),
    StatusCode(
        0x001A, "Synchronization error", "process data and SYNC0 do not arrive at the agreed times"
    ),
    StatusCode(
        0x001B,
        "SyncManager watchdog",
        "no outputs within the watchdog time: the loop stalled, or a cable to the device broke",
    ),
    StatusCode(0x001C, "Invalid SyncManager types", "a SyncManager has the wrong direction or use"),
    StatusCode(
        0x001D,
        "Invalid output configuration",
        "the length of SyncManager 2 (outputs) differs from the mapping",
    ),
    StatusCode(
        0x001E,
        "Invalid input configuration",
        "the length of SyncManager 3 (inputs) differs from the mapping",
    ),
    StatusCode(
        0x001F, "Invalid watchdog configuration", "check registers 0x0400, 0x0410 and 0x0420"
    ),
    StatusCode(0x0020, "Device needs cold start", "power-cycle the device"),
    StatusCode(0x0021, "Device needs INIT", "bring it to INIT first"),
    StatusCode(0x0022, "Device needs PRE-OP", "bring it to PRE-OP first"),
    StatusCode(0x0023, "Device needs SAFE-OP", "bring it to SAFE-OP first"),
    StatusCode(
        0x0024,
        "Invalid input mapping",
        "check the PDOs (0x1A00 and above) and their assignment (0x1C13)",
    ),
    StatusCode(
        0x0025,
        "Invalid output mapping",
        "check the PDOs (0x1600 and above) and their assignment (0x1C12)",
    ),
    StatusCode(
        0x0026, "Inconsistent settings", "mapping, modes or cycle times contradict each other"
    ),
    StatusCode(
        0x0027, "Free run not supported", "the device needs SyncManager or DC synchronisation"
    ),
    StatusCode(
        0x0028, "Synchronization not supported", "check the mode in 0x1C32:01 and 0x1C33:01"
    ),
    StatusCode(
        0x0029, "Free run needs 3-buffer mode", "a process data SyncManager is in mailbox mode"
    ),
    StatusCode(
        0x002A, "Background watchdog", "the application in the device has stopped responding"
    ),
    StatusCode(
        0x002B, "No valid inputs and outputs", "no process data arrived: check that the loop runs"
    ),
    StatusCode(
        0x002C,
        "Fatal synchronization error",
        "SYNC0 is missing, or is not synchronous with the process data",
    ),
    StatusCode(
        0x002D, "No synchronization error", "the SYNC signal or the process data did not arrive"
    ),
    StatusCode(0x002E, "Cycle time too small", "choose a longer period"),
    StatusCode(
        0x0030,
        "Invalid DC SYNC configuration",
        "check register 0x0981, and objects 0x1C32 and 0x1C33",
    ),
    StatusCode(0x0031, "Invalid DC latch configuration", "check registers 0x09A8 and 0x09A9"),
    StatusCode(
        0x0032, "PLL error", "the loop's jitter or start time is outside the device's tolerance"
    ),
    StatusCode(0x0033, "DC sync I/O error", "the device failed at a SYNC event"),
    StatusCode(0x0034, "DC sync timeout error", "SYNC0 or process data stopped"),
    StatusCode(0x0035, "DC invalid sync cycle time", "the device does not support this period"),
    StatusCode(0x0036, "DC SYNC0 cycle time", "the device rejects the SYNC0 cycle time 0x09A0"),
    StatusCode(0x0037, "DC SYNC1 cycle time", "the device rejects the SYNC1 cycle time 0x09A4"),
    StatusCode(0x0041, "Mailbox AoE", "ADS over EtherCAT failed"),
    StatusCode(0x0042, "Mailbox EoE", "Ethernet over EtherCAT failed"),
    StatusCode(0x0043, "Mailbox CoE", "a start-up object was refused or is missing"),
    StatusCode(0x0044, "Mailbox FoE", "file access failed"),
    StatusCode(0x0045, "Mailbox SoE", "servo profile access failed"),
    StatusCode(0x004F, "Mailbox VoE", "the vendor-specific mailbox protocol failed"),
    StatusCode(0x0050, "EEPROM no access", "assign the EEPROM to the PDI (register 0x0500)"),
    StatusCode(0x0051, "EEPROM error", "the device could not read its EEPROM"),
    StatusCode(0x0052, "External hardware not ready", "check the supply of its power stage"),
    StatusCode(
        0x0060,
        "Device restarted locally",
        "its power failed for a moment, or its own watchdog expired",
    ),
    StatusCode(0x0061, "Device identification value updated", "its selector switch was changed"),
    StatusCode(
        0x0070,
        "Detected module ident list does not match",
        "0xF030 (configured) and 0xF050 (detected) differ",
    ),
    StatusCode(0x0080, "Supply voltage too low", "check the supply"),
    StatusCode(0x0081, "Supply voltage too high", "check the supply; braking energy raises it"),
    StatusCode(0x0082, "Temperature too low"),
    StatusCode(0x0083, "Temperature too high", "check cooling and load"),
    StatusCode(0x00F0, "Application controller available"),
)

STATUS_CODES = {entry.code: entry for entry in _CODES}
