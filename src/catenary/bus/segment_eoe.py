"""SegmentEoe: the Ethernet ports of all devices of a segment."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Protocol

from catenary.bus.ethernet_bridge import EthernetBridge
from catenary.bus.ethernet_port import PortMain
from catenary.bus.event_queue import Events
from catenary.bus.event_types import EthernetDropped
from catenary.bus.sub_device import SubDevice
from catenary.errors import CatenaryError, ConfigurationError
from catenary.link import Link
from catenary.link.tap import Tap
from catenary.wire.sii import MailboxProtocol


class SegmentMain(PortMain, Protocol):
    """Interface to a MainDevice."""

    @property
    def subs(self) -> Sequence[SubDevice]: ...

    @property
    def events(self) -> Events: ...

    @property
    def link(self) -> Link: ...


class SegmentEoe:
    """Ethernet ports of all devices of a segment: `main.eoe`."""

    def __init__(self, main: SegmentMain) -> None:
        self._main = main
        self._open: list[EthernetBridge] = []

    def connect(
        self, tap: str, subs: Sequence[SubDevice] | None = None, *, forward: bool = False
    ) -> EthernetBridge:
        """Connect a TAP interface of this machine to devices, in a `with` block.

            with main.eoe.connect("cat0"):
                ...

        Args:
            tap: Name of the TAP interface. See `Eoe.connect`.
            subs: The devices; None for all devices with EoE in their SII.
            forward: True if frames between these devices are forwarded. Frames are never forwarded
                to another interface of this machine, unless you bridge it yourself.

        Raises:
            TapError: The TAP does not exist, is down or in use, or belongs to another user.
            ConfigurationError: No device states EoE.
            MailboxError: A device has no mailbox, or a mailbox that is too small.
            ValueError: `subs` is empty, or contains a device twice.
        """
        chosen = self.devices if subs is None else list(subs)
        if not chosen and subs is None:
            raise ConfigurationError(
                "no device of the last scan has EoE in its SII",
                hint="scan first, or name the devices: main.eoe.connect(tap, [main.subs[1]])",
            )
        if not chosen or len({sub.position for sub in chosen}) != len(chosen):
            raise ValueError("connect needs at least one device, and each device only once")
        for sub in chosen:
            sub.eoe.channel()
        self._check_free(chosen)
        bridge = EthernetBridge(self._main, chosen, Tap(tap), forward=forward, report=self._report)
        self._open.append(bridge)
        return bridge

    def connect_position(self, tap: str, position: int) -> EthernetBridge:
        """Connect a TAP to the device at a position. See `Eoe.connect`."""
        return self.connect(tap, [self._main.subs[position]])

    @property
    def devices(self) -> list[SubDevice]:
        """Devices of the last scan with EoE in their SII."""
        return [
            sub
            for sub in self._main.subs
            if sub.channel is not None and MailboxProtocol.EOE in sub.channel.layout.protocols
        ]

    def close(self) -> None:
        """Close all connections."""
        for bridge in self._open:
            bridge.close()
        self._open.clear()

    def _check_free(self, subs: Sequence[SubDevice]) -> None:
        self._open = [bridge for bridge in self._open if bridge.is_open]
        for bridge in self._open:
            for sub in subs:
                if sub.position in bridge.positions:
                    raise ConfigurationError(
                        f"{sub.station} is already connected to {bridge.name}",
                        hint="close that connection first",
                    )

    def _report(self, sub: SubDevice, new: Counter[str], error: CatenaryError | None) -> None:
        """Put an event for new drops of a device."""
        now = self._main.link.now() * 1e-9
        reasons = ", ".join(f"{count} × {reason}" for reason, count in sorted(new.items()))
        cause = f" ({error.message})" if error is not None else ""
        message = f"{sub.station}: Ethernet frames dropped: {reasons}{cause}"
        self._main.events.put(EthernetDropped(now, sub, message, new.total(), dict(new)))
