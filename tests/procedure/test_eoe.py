"""Ethernet port of a device: addresses, and frames in both directions, in virtual time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from ipaddress import IPv4Address

import pytest

from catenary.bus import MainDevice, SubDevice
from catenary.errors import EoeError, MailboxError, ResponseTimeout
from catenary.link import Fault, FaultInjector
from catenary.procedure import eoe
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.mailbox_swap import Outgoing
from catenary.virtual import AnalogInputs, Coupler, Ethernet, MailboxQuirks, Segment
from catenary.wire.eoe import Fragment, decode_eoe
from catenary.wire.eoe_address import EthernetAddress, MacFilter
from catenary.wire.eoe_frames import Drop, FrameAssembler, fragments_of
from catenary.wire.mailbox import Mailbox, Type
from tests.virtual.ethernet_frames import ARP_ANSWER, ARP_REQUEST, IP, MAC, echo, ping

INITIAL = EthernetAddress(MAC, IPv4Address(IP), IPv4Address("255.255.255.0"), name="virtual")


def segment(*, size: int = 128, quirks: MailboxQuirks | None = None, **options: object) -> Segment:
    ethernet = Ethernet(**options)  # type: ignore[arg-type]
    more = {} if quirks is None else {"mailbox_quirks": quirks}
    return Segment([Coupler(), AnalogInputs(mailbox_bytes=size, protocols=[ethernet], **more)])


class Host:
    """Sends and receives frames of one device, as the source and subscriber of `pump`."""

    def __init__(self, sub: SubDevice) -> None:
        assert sub.channel is not None
        self.channel = sub.channel
        self.channel.subscribers[Type.EOE] = self._take
        self.main = sub.main
        self.assembler = FrameAssembler()
        self.received: list[bytes] = []
        self.waiting: deque[Outgoing] = deque()
        self.number = 0

    def _take(self, message: Mailbox, time_ns: int) -> bool:
        decoded = decode_eoe(message.data)
        assert isinstance(decoded, Fragment)
        frame = self.assembler.add(decoded, time_ns)
        if frame is not None:
            self.received.append(frame)
        return True

    def next(self) -> Outgoing | None:
        return self.waiting[0] if self.waiting else None

    def done(self, outgoing: Outgoing) -> None:
        self.waiting.popleft()

    def exchange(self, *frames: bytes, turns: int = 60) -> list[bytes]:
        """Send frames, and return those received within a number of turns."""
        for frame in frames:
            parts = fragments_of(frame, self.number % 16, eoe.room_to(self.channel))
            self.number += 1
            self.waiting.extend(Outgoing(Type.EOE, part.encode()) for part in parts)
        self.received.clear()
        for _ in range(turns):
            self.main.converse(self._turn())
        assert not self.waiting
        return list(self.received)

    def _turn(self) -> Procedure[None]:
        yield from eoe.pump(self.channel, self, 16)
        yield after(300e-6)  # the device needs this time for a message


@pytest.fixture
def sub() -> Iterator[SubDevice]:
    with MainDevice(segment()) as main:
        yield main.scan()[1]


def test_addresses_are_read_and_set(sub: SubDevice) -> None:
    channel, run = sub.channel, sub.main.converse
    assert channel is not None
    assert run(eoe.read_address(channel)) == INITIAL
    new = EthernetAddress(ip=IPv4Address("10.0.0.2"), gateway=IPv4Address("10.0.0.1"))
    sent = run(eoe.write_address(channel, new))
    assert not sent.has_gap
    assert run(eoe.read_address(channel)) == EthernetAddress(
        MAC, new.ip, INITIAL.mask, new.gateway, name="virtual"
    )


def test_addresses_of_a_device_that_leaves_no_gaps() -> None:
    with MainDevice(segment(addresses="packed")) as main:
        [_, sub] = main.scan()
        assert sub.channel is not None
        assert main.converse(eoe.read_address(sub.channel)) == INITIAL


def test_a_refusal_has_a_code_and_a_text() -> None:
    with MainDevice(segment(addresses="refused")) as main:
        [_, sub] = main.scan()
        assert sub.channel is not None
        for asked in (
            eoe.read_address(sub.channel),
            eoe.write_address(sub.channel, EthernetAddress(ip=IPv4Address("10.0.0.2"))),
        ):
            with pytest.raises(EoeError, match="0x0201: the device has no IP address") as caught:
                main.converse(asked)
            assert (caught.value.position, caught.value.result) == (1, 0x0201)


def test_no_answer_is_an_error_in_time() -> None:
    with MainDevice(segment(addresses="silent")) as main:
        [_, sub] = main.scan()
        assert sub.channel is not None
        with pytest.raises(ResponseTimeout, match="no answer to a EOE message"):
            main.converse(eoe.read_address(sub.channel))


def test_a_device_without_a_filter() -> None:
    with MainDevice(segment(size=256)) as main:
        channel = main.scan()[1].channel
        assert channel is not None
        with pytest.raises(EoeError, match="does not support this request"):
            main.converse(eoe.read_filter(channel))
        with pytest.raises(EoeError, match="does not support this request"):
            main.converse(eoe.write_filter(channel, MacFilter()))


def test_a_message_that_does_not_fit_is_refused(sub: SubDevice) -> None:
    assert sub.channel is not None
    with pytest.raises(MailboxError, match="126 bytes does not fit"):
        sub.main.converse(eoe.write_filter(sub.channel, MacFilter()))


@pytest.mark.parametrize("size", [64, 128, 500, 1024])
def test_frames_in_both_directions(size: int) -> None:
    with MainDevice(segment(size=size)) as main:
        host = Host(main.scan()[1])
        assert host.exchange(ARP_REQUEST) == [ARP_ANSWER]
        sizes = (0, 1, 56, 300, 1472)
        answers = host.exchange(*(ping(k, each) for k, each in enumerate(sizes)), turns=200)
        assert [echo(frame) for frame in answers] == [
            (k, ping(k, each)[42:]) for k, each in enumerate(sizes)
        ]
        assert not host.assembler.drops


@pytest.mark.parametrize("counter", ["echoed", "stuck", "zero"])
def test_counters_that_do_not_identify_repetitions(counter: str) -> None:
    with MainDevice(segment(quirks=MailboxQuirks(counter=counter))) as main:  # type: ignore[arg-type]
        host = Host(main.scan()[1])
        assert len(host.exchange(*(ping(k) for k in range(8)))) == 8


def test_time_stamps_are_removed() -> None:
    with MainDevice(segment(time_stamps=True)) as main:
        assert Host(main.scan()[1]).exchange(ARP_REQUEST) == [ARP_ANSWER]


FAULTS = {
    "duplicate": (Drop.DUPLICATE, 8),
    "reordered": (Drop.ORDER, 4),
    "lost": (Drop.ORDER, 4),
    "longer": (Drop.TOO_LONG, 4),
    "endless": (Drop.TOO_LONG, 4),
}


@pytest.mark.parametrize(("fault", "expected"), FAULTS.items(), ids=FAULTS.keys())
def test_faults_of_every_second_frame(fault: str, expected: tuple[Drop, int]) -> None:
    reason, arrived = expected
    with MainDevice(segment(fragments=fault, faulty_every=2)) as main:
        host = Host(main.scan()[1])
        answers = host.exchange(*(ping(k, 300) for k in range(8)), turns=400)
        assert len(answers) == arrived
        assert all(echo(frame) is not None for frame in answers)
        assert host.assembler.drops[reason] >= 4


def test_lost_frames_do_not_stop_the_exchange() -> None:
    link = FaultInjector(segment(), seed=3)
    with MainDevice(link) as main:
        host = Host(main.scan()[1])
        link.inject(Fault(kind="lose", probability=0.05))
        answers = host.exchange(*(ping(k, 200) for k in range(40)), turns=600)
        numbers = [found[0] for frame in answers if (found := echo(frame)) is not None]
        assert numbers == sorted(set(numbers))
        assert len(numbers) >= 30


def test_a_device_that_does_not_read_its_mailbox() -> None:
    terminal = AnalogInputs(protocols=[Ethernet()])
    with MainDevice(Segment([Coupler(), terminal])) as main:
        host = Host(main.scan()[1])
        terminal.mailbox_silent = True
        with pytest.raises(MailboxError, match="has not read its mailbox for 1 s"):
            host.exchange(ping(1), ping(2), turns=10_000)


def test_other_protocols_are_served_under_a_flood() -> None:
    with MainDevice(segment(flood=5000.0)) as main:
        [_, sub] = main.scan()
        host = Host(sub)
        for _ in range(20):
            assert sub.sdo.read(0x1018, 1) == b"YNTC"
            main.converse(eoe.pump(host.channel, host, 16))
        assert len(host.received) > 20
