"""Contents of the events in a timeline: frozen values, with `kind` and a text for people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from catenary.capture.mailbox_contents import (
    EmergencyReceived,
    MailboxFault,
    MailboxMessage,
    SdoInformationRead,
    SdoTransfer,
)
from catenary.capture.register_contents import (
    EepromAssigned,
    EepromWrite,
    FmmuWrite,
    RegisterWrite,
    SyncManagerWrite,
    SyncUnitWrite,
)
from catenary.capture.text import duration, not_accepted
from catenary.wire.al import AlState, status_code
from catenary.wire.datagram import EcatCommand


@dataclass(frozen=True, slots=True)
class AddressAssigned:
    """The master wrote the station address of the device at a position."""

    kind: ClassVar[str] = "address"
    position: int
    station: int

    def __str__(self) -> str:
        return f"station address 0x{self.station:04X} for position {self.position}"


@dataclass(frozen=True, slots=True)
class IdentityRead:
    """The master read the identity from the EEPROM. `serial`: None if it was not read yet."""

    kind: ClassVar[str] = "identity"
    vendor: int
    product: int
    revision: int
    serial: int | None = None

    def __str__(self) -> str:
        serial = "" if self.serial is None else f" serial {self.serial}"
        return (
            f"vendor 0x{self.vendor:08X} product 0x{self.product:08X} "
            f"revision 0x{self.revision:08X}{serial}"
        )


@dataclass(frozen=True, slots=True)
class NameRead:
    """The master read the name of the device, from the EEPROM or object 0x1008."""

    kind: ClassVar[str] = "name"
    name: str
    order: str = ""  # order code in the EEPROM

    def __str__(self) -> str:
        return f"name {self.name!r}" + (f" order {self.order!r}" if self.order else "")


@dataclass(frozen=True, slots=True)
class StateRequest:
    """The master requested a state. `accepted` is False if no device took the request."""

    kind: ClassVar[str] = "state-request"
    state: AlState
    acknowledge: bool = False
    accepted: bool = True

    def __str__(self) -> str:
        acknowledge = ", error acknowledged" if self.acknowledge else ""
        return f"{self.state} requested{acknowledge}{not_accepted(self.accepted)}"


@dataclass(frozen=True, slots=True)
class StateReached:
    """The device reported a new state. `after_ns` is the time since the request."""

    kind: ClassVar[str] = "state"
    state: AlState
    after_ns: int | None = None

    def __str__(self) -> str:
        after = "" if self.after_ns is None else f" after {duration(self.after_ns)}"
        return f"{self.state}{after}"


@dataclass(frozen=True, slots=True)
class StateRefused:
    """The device reported an error in AL status. `code`: None if it was not read."""

    kind: ClassVar[str] = "state-error"
    state: AlState  # the actual state
    requested: AlState | None
    code: int | None = None
    before: AlState | None = None  # the last state before the error

    @property
    def fell(self) -> bool:
        """True if the device left a state that it had reached, without a request."""
        return self.before is not None and self.before is self.requested is not self.state

    def __str__(self) -> str:
        if self.fell:
            text = f"fell from {self.before} to {self.state}"
        elif self.requested in (None, self.state):
            text = f"error in {self.state}"
        else:
            text = f"{self.requested} refused in {self.state}"
        if self.code is None:
            return f"{text}: AL status code not read"
        found = status_code(self.code)
        cause = f" ({found.cause})" if found.cause else ""
        return f"{text}: 0x{self.code:04X} {found.text}{cause}"


@dataclass(frozen=True, slots=True)
class CyclicStart:
    """The first frame with a logical datagram. Its layout has the statistics number `layout`."""

    kind: ClassVar[str] = "cyclic"
    layout: int
    text: str

    def __str__(self) -> str:
        return f"process data begins: {self.text}"


@dataclass(frozen=True, slots=True)
class WorkingCounterDrop:
    """A logical datagram returned with a smaller working counter than before."""

    kind: ClassVar[str] = "working-counter"
    command: EcatCommand
    address: int
    length: int
    expected: int  # the largest working counter since the last change of states
    received: int

    def __str__(self) -> str:
        return f"{_logical(self)} working counter {self.received} instead of {self.expected}"


@dataclass(frozen=True, slots=True)
class WorkingCounterBack:
    """A logical datagram has its expected working counter again."""

    kind: ClassVar[str] = "working-counter-back"
    command: EcatCommand
    address: int
    length: int
    received: int
    frames: int  # number of frames with a smaller working counter
    lasted_ns: int

    def __str__(self) -> str:
        return (
            f"{_logical(self)} working counter {self.received} again, after {self.frames} frames "
            f"in {duration(self.lasted_ns)}"
        )


@dataclass(frozen=True, slots=True)
class FramesLost:
    """Consecutive frames returned to the master with no answer in the capture."""

    kind: ClassVar[str] = "lost"
    count: int

    def __str__(self) -> str:
        return f"{self.count} frames without an answer"


@dataclass(frozen=True, slots=True)
class ClockDifference:
    """The system time difference of a device crossed 1 us, 10 us, 100 us ... in a read of it."""

    kind: ClassVar[str] = "clock"
    difference_ns: int

    def __str__(self) -> str:
        return f"clock difference {duration(self.difference_ns)}"


@dataclass(frozen=True, slots=True)
class DeviceSilent:
    """The device did not answer a read of its AL status; `silent` is False if it answers again."""

    kind: ClassVar[str] = "silent"
    silent: bool = True

    def __str__(self) -> str:
        return "does not answer (working counter 0)" if self.silent else "answers again"


@dataclass(frozen=True, slots=True)
class DeviceCount:
    """A broadcast reached another number of devices than before."""

    kind: ClassVar[str] = "device-count"
    count: int
    before: int | None = None

    def __str__(self) -> str:
        before = "" if self.before is None else f" instead of {self.before}"
        return f"{self.count} devices answer{before}"


Content: TypeAlias = (
    AddressAssigned
    | IdentityRead
    | NameRead
    | StateRequest
    | StateReached
    | StateRefused
    | SdoTransfer
    | SdoInformationRead
    | EmergencyReceived
    | MailboxMessage
    | MailboxFault
    | RegisterWrite
    | SyncManagerWrite
    | FmmuWrite
    | SyncUnitWrite
    | EepromAssigned
    | EepromWrite
    | CyclicStart
    | WorkingCounterDrop
    | WorkingCounterBack
    | FramesLost
    | ClockDifference
    | DeviceSilent
    | DeviceCount
)


def _logical(of: WorkingCounterDrop | WorkingCounterBack) -> str:
    return f"{of.command.name} 0x{of.address:08X} ({of.length} bytes)"
