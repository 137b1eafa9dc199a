"""Random messages of all protocols to a virtual device: its mailbox keeps working."""

from __future__ import annotations

import random

import pytest

from catenary.bus import MainDevice, SubDevice
from catenary.errors import CatenaryError
from catenary.procedure.mailbox import converse, drain, exclusively, send_only
from catenary.virtual import Ads, Coupler, DeviceFiles, Segment, Servo, VendorEcho
from catenary.wire import coe, foe, voe
from catenary.wire.mailbox import Mailbox, Type
from tests.fuzz.fuzz_wire import AOE, AOE_FRAGMENTS, COE, mutations

FILES = (
    foe.ReadRequest("log").encode(),
    foe.WriteRequest("new").encode(),
    foe.Data(1, bytes(116)).encode(),
    foe.Acknowledge(1).encode(),
    foe.Error(0x8000).encode(),
)
CORPUS: dict[Type, tuple[bytes, ...]] = {
    Type.ERROR: (b"\x01\0\x02\0",),
    Type.AOE: tuple(each.encode() for each in (*AOE, *AOE_FRAGMENTS)),
    Type.EOE: (bytes(32), bytes.fromhex("0001000000") + bytes(60)),
    Type.COE: COE,
    Type.FOE: FILES,
    Type.SOE: (bytes.fromhex("01400f00"),),
    Type.VOE: (voe.VoeMessage(2, 1, b"hello").encode(),),
}
MESSAGES = 400
ROOM = 128 - 6


@pytest.mark.parametrize("seed", range(4))
def test_random_messages_leave_the_mailbox_usable(seed: int) -> None:
    source = random.Random(seed)
    inputs = {kind: mutations(corpus, source) for kind, corpus in CORPUS.items()}
    protocols = [Ads(areas={0x4020: 1000}, fragments="acknowledged"), VendorEcho()]
    files = DeviceFiles(contents={"log": "x" * 500}, size_limit=4096)
    with MainDevice(Segment([Coupler(), Servo(files=files, protocols=protocols)])) as main:
        sub = main.scan()[1]
        for number in range(MESSAGES):
            kind = source.choice(tuple(CORPUS))
            data = source.choice(CORPUS[kind]) if source.random() < 0.3 else next(inputs[kind])
            _send(sub, kind, data[:ROOM], answered=source.random() < 0.2)
            if number % 50 == 0:
                _drained(sub)
                assert int.from_bytes(sub.sdo.read(0x1000), "little") == 0x0002_0192
        _drained(sub)
        assert int.from_bytes(sub.sdo.read(0x1000), "little") == 0x0002_0192
        sub.aoe.assign_net_id()
        assert sub.aoe.state(port=0xFFFF) is not None
        assert sub.voe.exchange(1, b"abc").data == b"abc"
        assert sub.foe.read("log") == b"x" * 500


def _send(sub: SubDevice, kind: Type, data: bytes, *, answered: bool) -> None:
    """Send a message. With `answered`, wait for one message of the same protocol."""
    channel = sub.channel
    assert channel is not None

    def accept(received: Mailbox) -> bool | None:
        return True if received.type is kind else None

    asked = converse(channel, kind, data, accept, timeout=0.01)
    try:
        if answered:
            sub.main.converse(exclusively(channel, asked))
        else:
            sub.main.converse(exclusively(channel, send_only(channel, kind, data)))
    except CatenaryError:
        return  # no answer, or a mailbox error


def _drained(sub: SubDevice) -> None:
    """Read the mailbox until it is empty."""
    channel = sub.channel
    assert channel is not None
    for _ in range(100):
        try:
            asked = exclusively(channel, drain(channel, lambda received: received))
            if not sub.main.converse(asked):
                return
        except CatenaryError:
            continue
    raise AssertionError("the device sends without end")


def test_the_corpus_has_valid_messages_of_every_protocol() -> None:
    assert set(CORPUS) == set(Type)
    for data in COE:
        coe.decode_coe(data)
    for data in FILES:
        foe.decode_foe(data)
