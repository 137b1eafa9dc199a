"""Network host in a virtual device: ARP (RFC 826), IPv4 (RFC 791) and ICMP echo (RFC 792)."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from catenary.virtual.eoe.checksum import checksum
from catenary.virtual.eoe.tcp import TcpServer
from catenary.virtual.scheduler import Scheduler

BROADCAST = b"\xff" * 6
ARP, IPV4 = b"\x08\x06", b"\x08\x00"
ARP_HEADER = struct.Struct("!HHBBH6s4s6s4s")
IP_HEADER = struct.Struct("!BBHHHBBH4s4s")
ICMP, TCP = 1, 6
ECHO_REQUEST, ECHO_REPLY = 8, 0
MORE_OR_OFFSET = 0x3FFF  # of the fragment field: fragments of IP are not supported


class Host:
    """Owner of the addresses and connections of the device."""

    def __init__(
        self, send: Callable[[bytes], None], scheduler: Scheduler, pages: Mapping[str, str]
    ) -> None:
        """Initialise the host.

        Args:
            send: Function that sends an Ethernet frame.
            scheduler: Delayed actions of the device.
            pages: Web pages by path.
        """
        self._send = send
        self._mac, self._ip = bytes(6), bytes(4)
        self._identification = 0
        self._tcp = TcpServer(self._send_segment, scheduler, pages)
        self.received = 0  # frames

    def configure(self, mac: bytes, ip: bytes) -> None:
        """Use other addresses. Connections end.

        Args:
            mac: MAC address.
            ip: IP address, 4 bytes in network order.
        """
        self._mac, self._ip = mac, ip
        self._tcp.reset()

    def reset(self) -> None:
        """End all connections."""
        self._tcp.reset()

    def receive(self, frame: bytes) -> None:
        """Process an Ethernet frame. Other frames than the supported ones are ignored."""
        self.received += 1
        if len(frame) < 14 or frame[:6] not in (self._mac, BROADCAST):
            return
        source, kind, data = frame[6:12], frame[12:14], frame[14:]
        if kind == ARP and len(data) >= ARP_HEADER.size:
            self._answer_arp(data)
        elif kind == IPV4 and len(data) >= IP_HEADER.size:
            self._receive_ip(source, data)

    def _answer_arp(self, data: bytes) -> None:
        *kind, operation, mac, ip, _, wanted = ARP_HEADER.unpack_from(data)
        if kind != [1, 0x0800, 6, 4] or operation != 1 or wanted != self._ip:
            return
        answer = ARP_HEADER.pack(1, 0x0800, 6, 4, 2, self._mac, self._ip, mac, ip)
        self._send(mac + self._mac + ARP + answer)

    def _receive_ip(self, mac: bytes, data: bytes) -> None:
        first, _, total, _, fragment, _, protocol, _, source, destination = IP_HEADER.unpack_from(
            data
        )
        size = (first & 0x0F) * 4
        valid = first >> 4 == 4 and IP_HEADER.size <= size <= total <= len(data)
        if not valid or checksum(data[:size]) or fragment & MORE_OR_OFFSET:
            return
        if destination != self._ip:
            return
        rest = data[size:total]
        if protocol == ICMP:
            self._answer_echo(mac, source, rest)
        elif protocol == TCP:
            self._tcp.receive(mac, source, self._ip, rest)

    def _answer_echo(self, mac: bytes, peer: bytes, data: bytes) -> None:
        if len(data) < 8 or data[0] != ECHO_REQUEST or checksum(data):
            return
        answer = bytes([ECHO_REPLY, 0, 0, 0]) + data[4:]
        value = checksum(answer)
        self._send_ip(mac, peer, ICMP, answer[:2] + value.to_bytes(2, "big") + answer[4:])

    def _send_segment(self, mac: bytes, peer: bytes, segment: bytes) -> None:
        self._send_ip(mac, peer, TCP, segment)

    def _send_ip(self, mac: bytes, peer: bytes, protocol: int, data: bytes) -> None:
        self._identification = self._identification + 1 & 0xFFFF
        total = IP_HEADER.size + len(data)
        fields = (0x45, 0, total, self._identification, 0x4000, 64, protocol)
        value = checksum(IP_HEADER.pack(*fields, 0, self._ip, peer))
        header = IP_HEADER.pack(*fields, value, self._ip, peer)
        self._send(mac + self._mac + IPV4 + header + data)
