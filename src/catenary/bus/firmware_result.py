"""Values of a firmware update: its steps, options and result."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from catenary.bus.firmware_version import Reported
from catenary.errors import CatenaryError
from catenary.procedure.foe_exchange import ANSWER_TIMEOUT, BUSY_TIMEOUT
from catenary.wire.al import AlState

RESTART_TIMEOUT = 60.0  # [s] until the device returns with its new firmware


class Step(StrEnum):
    """Step of an update."""

    CHECK = "identity check"
    BOOT = "transition to BOOT"
    WRITE = "write"
    READ_BACK = "read-back"
    RESTART = "restart"
    VERIFY = "verification"


@dataclass(frozen=True, slots=True)
class FirmwareOptions:
    """Options of an update."""

    name: str  # of the file in the device
    password: int = 0
    vendor: int | None = None  # expected before the write; None: any
    product: int | None = None
    version: str | None = None  # expected in 0x100A afterwards; None: any
    read_back: bool = False  # compare the file in the device with the written one
    timeout: float = ANSWER_TIMEOUT  # [s] for each packet
    busy_timeout: float = BUSY_TIMEOUT  # [s]
    restart_timeout: float = RESTART_TIMEOUT  # [s]


class End(NamedTuple):
    """State of a device after an update, and the next step of the user after a failure."""

    state: AlState | None  # None: it does not answer
    reported: Reported | None  # None if it does not reach PRE-OP
    next_step: str = ""


class FirmwareResult(NamedTuple):
    """Result of an update."""

    before: Reported | None
    end: End
    step: Step  # last step
    error: CatenaryError | None  # None: the update succeeded
    seconds: float  # duration of the write [s]; 0 if there was none
    notes: tuple[str, ...]
