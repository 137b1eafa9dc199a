"""A simulated RDT box on loopback. The test decides which datagrams it sends."""

from __future__ import annotations

import socket
import struct


class Box:
    """UDP server with the requests of RDT. It sends only while a client has started it."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(20.0)
        self.port = self.socket.getsockname()[1]
        self.client: tuple[str, int] | None = None
        self.sequence = 0

    def receive(self) -> tuple[int, int, int]:
        """Wait for a request. Return header, command and number of samples."""
        data, client = self.socket.recvfrom(100)
        header, command, count = struct.unpack(">HHI", data)
        if command == 2:
            self.client, self.sequence = client, 0
        return header, command, count

    def send(self, force: float = 0.0, *, skip: int = 0, status: int = 0) -> None:
        """Send the next record, after `skip` records that are lost [N]."""
        self.sequence += 1 + skip
        self.send_record(self.sequence, force, status)

    def send_record(self, sequence: int, force: float = 0.0, status: int = 0) -> None:
        counts = (round(force * 1e6), 0, 0, 0, 0, 0)
        self.send_bytes(struct.pack(">III6i", sequence, 0, status, *counts))

    def send_bytes(self, data: bytes) -> None:
        self.socket.sendto(data, self.client)

    def close(self) -> None:
        self.socket.close()
