"""Table of the MAC addresses behind each Ethernet port."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")

PER_PORT_MAX = 32  # addresses; a device with a switch has several


def is_group(address: bytes) -> bool:
    """Return True for a broadcast or multicast address."""
    return bool(address[0] & 1)


class MacTable(Generic[T]):
    """Table from MAC addresses to ports, learned from the sources of frames.

    Each port has its own limit, so that one device cannot displace the addresses of others. Any
    thread may call the methods.
    """

    def __init__(self) -> None:
        self._ports: dict[bytes, T] = {}  # oldest first
        self._lock = threading.Lock()  # for changes

    def learn(self, address: bytes, port: T) -> None:
        """Note that frames with this source come from a port.

        Args:
            address: Source address of a frame.
            port: The port.
        """
        if is_group(address) or self._ports.get(address) is port:
            return
        with self._lock:
            self._ports.pop(address, None)
            own = [known for known, other in self._ports.items() if other is port]
            if len(own) >= PER_PORT_MAX:
                del self._ports[own[0]]
            self._ports[address] = port

    def find(self, address: bytes) -> T | None:
        """Return the port of an address; None if it is not known."""
        return self._ports.get(address)

    def __len__(self) -> int:
        return len(self._ports)
