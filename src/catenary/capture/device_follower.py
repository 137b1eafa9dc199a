"""One device of a capture: what a master has written to it and read from it."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.capture.clocks import ClockLevel
from catenary.capture.contents import Content, IdentityRead, NameRead
from catenary.capture.eeprom_reads import EepromReads
from catenary.capture.events import Device
from catenary.capture.mailbox_contents import SdoTransfer
from catenary.capture.mailbox_follower import MailboxFollower
from catenary.capture.register_contents import RegisterWrite
from catenary.capture.register_writes import (
    Written,
    is_clock_update,
    is_configuration,
    is_eeprom,
    register_writes,
)
from catenary.capture.registers import WrittenRegisters
from catenary.capture.states import Found, StateFollower
from catenary.capture.transaction import Transaction

_DEVICE_NAME, _IDENTITY = 0x1008, 0x1018


class DeviceFollower:
    """Owner of the known properties of one device."""

    def __init__(self, number: int, position: int | None, station: int | None) -> None:
        self.number = number
        self.position = position
        self.station = station
        self.states = StateFollower()
        self.registers = WrittenRegisters()
        self.clock = ClockLevel()
        self._eeprom = EepromReads()
        self._mailbox = MailboxFollower(self.registers)
        self._identity: IdentityRead | None = None
        self._name: NameRead | None = None
        self._objects: dict[int, int] = {}  # entries of object 0x1018
        self._clock_written = False

    def follow(self, each: Transaction) -> Iterator[Found]:
        """Follow a datagram to this device."""
        yield from self.states.follow(each)
        if each.written is not None:
            for written in self._written(each, each.written):
                yield Found(self.states.step(configures=is_configuration(written)), written)
        for content in self._eeprom_contents(each):
            yield Found(self.states.step(), content)
        for content in self._mailbox.follow(each):
            yield Found(self.states.step(), content)
            if isinstance(content, SdoTransfer):
                yield from self._from_object(content)
        difference = self.clock.follow(each)
        if difference:
            yield Found(self.states.step(), difference)

    def store(self, address: int, data: bytes) -> None:
        """Store a write by a broadcast.

        Args:
            address: Address of the first byte.
            data: The written bytes.
        """
        self.registers.write(address, data)
        self._mailbox.configure(address, len(data))

    def flush(self) -> Iterator[Found]:
        """Yield what was not answered at the end of the capture."""
        yield from self.states.flush()
        for content in self._mailbox.sdo.unanswered():
            yield Found(self.states.step(), content)

    def snapshot(self) -> Device:
        """Return the known properties."""
        identity, name = self._identity, self._name
        return Device(
            *(self.number, self.position, self.station),
            identity.vendor if identity else None,
            identity.product if identity else None,
            identity.revision if identity else None,
            identity.serial if identity else None,
            name.name if name else "",
            name.order if name else "",
            self.states.state,
        )

    def _written(self, each: Transaction, data: bytes) -> Iterator[Written]:
        for content in register_writes(self.registers, each.ado, data, accepted=each.accepted):
            if isinstance(content, RegisterWrite) and is_clock_update(each.ado):
                if self._clock_written:
                    continue
                self._clock_written = True
            yield content
        self._mailbox.configure(each.ado, len(data))

    def _eeprom_contents(self, each: Transaction) -> Iterator[Content]:
        if not is_eeprom(each.ado):
            return
        found = self._eeprom.follow(each)
        if found is None:
            return
        if not isinstance(found, bool):
            yield found
            return
        identity, name = self._eeprom.identity(), self._eeprom.name()
        if identity and identity != self._identity:
            self._identity = identity
            yield identity
        if name and name != self._name:
            self._name = name
            yield name

    def _from_object(self, transfer: SdoTransfer) -> Iterator[Found]:
        """Use the objects for name and identity, unless the EEPROM was read."""
        if transfer.writes or not transfer.succeeded or transfer.complete_access:
            return
        if transfer.index == _DEVICE_NAME and self._name is None:
            self._name = NameRead(transfer.data.rstrip(b"\x00").decode("latin-1"))
            yield Found(self.states.step(), self._name)
        if transfer.index == _IDENTITY and transfer.subindex and self._identity is None:
            self._objects[transfer.subindex] = int.from_bytes(transfer.data[:4], "little")
            if self._objects.keys() >= {1, 2, 3}:
                vendor, product, revision = (self._objects[i] for i in (1, 2, 3))
                self._identity = IdentityRead(vendor, product, revision, self._objects.get(4))
                yield Found(self.states.step(), self._identity)
