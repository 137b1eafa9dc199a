"""All errors of the package. Each says which device, what was asked, what came back, the likely
cause and what to do next; the numbers are attributes.

A caller's mistake is a ValueError or TypeError before anything is sent; these are a peer's, the
network's or the machine's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.log import Log


class CatenaryError(Exception):
    """Base of all. `hint` is the next thing to do, without a full stop at its end."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  hint: {self.hint}" if self.hint else self.message


class DecodeError(CatenaryError):
    """Bytes that are no value of the format: the only error a decoder raises."""


class ConfigurationError(CatenaryError):
    """A file or a wish that cannot be: names the file, field or object."""


class MachineFileError(ConfigurationError):
    """A machine file that cannot be read or used. `path`, `line` and `key` name the place; None:
    the file as a whole."""

    def __init__(
        self,
        message: str,
        *,
        path: str,
        line: int | None = None,
        key: str | None = None,
        hint: str = "",
    ) -> None:
        place = ":".join(str(part) for part in (path, line) if part is not None)
        super().__init__(": ".join(filter(None, (place, key, message))), hint=hint)
        self.path = path
        self.line = line
        self.key = key


class LinkError(CatenaryError):
    """A network interface that cannot be used: unknown, down, not permitted, or in use by another
    master."""


class NoDeviceError(CatenaryError):
    """Frames went out and no EtherCAT device answered."""


class ResponseTimeout(CatenaryError):
    """A device, or the whole segment, did not answer by a deadline."""


class SegmentError(CatenaryError):
    """The segment changed or contradicts itself: a device more, fewer, or answering twice."""


class IdentityError(CatenaryError):
    """A device is not the one expected."""

    def __init__(
        self, message: str, *, position: int, expected: object, found: object, hint: str = ""
    ) -> None:
        super().__init__(message, hint=hint)
        self.position = position
        self.expected = expected
        self.found = found


class RegisterError(CatenaryError):
    """A device answers, but not to this access of its registers or memory."""


class EepromError(CatenaryError):
    """The SII could not be read or written."""


class MailboxError(CatenaryError):
    """A device answered a mailbox service with a mailbox error, or against the protocol."""


class SdoAbort(CatenaryError):
    """A device refused an SDO service (ETG.1000.6 §5.6.2.7)."""

    def __init__(
        self, message: str, *, position: int, index: int, subindex: int, code: int, hint: str = ""
    ) -> None:
        super().__init__(message, hint=hint)
        self.position = position
        self.index = index
        self.subindex = subindex
        self.code = code


class StateError(CatenaryError):
    """A device refused an EtherCAT state, did not reach it in time, or left it. `log`: the last
    cycles where that happened in a loop."""

    def __init__(
        self,
        message: str,
        *,
        position: int,
        requested: int,
        actual: int,
        code: int,
        log: Log | None = None,
        hint: str = "",
    ) -> None:
        super().__init__(message, hint=hint)
        self.log = log
        self.position = position
        self.requested = requested
        self.actual = actual
        self.code = code


class MappingError(CatenaryError):
    """A wish for process data that a device cannot fulfil: names the object."""


class LoopError(CatenaryError):
    """The cyclic exchange could not go on. `log` holds the last cycles, oldest first."""

    def __init__(self, message: str, *, log: Log | None = None, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.log = log


class ClockError(LoopError):
    """Distributed clocks that cannot be set up, do not come together, or have lost their
    reference."""


class WorkingCounterError(LoopError):
    """Devices stopped answering in the cyclic exchange: names the silent ones."""


class DriveError(LoopError):
    """A drive is in fault, cannot be enabled, or was stopped without a request."""


class MoveError(DriveError):
    """A move that ended before its goal. `axis`: its name; `remaining`: goal minus actual position
    [rad], of a linear axis [m]; NaN in homing."""

    def __init__(
        self, message: str, *, axis: str, remaining: float, log: Log | None = None, hint: str = ""
    ) -> None:
        super().__init__(message, log=log, hint=hint)
        self.axis = axis
        self.remaining = remaining


class RealtimeError(CatenaryError):
    """The machine does not give what real time needs: says what, and how to get it."""


class TaskError(RealtimeError):
    """A task raised, died, missed a deadline that stops it, or would not end."""

    def __init__(self, message: str, *, task: str, exit_code: int | None = None, hint: str = ""):
        super().__init__(message, hint=hint)
        self.task = task
        self.exit_code = exit_code


class LawError(LoopError):
    """A control law that cannot be compiled, or that failed and stopped the drives."""


class ShareError(CatenaryError):
    """A share that is not there, not to be opened, or no share: names it and what there is."""


class LeaseError(ShareError):
    """Axes that another client commands, or that this one commands no longer."""


class RecordingError(CatenaryError):
    """A recording that cannot be written or read."""
