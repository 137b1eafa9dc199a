"""SubDevice: the handle of one device, valid across scans while its identity agrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar, overload

from catenary.errors import CatenaryError, MailboxError
from catenary.model.device import DeviceDescription, Identity
from catenary.procedure.al_state import DeviceState, read_state
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import download, upload
from catenary.procedure.station import Station
from catenary.types import DataType
from catenary.wire.al import State
from catenary.wire.coe import Emergency

if TYPE_CHECKING:
    from catenary.bus.main_device import MainDevice

T = TypeVar("T")


class SubDevice:
    """Owns what is known of one device. Attributes never cause traffic; calls with a verb do."""

    def __init__(
        self, main: MainDevice, description: DeviceDescription, channel: MailboxChannel | None
    ) -> None:
        self.main = main
        self.description = description
        self.channel = channel  # None: it has no mailbox
        self.state: State | None = None  # last known; None: unknown
        self.error: CatenaryError | None = None  # why the last scan could not bring it to PRE-OP
        self.sdo = Sdo(self)

    @property
    def position(self) -> int:
        return self.description.position

    @property
    def name(self) -> str:
        return self.description.name

    @property
    def order(self) -> str:
        """The manufacturer's order code; empty where its SII has none."""
        return self.description.order

    @property
    def identity(self) -> Identity:
        return self.description.identity

    @property
    def alias(self) -> int:
        """Station alias, 0: none."""
        return self.description.alias

    @property
    def is_drive(self) -> bool:
        """Whether it has CiA 402 axes."""
        return self.description.is_drive

    @property
    def slots(self) -> tuple[int, ...]:
        """Its CiA 402 axes: the objects of slot k lie 0x800·k above those of slot 0."""
        return self.description.slots

    @property
    def emergencies(self) -> tuple[Emergency, ...]:
        """The last emergencies it sent, whoever read them; oldest first."""
        heard = self.channel.emergencies if self.channel is not None else ()
        return tuple(each.emergency for each in heard)

    @property
    def station(self) -> Station:
        return Station(self.position, self.description.station_address, self.name)

    def read_state(self) -> DeviceState:
        """Asks for its EtherCAT state."""
        found = self.main.converse(read_state(self.station))
        self.state = found.state
        return found

    def __repr__(self) -> str:
        return f"<SubDevice {self.position} {self.name!r} {self.state or 'state unknown'}>"


class Sdo:
    """The object dictionary of one device: `sub.sdo.read(0x1018, 1, type=UDINT)`."""

    def __init__(self, sub: SubDevice) -> None:
        self._sub = sub

    @overload
    def read(self, index: int, subindex: int = 0) -> bytes: ...
    @overload
    def read(self, index: int, subindex: int = 0, *, type: DataType[T]) -> T: ...
    def read(self, index: int, subindex: int = 0, *, type: DataType[T] | None = None) -> T | bytes:
        """Reads an object: bytes, or with a `type` its value. SdoAbort if the device refuses."""
        channel = self._usable(index, subindex)
        data = self._sub.main.converse(upload(channel, index, subindex))
        return data if type is None else type.decode(data)

    @overload
    def write(self, index: int, subindex: int, value: bytes) -> None: ...
    @overload
    def write(self, index: int, subindex: int, value: T, *, type: DataType[T]) -> None: ...
    def write(
        self, index: int, subindex: int, value: object, *, type: DataType[T] | None = None
    ) -> None:
        """Writes an object: bytes, or with a `type` a value. SdoAbort if the device refuses."""
        channel = self._usable(index, subindex)
        data = value if type is None else type.encode(value)  # type: ignore[arg-type]
        if not isinstance(data, bytes):
            raise TypeError(f"give a type for {value!r}, or bytes: type=catenary.types.UDINT")
        self._sub.main.converse(download(channel, index, subindex, data))

    def _usable(self, index: int, subindex: int) -> MailboxChannel:
        if not 0 <= index <= 0xFFFF or not 0 <= subindex <= 0xFF:
            raise ValueError(f"object 0x{index:X}:{subindex:X}: an index has 16 bits, a subindex 8")
        channel = self._sub.channel
        if self._sub.error is not None:
            raise self._sub.error
        if channel is None or not channel.layout.coe:
            what = "has no mailbox" if channel is None else "does not speak CoE"
            raise MailboxError(
                f"{self._sub.station} {what}: object 0x{index:04X}:{subindex:02X} is out of reach",
                hint="couplers and simple terminals have no object dictionary",
            )
        return channel
