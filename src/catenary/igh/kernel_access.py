"""KernelAccess: the kernel master of a MainDevice, as its devices and its cycle use it."""

from __future__ import annotations

from collections.abc import Sequence

from catenary import bus
from catenary.bus.master import MasterOwner
from catenary.errors import ConfigurationError, LoopError, SegmentError
from catenary.igh.address import place
from catenary.igh.configure import Configuration, DeviceConfiguration
from catenary.igh.reservation import Reservation


class KernelAccess:
    """Owns the handles of an activated kernel master."""

    def __init__(self, main: MasterOwner) -> None:
        self.main = main
        self.active: Configuration | None = None  # None: the master is not activated

    @property
    def subs(self) -> Sequence[bus.SubDevice]:
        """Handles of the devices, by position."""
        return self.main.subs

    @property
    def reservation(self) -> Reservation:
        """The reserved master."""
        link = self.main.link
        assert isinstance(link, Reservation)
        return link

    @property
    def cycling(self) -> bool:
        """True while a loop runs: requests are answered in operation only."""
        return self.main.has_loop

    def configuration_of(self, position: int) -> DeviceConfiguration | None:
        """The master's handles for a device; None: it is not activated."""
        return None if self.active is None else self.active.devices[position]

    def place_of(self, position: int) -> int:
        """Where a device is now: in operation one that has an alias, or is behind one, may have
        been plugged in elsewhere. SegmentError where it is nowhere."""
        device = self.configuration_of(position)
        if device is None or not device.address.alias:
            return position
        found = place(device.address, self.reservation.aliases())
        if found is None:
            raise SegmentError(
                f"{self.subs[position].station} is nowhere on the segment: no device has the alias "
                f"{device.address.alias} that leads to it",
                hint="ethercat slaves shows the aliases; plug it in again",
            )
        return found

    def refuse_blocking(self, position: int) -> None:
        """ConfigurationError where a call would wait for ever: an activated master answers through
        the frames of its application, and nobody sends them."""
        if self.active is not None and not self.cycling:
            raise ConfigurationError(
                f"device {position}: the master is activated, and answers only while cycles flow",
                hint="read and write objects before it is activated, or in a Loop",
            )

    def same_configuration(self, device: DeviceConfiguration) -> None:
        """LoopError where the handles are gone: the loop has ended meanwhile."""
        if self.configuration_of(device.position) is not device:
            raise LoopError("the loop has ended before the device answered", hint="ask again")
