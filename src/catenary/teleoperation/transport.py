"""Transports of packets: the interface, and UDP over IPv4 or IPv6."""

from __future__ import annotations

import errno
import socket
import time
from typing import Protocol

from catenary.errors import LinkError
from catenary.teleoperation.packet import SIZE_MAX

HINTS = {
    errno.EADDRINUSE: "another program uses this port: ss -ulpn; each program needs its own",
    errno.EADDRNOTAVAIL: "bind an address of this machine (ip address), or 0.0.0.0 for all of them",
    errno.EACCES: "use a port above 1023",
}
TRAFFIC_CLASS = 0xB8  # DSCP 46, expedited forwarding (RFC 3246)


class Transport(Protocol):
    """A path to the other side that may lose, delay, reorder or repeat packets."""

    @property
    def now_ns(self) -> int:
        """Time of the clock of this side [ns]. It never steps back."""

    def send(self, data: bytes) -> bool:
        """Send a packet without waiting. Return False if this machine could not send it."""

    def receive(self) -> bytes | None:
        """Return a received packet; None if there is none now."""

    def close(self) -> None:
        """Release the path."""


class UdpTransport:
    """Owner of a UDP socket that is connected to the other side.

    The kernel drops datagrams of other senders. Packets ask for expedited forwarding (DSCP 46).

    Args:
        bind: address of this side, such as "0.0.0.0:7001" or "[::]:7001".
        remote: address of the other side, such as "arm.local:7002" or "[fd00::2]:7002".

    Raises:
        ValueError: an address has no port, or that of the other side is 0.
        LinkError: a name is unknown, the address families differ, or the port is in use.
    """

    def __init__(self, bind: str, remote: str) -> None:
        self._socket = open_socket(bind, remote)

    @property
    def address(self) -> str:
        """Address of this side, with the port that the kernel has chosen for port 0."""
        host, port = self._socket.getsockname()[:2]
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"

    @property
    def now_ns(self) -> int:
        """CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    def fileno(self) -> int:
        """Return the file descriptor, for `select`."""
        return self._socket.fileno()

    def send(self, data: bytes) -> bool:
        """Send a datagram. Return False if the kernel refused it.

        It refuses while no route exists, the queue is full, or the other side's machine reports a
        closed port.
        """
        try:
            self._socket.send(data)
        except OSError:
            return False
        return True

    def receive(self) -> bytes | None:
        """Return a datagram; None if there is none now."""
        try:
            return self._socket.recv(SIZE_MAX + 1)
        except OSError:  # nothing to read, or a report of a closed port
            return None

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def open_socket(bind: str, remote: str) -> socket.socket:
    """Return a bound and connected socket that never blocks.

    Args:
        bind: address of this side.
        remote: address of the other side.

    Raises:
        ValueError: an address has no port, or that of the other side is 0.
        LinkError: the addresses cannot be used.
    """
    places = parse_address(bind), parse_address(remote)
    if places[1][1] == 0:
        raise ValueError(f"{remote!r}: give the port of the other side, 1 to 65535")
    try:
        family, *_, target = socket.getaddrinfo(*places[1], type=socket.SOCK_DGRAM)[0]
        source = socket.getaddrinfo(*places[0], family=family, type=socket.SOCK_DGRAM)[0][-1]
        made = socket.socket(family, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
    except OSError as error:
        raise _unusable(bind, remote, error) from error
    try:
        made.setblocking(False)
        made.bind(source)
        made.connect(target)
        mark(made)
    except OSError as error:
        made.close()
        raise _unusable(bind, remote, error) from error
    return made


def mark(made: socket.socket) -> None:
    """Set the traffic class of all datagrams of a socket."""
    if made.family == socket.AF_INET6:
        made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_TCLASS, TRAFFIC_CLASS)
    else:
        made.setsockopt(socket.IPPROTO_IP, socket.IP_TOS, TRAFFIC_CLASS)


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port of "host:port" or "[address]:port". Raises ValueError without a port."""
    host, _, port = text.rpartition(":")
    bracketed = host.startswith("[") and host.endswith("]")
    if not host or not port.isdecimal() or int(port) > 65535 or (":" in host and not bracketed):
        raise ValueError(f"{text!r}: write HOST:PORT, or [ADDRESS]:PORT for IPv6")
    return host.strip("[]"), int(port)


def _unusable(bind: str, remote: str, error: OSError) -> LinkError:
    if isinstance(error, socket.gaierror):
        hint = (
            "check the host names: getent hosts NAME; both addresses must be of one family (IPv4 "
            "or IPv6)"
        )
    else:
        hint = HINTS.get(error.errno or 0, "compare both addresses with those of: ip address")
    return LinkError(f"cannot send from {bind} to {remote}: {error.strerror}", hint=hint)
