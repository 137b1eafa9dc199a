"""UDP source: the datagrams of one device."""

from __future__ import annotations

import select
import socket
import time

SIZE_MAX = 65_535  # bytes of a datagram


class Udp:
    """Device with a UDP address. Datagrams of other senders are ignored.

    Args:
        host: address of the device.
        port: UDP port of the device.
        local_port: port of this machine; 0: any free one.
        address: address of this machine; empty: any.
    """

    def __init__(self, host: str, port: int, *, local_port: int = 0, address: str = "") -> None:
        self._peer, self._local = (host, port), (address, local_port)

    @property
    def name(self) -> str:
        """Address and port of the device."""
        return "{}:{}".format(*self._peer)

    def open(self) -> UdpConnection:
        """Open a socket. Raises OSError if the port is in use or the host is unknown."""
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            made.setblocking(False)
            made.bind(self._local)
            made.connect(self._peer)
        except BaseException:
            made.close()
            raise
        return UdpConnection(made)


class UdpConnection:
    """Owner of a connected UDP socket."""

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected
        self._poll = select.poll()
        self._poll.register(connected, select.POLLIN)

    def read(self, timeout: float) -> tuple[bytes, int]:
        """Return the next datagram and its time of reception [ns]; no data after `timeout` [s].

        Raises OSError if the device refuses a message, for example while it starts.
        """
        ready = self._poll.poll(timeout * 1e3)
        try:
            data = self._socket.recv(SIZE_MAX) if ready else b""
        except (
            BlockingIOError
        ):  # the kernel has dropped a datagram with a wrong checksum, select(2)
            data = b""
        return data, time.monotonic_ns()

    def write(self, data: bytes) -> None:
        """Send one datagram."""
        self._socket.send(data)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
