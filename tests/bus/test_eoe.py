"""Ethernet ports of devices: `sub.eoe`, and the bridge to the network stack of this machine."""

from __future__ import annotations

import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from ipaddress import IPv4Address
from typing import Any

import pytest

import catenary as cat
from catenary.bus import MainDevice, SubDevice
from catenary.bus.eoe import make_address
from catenary.bus.ethernet_bridge import EthernetBridge
from catenary.bus.ethernet_port import QUEUE_MAX
from catenary.bus.event_types import EthernetDropped
from catenary.bus.mac_table import PER_PORT_MAX, MacTable
from catenary.errors import ConfigurationError, MailboxError, TapError
from catenary.types import UDINT
from catenary.virtual import AnalogInputs, Coupler, Ethernet, Segment, Servo
from catenary.wire.eoe_address import EthernetAddress
from tests.ethernet_wire import SECONDS, Wire
from tests.virtual.ethernet_frames import (
    ARP_ANSWER,
    ARP_REQUEST,
    BROADCAST,
    MAC,
    OWN_MAC,
    echo,
    ping,
)

TEXT = "<p>" + "".join(f"{k} " for k in range(20_000))


def terminal(**options: Any) -> AnalogInputs:
    return AnalogInputs(mailbox_bytes=512, protocols=[Ethernet(**options)])


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    found = Wire()
    monkeypatch.setattr("catenary.bus.segment_eoe.Tap", lambda name: found)
    return found


@pytest.fixture
def main() -> Iterator[MainDevice]:
    with MainDevice(Segment([Coupler(), terminal()], clock="monotonic")) as main:
        main.scan()
        yield main


def until(condition: Callable[[], object]) -> None:
    """Wait for a condition. A thread changes it."""
    event = threading.Event()
    for _ in range(int(SECONDS * 100)):
        if condition():
            return
        event.wait(0.01)
    raise AssertionError("the condition did not become true")


# -- addresses


def test_set_address_takes_texts(main: MainDevice) -> None:
    eoe = main.subs[1].eoe
    eoe.set_address(ip="10.0.0.2/16", dns="8.8.8.8", name="arm")
    assert eoe.address() == EthernetAddress(
        MAC,
        IPv4Address("10.0.0.2"),
        IPv4Address("255.255.0.0"),
        None,
        IPv4Address("8.8.8.8"),
        "arm",
    )
    eoe.set_address(mac="02:00:00:00:00:99")
    assert eoe.request_address().result().mac == bytes.fromhex("020000000099")


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"ip": "300.1.1.1"},
        {"ip": "10.0.0.2/24", "mask": "255.0.0.0"},
        {"mac": "02:00"},
        {"mac": "ff:ff:ff:ff:ff:ff"},
        {"mac": "hello"},
        {"name": "x" * 33},
        {"name": "ä"},
    ],
)
def test_wrong_addresses_are_refused_before_anything_is_sent(
    main: MainDevice, wrong: dict[str, str]
) -> None:
    sent = main.counts.sent
    with pytest.raises(ValueError, match=r"\w"):
        main.subs[1].eoe.set_address(**wrong)  # type: ignore[arg-type]
    assert main.counts.sent == sent


def test_the_iterating_thread_must_not_wait() -> None:
    servo = Servo(protocols=[Ethernet()])
    with MainDevice(Segment([servo])) as main:
        [sub] = main.scan()
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            asked = sub.eoe.request_set_address(ip="10.0.0.3")
            for _ in loop:
                if asked.done:
                    break
            with pytest.raises(RuntimeError, match="stop the loop"):
                sub.eoe.address()
        assert asked.result().ip == IPv4Address("10.0.0.3")


def test_devices_that_have_no_port() -> None:
    with MainDevice(Segment([Coupler(), AnalogInputs(mailbox_bytes=40)])) as main:
        coupler, small = main.scan()
        with pytest.raises(MailboxError, match="has no mailbox"):
            coupler.eoe.address()
        with pytest.raises(MailboxError, match="needs room for 36 bytes in a mailbox, it has 34"):
            small.eoe.connect("cat0")
        with pytest.raises(ConfigurationError, match="no device of the last scan has EoE"):
            main.eoe.connect("cat0")
        with pytest.raises(ValueError, match="at least one device"):
            main.eoe.connect("cat0", [])


def test_make_address_accepts_objects() -> None:
    found = make_address(IPv4Address("10.0.0.1"), None, None, None, MAC, None)
    assert found == EthernetAddress(MAC, IPv4Address("10.0.0.1"))


# -- frames, through a wire in place of a TAP


def test_frames_pass_in_both_directions(main: MainDevice, wire: Wire) -> None:
    with main.subs[1].eoe.connect("cat0") as bridge:
        wire.to_devices.put(ARP_REQUEST)
        assert wire.next() == ARP_ANSWER
        for number in range(5):
            wire.to_devices.put(ping(number, 1400))
            assert echo(wire.next()) == (number, ping(number, 1400)[42:])
        counts = bridge.counts[1]
        assert (counts.frames_to_device, counts.frames_from_device) == (6, 6)
        assert counts.bytes_from_device == len(ARP_ANSWER) + 5 * 1442
        assert not counts.dropped
        assert not bridge.errors
    assert wire.closed


def test_frames_pass_during_and_after_a_loop(wire: Wire) -> None:
    servo = Servo(mailbox_bytes=256, protocols=[Ethernet()])
    with MainDevice(Segment([servo], clock="monotonic")) as main:
        [sub] = main.scan()
        with sub.eoe.connect("cat0"):
            wire.to_devices.put(ping(1))
            assert echo(wire.next()) is not None
            arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=1.0)
            with cat.Loop(arm, period=1e-3) as loop:
                loop.run_in_background()
                for number in range(5):
                    wire.to_devices.put(ping(number, 500))
                    assert echo(wire.next()) == (number, ping(number, 500)[42:])
                    assert sub.sdo.read(0x1018, 1, type=UDINT) == 0x43544E59
            wire.to_devices.put(ping(9))
            assert echo(wire.next()) is not None


def test_a_connection_in_virtual_time_can_be_closed_by_the_loop(wire: Wire) -> None:
    with MainDevice(Segment([Servo(protocols=[Ethernet()])])) as main:
        [sub] = main.scan()
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            with sub.eoe.connect("cat0"):
                wire.to_devices.put(ARP_REQUEST)
                for _ in loop:
                    if not wire.from_devices.empty():
                        break
            next(iter(loop))
        assert wire.next() == ARP_ANSWER


def test_the_main_device_closes_its_connections(wire: Wire) -> None:
    with MainDevice(Segment([Coupler(), terminal()], clock="monotonic")) as main:
        main.scan()
        bridge = main.eoe.connect("cat0")
        with pytest.raises(ConfigurationError, match="already connected to wire"):
            main.eoe.connect("cat1")
    assert not bridge.is_open
    assert wire.closed
    assert not [each for each in threading.enumerate() if each.name == "catenary eoe"]


OTHER_MAC = bytes.fromhex("020000000703")


@pytest.mark.parametrize("forward", [False, True])
def test_several_devices_share_one_interface(wire: Wire, forward: bool) -> None:
    second = terminal(mac=OTHER_MAC.hex(":"), ip="192.168.7.3")
    with MainDevice(Segment([terminal(), second], clock="monotonic")) as main:
        main.scan()
        with main.eoe.connect("cat0", forward=forward) as bridge:
            wire.to_devices.put(ARP_REQUEST)  # for the first one
            assert wire.next() == ARP_ANSWER
            wire.to_devices.put(ping(1))
            assert echo(wire.next()) is not None
            counts = bridge.counts
            until(lambda: counts[1].frames_to_device)
            # The broadcast reached both; the ping only the first one, because its address is known.
            assert (counts[0].frames_to_device, counts[1].frames_to_device) == (2, 1)


@pytest.mark.parametrize("forward", [False, True])
def test_frames_between_devices(wire: Wire, forward: bool) -> None:
    flooding = terminal(mac=OTHER_MAC.hex(":"), flood=200.0)
    with MainDevice(Segment([terminal(), flooding], clock="monotonic")) as main:
        main.scan()
        with main.eoe.connect("cat0", forward=forward) as bridge:
            until(lambda: bridge.counts[1].frames_from_device > 20)
            assert wire.next()[:12] == BROADCAST + OTHER_MAC
            if forward:
                until(lambda: bridge.counts[0].frames_to_device > 10)
            else:
                assert bridge.counts[0].frames_to_device == 0


def test_a_flood_of_this_machine_is_dropped_and_reported(main: MainDevice, wire: Wire) -> None:
    with main.subs[1].eoe.connect("cat0") as bridge:
        for number in range(40 * QUEUE_MAX):
            wire.to_devices.put(ping(number & 0xFFFF, 1400))
        until(lambda: bridge.counts[1].dropped["queue full"])
        until(lambda: len(main.events))
        assert main.subs[1].sdo.read(0x1018, 1) == b"YNTC"
        event = main.events.get()
        assert isinstance(event, EthernetDropped)
        assert event.sub is main.subs[1]
        assert set(event.reasons) == {"queue full"}
        assert "Ethernet frames dropped" in event.message


def test_frames_that_no_device_could_accept(main: MainDevice, wire: Wire) -> None:
    with main.subs[1].eoe.connect("cat0") as bridge:
        wire.to_devices.put(MAC + OWN_MAC + bytes(1600))
        wire.to_devices.put(MAC + OWN_MAC + b"\x08")
        wire.to_devices.put(ARP_REQUEST)
        assert wire.next() == ARP_ANSWER
        assert bridge.counts[1].dropped == {"too short or too long for an Ethernet frame": 2}


def test_an_interface_that_is_down_drops_frames(main: MainDevice, wire: Wire) -> None:
    wire.up = False
    with main.subs[1].eoe.connect("cat0") as bridge:
        wire.to_devices.put(ARP_REQUEST)
        until(lambda: bridge.counts[1].dropped["TAP interface down or deleted"])


def test_a_device_that_hangs_is_reported_and_tried_again(wire: Wire) -> None:
    hanging = terminal()
    with MainDevice(Segment([hanging], clock="monotonic")) as main:
        main.scan()
        with main.eoe.connect("cat0") as bridge:
            hanging.mailbox_silent = True
            wire.to_devices.put(ping(1))
            wire.to_devices.put(ping(2))
            until(lambda: "has not read its mailbox" in bridge.errors.get(0, ""))
            assert bridge.counts[0].dropped["the device does not answer"] >= 1
            hanging.mailbox_silent = False
            until(lambda: not bridge.errors)
            wire.to_devices.put(ping(3))
            until(lambda: (echo(wire.next()) or (0,))[0] == 3)


def test_a_device_without_eoe_refuses_the_frames(wire: Wire) -> None:
    with MainDevice(Segment([AnalogInputs()], clock="monotonic")) as main:
        [sub] = main.scan()
        with sub.eoe.connect("cat0") as bridge:
            wire.to_devices.put(ARP_REQUEST)
            until(lambda: "protocol is not supported" in bridge.errors.get(0, ""))


# -- table of addresses


def test_a_table_learns_and_forgets() -> None:
    table: MacTable[str] = MacTable()
    for number in range(PER_PORT_MAX + 1):
        table.learn(bytes([2, 0, 0, 0, 0, number]), "a")
    table.learn(OTHER_MAC, "b")
    table.learn(BROADCAST, "b")
    assert table.find(bytes(6)) is None
    assert table.find(bytes([2, 0, 0, 0, 0, 0])) is None  # the oldest
    assert table.find(bytes([2, 0, 0, 0, 0, 5])) == "a"
    assert table.find(OTHER_MAC) == "b"
    table.learn(OTHER_MAC, "a")
    assert table.find(OTHER_MAC) == "a"
    assert len(table) == PER_PORT_MAX


# -- the network stack of this machine


def fetch(address: str, path: str = "/") -> str:
    with urllib.request.urlopen(f"http://{address}{path}", timeout=SECONDS) as answer:
        return str(answer.read().decode())


@pytest.mark.parametrize(("fault", "other"), [("right", "192.168.7.8"), ("lost", "192.168.7.9")])
def test_a_web_page_through_the_kernel(tap: str, fault: str, other: str) -> None:
    pages = {"/": "<h1>Hello</h1>", "/long": TEXT}
    device = terminal(pages=pages, fragments=fault, faulty_every=7, time_stamps=True)
    with MainDevice(Segment([Coupler(), device], clock="monotonic")) as main:
        sub: SubDevice = main.scan()[1]
        with sub.eoe.connect(tap) as bridge:
            assert fetch("192.168.7.2") == "<h1>Hello</h1>"
            assert fetch("192.168.7.2", "/long") == TEXT
            with pytest.raises(urllib.error.HTTPError, match="404"):
                fetch("192.168.7.2", "/missing")
            sub.eoe.set_address(ip=other, mac="02:00:00:00:07:09")
            assert fetch(other, "/long") == TEXT
            assert bool(bridge.counts[1].dropped) == (fault == "lost")


def test_two_connections_cannot_share_an_interface(tap: str) -> None:
    with MainDevice(Segment([terminal(), terminal()], clock="monotonic")) as main:
        first, second = main.scan()
        with first.eoe.connect(tap), pytest.raises(TapError, match="already in use"):
            second.eoe.connect(tap)
        with second.eoe.connect(tap) as bridge:
            assert isinstance(bridge, EthernetBridge)
