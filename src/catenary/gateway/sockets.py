"""Listening sockets of the gateway. They accept addresses of the loopback interface only."""

from __future__ import annotations

import ipaddress
import socket
from typing import NamedTuple

from catenary.errors import ConfigurationError

BACKLOG = 128  # connections that the kernel accepts before the next pass


class Sockets(NamedTuple):
    """Sockets of both protocols with the same port."""

    udp: socket.socket
    tcp: socket.socket

    @property
    def port(self) -> int:
        """Number of the port."""
        port: int = self.tcp.getsockname()[1]
        return port

    def close(self) -> None:
        self.udp.close()
        self.tcp.close()


def checked_address(address: str) -> str:
    """Return an address of this machine's loopback interface.

    Raises:
        ValueError: Other machines could reach the address, or it is not an IP address.
    """
    try:
        found = ipaddress.ip_address("127.0.0.1" if address == "localhost" else address)
    except ValueError:
        raise ValueError(f"{address!r} is not an IP address; use 127.0.0.1") from None
    if not found.is_loopback:
        raise ValueError(
            f"the gateway cannot listen on {address}: the protocol has no authentication, so that "
            "other machines must not reach it; use 127.0.0.1, and an SSH tunnel: "
            "ssh -L 34980:127.0.0.1:34980 MACHINE"
        )
    return str(found)


def open_sockets(address: str, port: int) -> Sockets:
    """Open the sockets.

    Args:
        address: Address of the loopback interface.
        port: Port of both protocols; 0 for any free one.

    Raises:
        ConfigurationError: The port is in use, or not allowed.
    """
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    tcp = socket.socket(family, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
    udp = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
    try:
        tcp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # after a former one
        tcp.bind((address, port))
        udp.bind((address, tcp.getsockname()[1]))
        tcp.listen(BACKLOG)
    except OSError as error:
        tcp.close()
        udp.close()
        raise ConfigurationError(
            f"the gateway cannot listen on {address}, port {port}: {error.strerror}",
            hint="another gateway or tool uses the port: `ss -lntup` lists it; or choose another "
            "port, which the tool must support",
        ) from error
    tcp.setblocking(False)
    udp.setblocking(False)
    return Sockets(udp, tcp)
