"""Random faults and random loop control: the segment survives, and recovers after repair."""

from __future__ import annotations

import random

import pytest

from catenary.virtual import Coupler, Device, DigitalOutputs, Junction, Segment, Servo
from catenary.virtual.faults import (
    Fault,
    corrupt,
    cut,
    delay,
    duplicate,
    exchange,
    garble,
    join,
    lose_frames,
    power_cycle,
    swap,
)
from catenary.virtual.wiring import Neighbour
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame

MILLISECOND = 1_000_000
BEHIND = {2: (1, 3), 4: (1, 1), 5: (1, 2), 7: (5, 2)}
CABLES: dict[bool, list[tuple[Neighbour, Neighbour]]] = {
    False: [("main", 0), *((k, k + 1) for k in range(7)), (7, "main")],
    True: [("main", 0), (0, 1), (1, 2), (2, 3), (1, 4), (1, 5), (5, 6), (5, 7), (7, "main")],
}
TWO_PORTS = [0, 2, 3, 4, 6, 7]
LATCH = encode_frame([Datagram(EcatCommand.BRW, 0x0900 << 16, bytes(8))])


def devices() -> list[Device]:
    return [Coupler(), Junction(), Coupler(), Servo(), Coupler(), Junction(port_count=3)] + [
        Coupler() for _ in range(2)
    ]


def any_fault(dice: random.Random, tree: bool) -> Fault:
    for_ = dice.choice([1e-6, 1e-5, 1e-3])
    between = dice.choice(CABLES[tree])
    kinds: list[Fault] = [
        cut(between=between, for_=dice.choice([None, for_])),
        join(between=between),
        power_cycle(dice.randrange(8), for_=for_),
        corrupt(between=between, for_=for_),
        dice.choice([delay(by=1e-4), duplicate(3), garble(2), lose_frames(2)]),
        exchange(*dice.sample(TWO_PORTS, 2), for_=for_),
        swap(dice.choice(TWO_PORTS), with_=dice.choice([Servo, DigitalOutputs])(), for_=for_),
    ]
    return dice.choice(kinds)


def any_loops(dice: random.Random) -> bytes:
    """Return a frame that writes DL control of one device or of all devices."""
    command = dice.choice([EcatCommand.BWR, EcatCommand.APWR])
    data = bytes([dice.choice([1, 3]), dice.randrange(256)])
    address = (-dice.randrange(8) & 0xFFFF) | 0x0100 << 16
    return encode_frame([Datagram(command, address, data)])


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_segment_recovers_after_any_faults(seed: int, tree: bool) -> None:
    dice = random.Random(seed)
    segment = Segment(devices(), ring=True, behind=BEHIND if tree else None)
    links = segment.first.open_link(), segment.second.open_link()
    for _ in range(60):
        if dice.random() < 0.3:
            dice.choice(links).send(any_loops(dice))
        else:
            segment.inject(any_fault(dice, tree))
        for link in links:
            link.send(LATCH)
        until = links[0].now() + dice.randrange(1, 2 * MILLISECOND)
        dice.choice(links).wait_until(until, bool(dice.randrange(2)))
        for link in links:
            while link.receive():
                pass
    for between in CABLES[tree]:
        segment.inject(join(between=between))
    for k in range(8):
        segment.inject(power_cycle(k, for_=0.001))
    links[0].wait_until(links[0].now() + 10 * MILLISECOND, False)
    for _ in range(40):  # remaining frame faults
        links[0].send(LATCH)
        links[0].wait_until(links[0].now() + MILLISECOND, False)
    while links[1].receive():
        pass
    links[0].send(encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")]))
    assert links[1].wait_until(links[1].now() + MILLISECOND, True)
    frame = links[1].receive()
    assert frame is not None
    assert decode_frame(frame).datagrams[0].working_counter == 8
    assert segment.wires.processed(0) == list(range(8))
