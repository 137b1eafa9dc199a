"""The timeline of PySOEM's bring-up, recorded on its interface."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from catenary.capture import SdoTransfer, read_timeline
from catenary.virtual import read_segment
from catenary.virtual.description import VENDOR_ID
from catenary.virtual.devices.application import BLOB_BYTES
from catenary.wire.pcapng import Packet, encode_header, encode_packet
from tests.peers.conftest import serving
from tests.peers.test_pysoem import OBJECT_DOES_NOT_EXIST, SHOULDER, opened, tries

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

ALL_PROTOCOLS = 3  # ETH_P_ALL: sent frames as well
BLOB = bytes(k * 7 & 0xFF for k in range(BLOB_BYTES))


@contextmanager
def recording(interface: str, path: Path) -> Iterator[None]:
    """Record both directions of an interface, without the direction in the file."""
    ended = threading.Event()
    packets: list[Packet] = []

    def record(tap: socket.socket) -> None:
        while True:
            try:
                data = tap.recv(2048)
            except TimeoutError:
                if ended.is_set():
                    return
                continue
            packets.append(Packet(time.time_ns(), data))

    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_PROTOCOLS)) as tap:
        tap.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 24)
        tap.bind((interface, ALL_PROTOCOLS))
        tap.settimeout(0.2)
        thread = threading.Thread(target=record, args=(tap,))
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join(timeout=20)
    path.write_bytes(encode_header(interface) + b"".join(map(encode_packet, packets)))


def abort_of(slave: Any, index: int) -> int:
    """Return the abort code of a read."""
    with pytest.raises(pysoem.SdoError) as caught:
        slave.sdo_read(index, 0)
    return int(caught.value.abort_code)


def test_the_bring_up_of_pysoem(veth: tuple[str, str], line: Path, tmp_path: Path) -> None:
    ours, theirs = veth
    path = tmp_path / "pysoem.pcapng"
    with serving(theirs, line), recording(ours, path), opened(6, ours) as master:
        servo = master.slaves[SHOULDER]
        assert BLOB in tries(lambda: servo.sdo_read(0x2100, 0, 4096))
        assert OBJECT_DOES_NOT_EXIST in tries(lambda: abort_of(servo, 0x5FFF))
    found = read_timeline(path)
    [soem] = [each for each in found.masters if each.devices]
    assert soem.master.name == "SOEM"
    expected = [device.description() for device in read_segment(line)]
    assert [(device.vendor, device.product) for device in soem.devices] == [
        (VENDOR_ID, each.product_code) for each in expected
    ]
    transfers = [
        event.content
        for event in found.events
        if isinstance(event.content, SdoTransfer) and event.device == SHOULDER
    ]
    assert BLOB in [each.data for each in transfers if each.index == 0x2100 and each.segments]
    assert OBJECT_DOES_NOT_EXIST in [each.abort for each in transfers if each.index == 0x5FFF]
