"""Capture of the EtherCAT frames on a network interface."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from catenary.wire.pcapng import Packet, encode_header, encode_packet

ETHERCAT = 0x88A4
ALL_PROTOCOLS = 0x0003  # ETH_P_ALL: also the sent frames
BUFFER = 1 << 24
POLL_SECONDS = 0.05


class Sniffer:
    """Owner of a socket and of the thread that reads it."""

    def __init__(self, interface: str) -> None:
        self.packets: list[Packet] = []
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_PROTOCOLS))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        self._socket.bind((interface, ALL_PROTOCOLS))
        self._socket.settimeout(POLL_SECONDS)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Read the frames in the buffer, and close the socket."""
        self._ended.set()
        self._thread.join(timeout=20.0)
        assert not self._thread.is_alive()
        self._socket.close()

    def _run(self) -> None:
        while True:
            try:
                frame = self._socket.recv(2048)
            except TimeoutError:
                if self._ended.is_set():
                    return
                continue
            if frame[12:14] == ETHERCAT.to_bytes(2, "big"):
                self.packets.append(Packet(time.time_ns(), frame))


@contextmanager
def sniffing(interface: str, path: Path) -> Iterator[None]:
    """Write the EtherCAT frames of an interface into a pcapng file."""
    sniffer = Sniffer(interface)
    try:
        yield
    finally:
        sniffer.close()
    path.write_bytes(
        encode_header(interface) + b"".join(encode_packet(each) for each in sniffer.packets)
    )
