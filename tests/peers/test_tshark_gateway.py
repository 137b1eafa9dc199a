"""tshark dissects the traffic of the gateway with a tool: requests, answers, fragments, refusals.

The bytes are those of the tool's socket. The loopback interface is not recorded, because this needs
privileges on the machine.
"""

from __future__ import annotations

import struct
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from catenary.wire.pcapng import Packet, encode_header, encode_packet
from tests.gateway.conftest import line as line  # the fixture
from tests.gateway.line import CONTENT, Line
from tests.gateway.tool import Aborted, Tool

TOOL_PORT = 50000


class Pcap:
    """Frames of one connection in both directions."""

    def __init__(self, port: int, *, udp: bool) -> None:
        self._port, self._udp = port, udp
        self._next = {True: 1, False: 1}  # sequence numbers
        self.frames: list[bytes] = []

    def add(self, payload: bytes, *, to_gateway: bool) -> None:
        ports = (TOOL_PORT, 0x88A4) if to_gateway else (0x88A4, TOOL_PORT)
        if self._udp:
            head = struct.pack(">HHHH", *ports, 8 + len(payload), 0)
        else:
            numbers = self._next[to_gateway], self._next[not to_gateway]
            head = struct.pack(">HHIIBBHHH", *ports, *numbers, 5 << 4, 0x18, 8192, 0, 0)
            self._next[to_gateway] += len(payload)
        size = 20 + len(head) + len(payload)
        protocol = 17 if self._udp else 6
        loopback = bytes((127, 0, 0, 1)) * 2
        address = struct.pack(">BBHHHBBH", 0x45, 0, size, 0, 0, 64, protocol, 0) + loopback
        self.frames.append(bytes(12) + b"\x08\x00" + address + head + payload)


class Recorded(Tool):
    """Tool that records its frames in their order."""

    def __init__(self, port: int, *, udp: bool) -> None:
        super().__init__(port, udp=udp)
        self.pcap = Pcap(port, udp=udp)

    def send(self, kind: int, data: bytes) -> None:
        super().send(kind, data)
        self.pcap.add(self.sent[-1], to_gateway=True)

    def receive(self):  # type: ignore[no-untyped-def]
        answer = super().receive()
        self.pcap.add(self.received[-1], to_gateway=False)
        return answer


@pytest.mark.parametrize("udp", [False, True], ids=["TCP", "UDP"])
def test_tshark_reads_every_frame(tshark: str, line: Line, udp: bool, tmp_path: Path) -> None:
    with Recorded(line.gateway.port, udp=udp) as tool:
        objects = tool.object_list()
        tool.upload(0x1018, 1)
        tool.upload(0x2100)
        tool.download(0x6065, 0, bytes(4))
        assert tool.read_file("log") == CONTENT
        with pytest.raises(Aborted):
            tool.upload(0x5FFF)
        tool.address = 0x1003
        with pytest.raises(Aborted):
            tool.download(0x6040, 0, bytes(2))
        with pytest.raises(Aborted):
            tool.ask(15, bytes(8))
    path = tmp_path / "gateway.pcapng"
    packets = (Packet(0, frame) for frame in tool.pcap.frames)
    path.write_bytes(encode_header("lo") + b"".join(map(encode_packet, packets)))
    names = ("ecatf.type", "ecat_mailbox.address", "ecat_mailbox.counter", "_ws.malformed")
    options = [part for name in names for part in ("-e", name)]
    command = [tshark, "-r", str(path), "-T", "fields", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert len(rows) == len(tool.pcap.frames) > len(objects) / 60 + 30
    assert {row[0] for row in rows} == {"0x0005"}
    assert {row[3] for row in rows} == {""}
    addresses = Counter(row[1] for row in rows)
    assert addresses["0x1003"] == 4
    assert set(addresses) == {"0x1002", "0x1003"}
    bytes_of_header = [frame[7] >> 4 for frame in _payloads(tool.pcap.frames, udp)]
    assert [int(row[2]) for row in rows] == bytes_of_header


def _payloads(frames: list[bytes], udp: bool) -> list[bytes]:
    return [frame[14 + 20 + (8 if udp else 20) :] for frame in frames]
