"""No frame stops a served segment or the applications of its devices."""

from __future__ import annotations

import random
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from catenary.realtime.child import Child, start_python
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame

ETHERCAT = 0x88A4
DEVICES = 6  # of the demo's segment
SECONDS = 60.0
AL_CONTROL, AL_STATUS = 0x0120, 0x0130
OFFSET, SYNC_ACTIVATION, SYNC_START, SYNC0_CYCLE = 0x0920, 0x0981, 0x0990, 0x09A0
BLOCK = 200  # frames between two questions

# The clock at -2^62, the first pulse at 2^62 + 2^61: the difference exceeds 63 bits.
HANG = encode_frame(
    [
        Datagram(EcatCommand.BWR, OFFSET << 16, struct.pack("<q", -(2**62))),
        Datagram(EcatCommand.BWR, SYNC_START << 16, struct.pack("<Q", 2**62 + 2**61)),
        Datagram(EcatCommand.BWR, SYNC0_CYCLE << 16, struct.pack("<I", 1000)),
        Datagram(EcatCommand.BWR, SYNC_ACTIVATION << 16, b"\x03"),
    ]
)
IN_VIRTUAL_TIME = f"""
from catenary.virtual import demo_segment
link = demo_segment().open_link()
link.send(bytes.fromhex("{HANG.hex()}"))
assert not link.wait_until(link.now() + 1_000_000_000, False)
"""


class Wire:
    """Owns a raw socket at the MainDevice's end of the cable."""

    def __init__(self, interface: str) -> None:
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
        self._socket.bind((interface, ETHERCAT))
        self._socket.settimeout(0.2)
        self._index = 0

    def send(self, frame: bytes) -> None:
        self._socket.send(frame)

    def ask(self, command: EcatCommand, address: int, data: bytes) -> tuple[int, bytes] | None:
        """(working counter, data) of the answer, or None: the frame got lost."""
        self._index = self._index % 255 + 1
        self.send(encode_frame([Datagram(command, address, data, index=self._index)]))
        deadline = time.monotonic() + 1.0
        while time.monotonic() < deadline:
            try:
                frame, (_name, _protocol, kind, *_rest) = self._socket.recvfrom(2048)
            except TimeoutError:
                return None
            answer = decode_frame(frame).datagrams[0]
            if kind != socket.PACKET_OUTGOING and answer.index == self._index:
                return answer.working_counter, answer.data
        return None

    def await_answer(self, command: EcatCommand, address: int, data: bytes, counter: int) -> bytes:
        deadline = time.monotonic() + SECONDS
        while True:
            answer = self.ask(command, address, data)
            if answer is not None and answer[0] == counter:
                return answer[1]
            assert time.monotonic() < deadline, "the segment does not answer"

    def close(self) -> None:
        self._socket.close()


@contextmanager
def serving(veth: tuple[str, str], *options: str) -> Iterator[tuple[Wire, Child]]:
    ours, theirs = veth
    with start_python(["-m", "catenary.cli", "virtual", "serve", theirs, *options]) as server:
        assert server.read_line(SECONDS), "the virtual segment did not start"
        wire = Wire(ours)
        yield wire, server
        wire.close()


@pytest.fixture
def served(veth: tuple[str, str]) -> Iterator[tuple[Wire, Child]]:
    with serving(veth) as both:
        yield both


def applications_work(wire: Wire) -> bool:
    """All devices follow a request of INIT, the servos' microcontrollers among them."""
    deadline = time.monotonic() + SECONDS
    while time.monotonic() < deadline:
        wire.ask(EcatCommand.BWR, AL_CONTROL << 16, b"\x11\x00")
        wire.ask(EcatCommand.BWR, AL_CONTROL << 16, b"\x01\x00")
        answer = wire.ask(EcatCommand.BRD, AL_STATUS << 16, bytes(2))
        if answer == (DEVICES, b"\x01\x00"):
            return True
    return False


def test_one_frame_does_not_hang_a_served_segment(served: tuple[Wire, Child]) -> None:
    wire, server = served
    wire.send(HANG)
    wire.await_answer(EcatCommand.BRD, 0, b"\0", DEVICES)
    assert applications_work(wire)
    server.process.send_signal(signal.SIGTERM)
    assert server.process.wait(SECONDS) == 0


def test_pulses_beyond_all_bounds_keep_no_frame_waiting(
    veth: tuple[str, str], tmp_path: Path
) -> None:
    """A hundred clocks that pulse every 10 us, each at its own instants: more than the machine
    can compute in real time."""
    file = tmp_path / "clocks.toml"
    tables = (f'[[device]]\nkind = "coupler"\ncrystal = {{ ppm = {k}.5 }}\n' for k in range(100))
    file.write_text("\n".join(tables))
    with serving(veth, "--config", str(file)) as (wire, server):
        for position in range(100):  # the first pulses soon: local times begin apart
            address = (-position & 0xFFFF) | 0x0910 << 16
            time_now = wire.await_answer(EcatCommand.APRD, address, bytes(8), 1)
            start = int.from_bytes(time_now, "little") + 50_000_000
            for register, data in (
                (SYNC_START, struct.pack("<Q", start)),
                (SYNC0_CYCLE, struct.pack("<I", 10_001)),
                (SYNC_ACTIVATION, b"\x03"),
            ):
                wire.await_answer(EcatCommand.APWR, (-position & 0xFFFF) | register << 16, data, 1)
        time.sleep(0.5)  # real time, over a real wire: the pulses are due
        for _ in range(20):
            wire.await_answer(EcatCommand.BRD, 0, b"\0", 100)
        assert server.running


def test_one_frame_does_not_hang_a_segment_in_virtual_time() -> None:
    subprocess.run([sys.executable, "-c", IN_VIRTUAL_TIME], check=True, timeout=SECONDS)


def hostile(chance: random.Random) -> bytes:
    """Writes to registers and process memory, with numbers at the edges among them.

    Not to write protection, reset and loop control (below 0x0104): these cut devices off, as on a
    real bus.
    """
    datagrams = []
    for _ in range(chance.randint(1, 3)):
        edge = chance.choice(
            [0, 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**63, chance.getrandbits(64)]
        )
        data = struct.pack("<Q", edge)[: chance.choice([1, 2, 4, 8])]
        ado = chance.choice([chance.randrange(0x0600, 0x0A00), chance.randrange(0x0104, 0x2000)])
        datagrams.append(Datagram(EcatCommand.BWR, ado << 16, data))
    return encode_frame(datagrams)


@pytest.mark.parametrize("seed", [1, 2])
def test_random_writes_do_not_stop_a_served_segment(served: tuple[Wire, Child], seed: int) -> None:
    wire, server = served
    chance = random.Random(seed)
    for _ in range(10):
        for _ in range(BLOCK):
            wire.send(hostile(chance))
        assert server.running
    wire.await_answer(EcatCommand.BRD, 0, b"\0", DEVICES)
    assert applications_work(wire)
