"""KernelAccess: the kernel master of a MainDevice, shared by its device handles and its cycle."""

from __future__ import annotations

from collections.abc import Sequence

from catenary import bus
from catenary.bus.master import MasterOwner
from catenary.errors import ConfigurationError, LoopError, SegmentError
from catenary.igh.address import place
from catenary.igh.configure import Configuration, DeviceConfiguration
from catenary.igh.reservation import Reservation


class KernelAccess:
    """Access to a kernel master and, while it is activated, to its configuration."""

    def __init__(self, main: MasterOwner) -> None:
        self.main = main
        self.active: Configuration | None = None  # None if the master is not activated

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
        """True while a loop runs. Requests are answered only during operation."""
        return self.main.has_loop

    def configuration_of(self, position: int) -> DeviceConfiguration | None:
        """Return the master's handles for a device; None if the master is not activated."""
        return None if self.active is None else self.active.devices[position]

    def place_of(self, position: int) -> int:
        """Return the current position of a device.

        During operation, a device that is addressed by an alias may have been moved on the line.

        Raises:
            SegmentError: The device is not on the segment.
        """
        device = self.configuration_of(position)
        if device is None or not device.address.alias:
            return position
        found = place(device.address, self.reservation.aliases())
        if found is None:
            raise SegmentError(
                f"{self.subs[position].station} is not on the segment: no device has the alias "
                f"{device.address.alias} by which it is addressed",
                hint="plug it in again; ethercat slaves shows the aliases",
            )
        return found

    def refuse_blocking(self, position: int) -> None:
        """Refuse a blocking call while the master is activated and no cycles run.

        An activated master sends its requests in the frames of the application. Without cycles,
        the call would wait forever.

        Raises:
            ConfigurationError: The call would wait forever.
        """
        if self.active is not None and not self.cycling:
            raise ConfigurationError(
                f"device {position}: the master is activated and answers only while cycles run",
                hint="read and write objects before it is activated, or in a Loop",
            )

    def same_configuration(self, device: DeviceConfiguration) -> None:
        """Check that the handles are still valid.

        Raises:
            LoopError: The loop has ended, and its handles are invalid.
        """
        if self.configuration_of(device.position) is not device:
            raise LoopError("the loop ended before the device answered", hint="repeat the request")
