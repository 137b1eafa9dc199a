"""Events of a segment, as frozen values.

While a loop is open, `time` [s] is on the clock of `cycle.time`: it counts from the first iteration
and is negative during start-up. Without a loop, or before the first iteration, it is on the link's
clock (`time.monotonic()` on a NIC). `sub` is the device of the event, or None for an event of the
segment. `message` describes the event as text. The other fields are for programs:

    for event in main.events:
        match event:
            case events.Emergency(sub=sub, error_code=0x8611):
                ...
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from catenary.model.device import Identity
from catenary.model.finding import Finding
from catenary.plan.stop_reason import StopReason
from catenary.wire import coe, soe
from catenary.wire.drive_error import error_text
from catenary.wire.sercos import idn_text

if TYPE_CHECKING:
    from catenary.bus.sub_device import SubDevice


@dataclass(frozen=True, slots=True)
class Event:
    """Base class of all events."""

    gives_way: ClassVar[bool] = False  # True if a full queue drops it before other events

    time: float
    sub: SubDevice | None
    message: str

    def __str__(self) -> str:
        return f"{self.time:.3f} s: {self.message}"


@dataclass(frozen=True, slots=True)
class Emergency(Event):
    """Fault reported by a device (ETG.1000.6 §5.6.4). Error code 0 reports the end of a fault."""

    error_code: int
    error_register: int  # object 0x1001
    data: bytes  # 5 bytes, manufacturer-specific

    @property
    def text(self) -> str:
        """Meaning of the error code according to IEC 61800-7-201 and CiA 301."""
        return error_text(self.error_code)


@dataclass(frozen=True, slots=True)
class SoeNotification(Event):
    """Change of a procedure command that a SERCOS drive reports (ETG.1000.6 §5.9)."""

    idn: int
    drive: int
    elements: int
    data: bytes


@dataclass(frozen=True, slots=True)
class SoeEmergency(Event):
    """Fault reported by a SERCOS drive (ETG.1000.6 §5.9). S-0-0095 has its text.

    The manual of the drive explains the data.
    """

    idn: int  # number in the header; 0 if the drive does not use it
    drive: int
    data: bytes


@dataclass(frozen=True, slots=True)
class DiagnosisReported(Event):
    """New message in the diagnosis history of a device (object 0x10F3); see `Loop(diagnosis=...)`.

    `text` is that of the device's ESI file, or a description of the numbers.
    """

    severity: str  # "info", "warning", "error", or "type N"
    text: str
    code: int  # diagnosis code, 32 bits
    text_id: int  # 0: none
    parameters: tuple[int | float | str | bytes, ...]


@dataclass(frozen=True, slots=True)
class SynchronisationFault(Event):
    """Increase of a device's counter of synchronisation errors; see `Loop(diagnosis=...)`.

    `counter` is "missed", "exceeded", "shift_too_short" or "error" (ETG.1020, subindices 0x0B,
    0x0C, 0x0D and 0x20).
    """

    index: int  # 0x1C32: outputs; 0x1C33: inputs
    counter: str
    count: int  # increase since the last reading
    total: int  # value of the counter


@dataclass(frozen=True, slots=True)
class EthernetDropped(Event):
    """Ethernet frames of a device (EoE) that were dropped since the last such event.

    There is at most one event per second and device. See `sub.eoe.connect`.
    """

    count: int
    reasons: dict[str, int]  # count by reason


@dataclass(frozen=True, slots=True)
class DeviceLost(Event):
    """Loss of a device: it no longer answers."""


@dataclass(frozen=True, slots=True)
class DeviceReturned(Event):
    """Return of a lost device, with the same identity."""


@dataclass(frozen=True, slots=True)
class DeviceReplaced(Event):
    """Another device in the place of a lost one."""

    expected: Identity
    found: Identity


@dataclass(frozen=True, slots=True)
class DeviceHeld(Event):
    """Device that returned but is not brought to OP.

    The cause is the policy, a failed attempt, or an identity that cannot be read.
    """

    state: int  # AL state in which it is held; 0 if unknown
    reason: str


@dataclass(frozen=True, slots=True)
class StateLost(Event):
    """Unrequested change of a device to another state."""

    expected: int  # AL state
    state: int
    code: int  # AL status code


@dataclass(frozen=True, slots=True)
class LinkLost(Event):
    """Loss of a link: the cable no longer carries frames.

    `between` holds the positions of the devices at its ends; None stands for the MainDevice.
    """

    between: tuple[int | None, int | None]


@dataclass(frozen=True, slots=True)
class LinkRestored(Event):
    """Return of a link: the cable carries frames again."""

    between: tuple[int | None, int | None]


@dataclass(frozen=True, slots=True)
class FaultFound(Event):
    """Fault of a cable, a device or its supply, found by error counters. Frames may still pass.

    `sub` is the faulty device, or the device after the faulty cable; for a fault of several
    devices, the last one.
    """

    finding: Finding


@dataclass(frozen=True, slots=True)
class DuplicateFrames(Event):
    """Many cyclic frames that returned more than once; `sub` is None.

    Suspect a loop in the wiring or a second sender.
    """

    count: int  # number of such frames in `interval`
    interval: float  # [s]


@dataclass(frozen=True, slots=True)
class ClockUnlocked(Event):
    """Loss of synchronisation: a clock or the phase exceeds the bound, or the reference is silent.

    `sub` is the device with the largest difference. It is the reference clock if this device does
    not answer, or if the phase of the cycle starts is off.
    """

    difference: float  # from the reference clock [s]; infinite if it has not been read
    bound: float  # [s]


@dataclass(frozen=True, slots=True)
class ClockLocked(Event):
    """Synchronisation reached: the differences of all clocks are within the bound.

    `sub` is None.
    """

    difference: float  # largest difference from the reference clock [s]
    bound: float  # [s]


@dataclass(frozen=True, slots=True)
class ExternalClockChanged(Event):
    """Change of the external clock that the cycle starts follow, or a jump of its time.

    `sub` is None.
    """

    state: Literal["seeking", "locked", "lost"]
    phase_error: float  # last lateness of a cycle start in the time of the clock [s]


@dataclass(frozen=True, slots=True)
class TriggerChanged(Event):
    """Change between cycle starts that follow the trigger of another process and those that do not.

    `sub` is None.
    """

    following: bool
    missed: int  # number of cycles so far that began without a trigger


@dataclass(frozen=True, slots=True)
class AxisStopped(Event):
    """Stop of an axis by the core, without a request from the application."""

    axis: str
    reason: StopReason
    cycle: int  # number of the cycle


@dataclass(frozen=True, slots=True)
class ModeRefused(Event):
    """Mode change that a drive refused; the axis continues in its former mode."""

    axis: str
    mode: int  # requested mode of operation (0x6060)


@dataclass(frozen=True, slots=True)
class GatewayWrite(Event):
    """Write access of a client of `cat.Gateway` to a device, after its end.

    A client can write without end. If the queue of events is full, the oldest of these events is
    therefore dropped before any other event.
    """

    gives_way: ClassVar[bool] = True

    peer: str  # protocol, address and port of the client, such as "TCP 127.0.0.1:50000"
    what: str  # the access, such as "SDO download 0x6065:00"
    result: str  # "done", or the answer of the device
    index: int | None  # object; None for files and other protocols
    subindex: int | None
    data: bytes  # its first bytes, at most 16


@dataclass(frozen=True, slots=True)
class Marker(Event):
    """Mark in the sequence of cycles, set by the application with `MainDevice.mark`."""


def emergency(time: float, sub: SubDevice, message: coe.Emergency) -> Emergency:
    """Return the event for a device's emergency message.

    Args:
        time: Time of the message on the link's clock [s].
        sub: Device that sent it.
        message: Decoded message.
    """
    code, register = message.error_code, message.error_register
    what = (
        f"emergency 0x{code:04X} ({error_text(code)}), error register 0x{register:02X}"
        if code
        else "emergency cleared (error code 0)"
    )
    rest = f", data {message.data.hex(' ')}" if any(message.data) else ""
    return Emergency(time, sub, f"{sub.station}: {what}{rest}", code, register, message.data)


def soe_event(
    time: float, sub: SubDevice, message: soe.Message
) -> SoeNotification | SoeEmergency | None:
    """Return the event for a notification or emergency of a drive; None for other messages.

    Args:
        time: Time of the message on the link's clock [s].
        sub: Device that sent it.
        message: Decoded message.
    """
    drive = f" of drive {message.drive}" if message.drive else ""
    data = f", data {message.data.hex(' ')}" if message.data else ""
    if message.op_code is soe.OpCode.NOTIFICATION:
        what = f"{sub.station}: notification of {idn_text(message.number)}{drive}{data}"
        return SoeNotification(
            time, sub, what, message.number, message.drive, message.elements, message.data
        )
    if message.op_code is soe.OpCode.EMERGENCY:
        what = f"{sub.station}: SoE emergency{drive}{data}"
        return SoeEmergency(time, sub, what, message.number, message.drive, message.data)
    return None
