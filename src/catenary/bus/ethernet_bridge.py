"""EthernetBridge: a TAP interface of this machine, and the Ethernet ports of devices (EoE)."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol, Self, TypeVar

from catenary.bus.ethernet_port import (
    EthernetCounts,
    EthernetPort,
    PortDevice,
    PortMain,
)
from catenary.bus.mac_table import MacTable, is_group
from catenary.bus.thread_priority import step_behind
from catenary.errors import CatenaryError, TapError

Device = TypeVar("Device", bound=PortDevice)

ACTIVE_MAX = 2  # ports that use acyclic frames at the same time: at most half of those of a cycle
BURST = 32  # frames that are read in a row
FULL_PAUSE = 2e-3  # [s] after a full queue: the kernel then drops the frames of a flood


class FrameInterface(Protocol):
    """Interface to the network stack of this machine; `link.tap.Tap` implements it."""

    @property
    def name(self) -> str: ...

    def wait(self, seconds: float | None = None) -> bool: ...

    def wake(self) -> None: ...

    def read(self) -> bytes | None: ...

    def write(self, frame: bytes) -> bool: ...

    def close(self) -> None: ...


class EthernetBridge:
    """Open connection between a TAP interface and devices, until the end of its `with` block.

    Frames of this machine go to the device with their destination address, or to all devices if it
    is not known. Frames of a device go to the TAP. With `forward`, they also go to other devices.
    """

    def __init__(
        self,
        main: PortMain,
        subs: Sequence[Device],
        interface: FrameInterface,
        *,
        report: Callable[[Device, Counter[str], CatenaryError | None], object],
        forward: bool = False,
    ) -> None:
        """Start the threads.

        Args:
            main: The MainDevice.
            subs: The devices.
            interface: The open interface. `close` closes it.
            report: Function that reports new drops of a device by reason, and its failure, if any.
            forward: True if frames between the devices are forwarded.
        """
        slots = threading.BoundedSemaphore(ACTIVE_MAX)
        self._interface = interface
        self._forward = forward
        self._table: MacTable[EthernetPort | FrameInterface] = MacTable()
        self._ports = [
            EthernetPort(sub, main, self._receive, slots, partial(report, sub)) for sub in subs
        ]
        self._fault: TapError | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._serve, name="catenary tap", daemon=True)
        for port in self._ports:
            port.start()
        self._thread.start()

    @property
    def name(self) -> str:
        """Name of the TAP interface."""
        return self._interface.name

    @property
    def positions(self) -> tuple[int, ...]:
        """Positions of the connected devices."""
        return tuple(port.sub.position for port in self._ports)

    @property
    def counts(self) -> Mapping[int, EthernetCounts]:
        """Present statistics by position of the device."""
        return {port.sub.position: port.counts for port in self._ports}

    @property
    def errors(self) -> Mapping[int, str]:
        """Present failures by position of the device; empty if all devices answer.

        If the TAP interface was deleted, all devices have this failure.
        """
        found = {port.sub.position: self._fault or port.error for port in self._ports}
        return {position: str(error) for position, error in found.items() if error is not None}

    @property
    def is_open(self) -> bool:
        """True until `close`."""
        return not self._ended

    def close(self) -> None:
        """End the threads and detach from the interface. No effect if it is closed."""
        if self._ended:
            return
        self._ended = True
        self._interface.wake()
        self._thread.join()
        for port in self._ports:
            port.close()
        self._interface.close()

    def _serve(self) -> None:
        step_behind()
        try:
            while not self._ended:
                if self._interface.wait() and not self._ended and not self._read_burst():
                    time.sleep(FULL_PAUSE)
        except TapError as error:
            self._fault = error
            for port in self._ports:
                port.report_tap_down()

    def _read_burst(self) -> bool:
        """Distribute waiting frames. Return False if a queue is full."""
        accepted = True
        for _ in range(BURST):
            frame = self._interface.read()
            if frame is None:
                break
            accepted &= self._distribute(frame, self._interface)
        return accepted

    def _distribute(self, frame: bytes, source: EthernetPort | FrameInterface) -> bool:
        """Queue a frame for its devices. Return False if a queue is full."""
        self._table.learn(frame[6:12], source)
        target = None if is_group(frame[:6]) else self._table.find(frame[:6])
        ports = [each for each in self._ports if target in (None, each) and each is not source]
        return all([port.send(frame) for port in ports])

    def _receive(self, source: EthernetPort, frame: bytes) -> bool:
        """Pass on a frame of a device. Return False if it was dropped."""
        if self._forward:
            self._distribute(frame, source)
        else:
            self._table.learn(frame[6:12], source)
        return self._interface.write(frame)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def __repr__(self) -> str:
        state = "open" if self.is_open else "closed"
        return f"<EthernetBridge {self.name!r}, {len(self._ports)} devices, {state}>"
