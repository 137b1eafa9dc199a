"""Ethernet interfaces of this machine."""

from __future__ import annotations

import fcntl
import socket
import struct
from typing import NamedTuple

from catenary.link.interface import (
    ARPHRD_ETHER,
    IFF_RUNNING,
    IFF_UP,
    SIOCGIFFLAGS,
    SIOCGIFHWADDR,
)


class NetworkInterface(NamedTuple):
    """An Ethernet interface; pass its `name` to `cat.MainDevice`."""

    name: str
    mac: str  # "02:00:5e:10:00:01"
    is_up: bool  # if not: sudo ip link set NAME up
    has_link: bool  # a cable connects it to a device that has power


def interfaces() -> tuple[NetworkInterface, ...]:
    """Return the Ethernet interfaces of this network namespace, in the kernel's order.

    WiFi interfaces are included, because the kernel does not distinguish them here. EtherCAT does
    not work over WiFi. No permissions are needed.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        found = [_read(asking, name) for _, name in socket.if_nameindex()]
    return tuple(each for each in found if each is not None)


def _read(asking: socket.socket, name: str) -> NetworkInterface | None:
    """Return an interface; None if it is not Ethernet or no longer exists."""
    request = struct.pack("16s24x", name.encode())  # struct ifreq
    try:
        address = fcntl.ioctl(asking, SIOCGIFHWADDR, request)
        flags = fcntl.ioctl(asking, SIOCGIFFLAGS, request)
    except OSError:
        return None
    kind, mac = struct.unpack_from("=H6s", address, 16)
    if kind != ARPHRD_ETHER:
        return None
    (bits,) = struct.unpack_from("=H", flags, 16)
    is_up = bool(bits & IFF_UP)
    return NetworkInterface(name, mac.hex(":"), is_up, is_up and bool(bits & IFF_RUNNING))
