"""Settings of a device that only its ESI file contains (ETG.2000).

A `source` is file and line of the setting.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ModeAssignment:
    """PDOs that an OpMode assigns to one SyncManager (`OpMode/Sm`)."""

    sync_manager: int
    pdos: tuple[int, ...]
    oversampling: tuple[int, ...] = ()  # number of copies of each PDO; empty: one of each


@dataclass(frozen=True, slots=True)
class NamedMapping:
    """Assignment of PDOs with a name (`AlternativeSmMapping` of an ESI file)."""

    name: str
    default: bool
    pdos: tuple[tuple[int, tuple[int, ...]], ...]  # SyncManager, PDO indices
    source: str = ""


@dataclass(frozen=True, slots=True)
class InitCommand:
    """Object that an ESI file requires to be written at state transitions (`CoE/InitCmd`)."""

    transitions: tuple[str, ...]  # such as ("PS",): PRE-OP to SAFE-OP
    index: int
    subindex: int
    data: bytes
    complete_access: bool = False
    fixed: bool = False  # an object of the application is written after it, not in its place
    comment: str = ""
    source: str = ""


@dataclass(frozen=True, slots=True)
class IdnCommand:
    """IDN that an ESI or ENI requires to be written at state transitions (`SoE/InitCmd`)."""

    transitions: tuple[str, ...]  # such as ("PS",): PRE-OP to SAFE-OP
    number: int  # IDN
    data: bytes  # a list begins with its lengths
    drive: int = 0
    element: int = 0x40  # the value
    comment: str = ""
    source: str = ""


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Timeouts of state changes and the mailbox [s]; None if unknown."""

    pre_op: float | None = None
    safe_op_and_op: float | None = None
    back_to_init: float | None = None
    back_to_safe_op: float | None = None
    mailbox_request: float | None = None
    mailbox_response: float | None = None


@dataclass(frozen=True, slots=True)
class WatchdogValues:
    """Watchdog registers that an ESI file requests; None: not stated."""

    divider: int | None = None  # register 0x0400
    pdi: int | None = None  # register 0x0410
    process_data: int | None = None  # register 0x0420


NO_TIMEOUTS = Timeouts()
NO_WATCHDOG_VALUES = WatchdogValues()
