"""All errors of the package.

A message gives the device, the request, the reply, the likely cause and the next step. The numbers
are attributes.

A caller's mistake raises ValueError or TypeError before anything is sent. The errors here report
faults of a device, the network or the machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.log import Log


class CatenaryError(Exception):
    """Base of all errors. `hint` is the next step, without a full stop at the end."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  hint: {self.hint}" if self.hint else self.message


class DecodeError(CatenaryError):
    """Bytes that are not valid in their format. Decoders raise no other error."""


class ConfigurationError(CatenaryError):
    """An invalid file or device configuration. The message names the file, field or object."""


class MachineFileError(ConfigurationError):
    """A machine file that cannot be read or used.

    `path`, `line` and `key` locate the mistake. `line` and `key` are None if it concerns the whole
    file.
    """

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


class CloneError(ConfigurationError):
    """A clone folder that cannot be read. `file` and `line` locate the mistake, `reason` describes
    it without the place.

    `line` is None if it concerns the whole file.
    """

    def __init__(self, message: str, *, file: str, line: int | None = None, hint: str = "") -> None:
        place = ":".join(str(part) for part in (file, line) if part is not None)
        super().__init__(f"{place}: {message}", hint=hint)
        self.reason = message
        self.file = file
        self.line = line


class EsiError(CatenaryError):
    """An ESI file that cannot be used. `file` and `line` locate the fault, `reason` describes
    it without the place.

    `line` is None if the fault concerns the whole file.
    """

    def __init__(self, message: str, *, file: str, line: int | None = None, hint: str = ""):
        place = ":".join(str(part) for part in (file, line) if part is not None)
        super().__init__(f"{place}: {message}", hint=hint)
        self.reason = message
        self.file = file
        self.line = line


class EsiLookupError(EsiError):
    """A device without a suitable description in a library, or a name that several devices have.

    `candidates` lists the descriptions that could be meant.
    """

    def __init__(
        self, message: str, *, file: str, candidates: tuple[str, ...] = (), hint: str = ""
    ) -> None:
        super().__init__(message, file=file, hint=hint)
        self.candidates = candidates


class LinkError(CatenaryError):
    """A network interface that cannot be used: unknown, down, without permission, or in use by
    another master."""


class NoDeviceError(CatenaryError):
    """No EtherCAT device answered the frames that were sent."""


class ResponseTimeout(CatenaryError):
    """A device, or the whole segment, did not answer by a deadline."""


class SegmentError(CatenaryError):
    """The segment changed or is inconsistent: a device was added, is missing, or answers twice."""


class IdentityError(CatenaryError):
    """A device differs from the expected one."""

    def __init__(
        self, message: str, *, position: int, expected: object, found: object, hint: str = ""
    ) -> None:
        super().__init__(message, hint=hint)
        self.position = position
        self.expected = expected
        self.found = found


class RegisterError(CatenaryError):
    """An access to the registers or the memory of a device failed or was rejected."""


class EepromError(CatenaryError):
    """The SII could not be read or written."""


class MailboxError(CatenaryError):
    """A mailbox service failed: a device does not support it, did not answer, answered with a
    mailbox error, or violated the protocol."""


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


class FoeError(CatenaryError):
    """A device refused a file (ETG.1000.6 §5.8.6). `text` is the text that it sent, if any."""

    def __init__(
        self, message: str, *, position: int, name: str, code: int, text: str = "", hint: str = ""
    ) -> None:
        super().__init__(message, hint=hint)
        self.position = position
        self.name = name
        self.code = code
        self.text = text


class EoeError(CatenaryError):
    """A device refused an address or a filter of its Ethernet port (ETG.1000.6 §5.7)."""

    def __init__(self, message: str, *, position: int, result: int, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.position = position
        self.result = result


class TapError(CatenaryError):
    """A TAP interface of this machine cannot be used."""


class AdsError(CatenaryError):
    """A device refused an ADS request (AoE, ETG.1020). `code` is its error code."""

    def __init__(self, message: str, *, position: int, code: int, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.position = position
        self.code = code


class FirmwareError(CatenaryError):
    """A firmware update failed: it was interrupted, or the device does not report the expected
    firmware afterwards."""


class StateError(CatenaryError):
    """A device refused an EtherCAT state, did not reach it in time, or left it.

    `log` holds the last cycles if the error occurred in a loop.
    """

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
    """A process-data request that a device cannot fulfil. The message names the object."""


class LoopError(CatenaryError):
    """The cyclic exchange could not continue. `log` holds the last cycles, oldest first."""

    def __init__(self, message: str, *, log: Log | None = None, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.log = log


class ClockError(LoopError):
    """Distributed clocks cannot be set up, do not synchronise, or have lost their reference."""


class WorkingCounterError(LoopError):
    """Devices stopped answering in the cyclic exchange. The message names them."""


class DriveError(LoopError):
    """A drive is in fault, cannot be enabled, or was stopped without a request."""


class MoveError(DriveError):
    """A move that ended before its target.

    `axis` is the name of the axis. `remaining` is the target minus the actual position [rad] or,
    for a linear axis, [m]. It is NaN during homing.
    """

    def __init__(
        self, message: str, *, axis: str, remaining: float, log: Log | None = None, hint: str = ""
    ) -> None:
        super().__init__(message, log=log, hint=hint)
        self.axis = axis
        self.remaining = remaining


class RealtimeError(CatenaryError):
    """The machine does not meet a real-time requirement. The hint shows how to meet it."""


class TaskError(RealtimeError):
    """A task raised an error, died, missed its deadline, or did not end."""

    def __init__(self, message: str, *, task: str, exit_code: int | None = None, hint: str = ""):
        super().__init__(message, hint=hint)
        self.task = task
        self.exit_code = exit_code


class LawError(LoopError):
    """A control law cannot be compiled, or it failed and stopped the drives."""


class ShareError(CatenaryError):
    """A share that does not exist, cannot be opened or is invalid. The message names the share."""


class LeaseError(ShareError):
    """Axes that another client commands, or that this client no longer commands."""


class BusyError(ShareError):
    """Requests to a share that exceed its limit. Repeat the request after `retry` [s]."""

    def __init__(self, message: str, *, retry: float = 0.01, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.retry = retry


class RequestRefused(ShareError):
    """A request for an operating mode or a preset that the program of a share refused.

    The message is the reason of the program.
    """


class RecordingError(CatenaryError):
    """A recording that cannot be written or read."""
