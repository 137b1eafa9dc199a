"""Answers of drivers: given bytes, and the drivers of this machine."""

from __future__ import annotations

import struct
import subprocess

import pytest

from catenary.doctor.card import Card, Coalescing, Eee, Link
from catenary.doctor.ethtool import (
    decode_coalescing,
    decode_eee,
    decode_link,
    read_card,
    read_setting,
    write_setting,
)


def test_coalescing():
    # struct ethtool_coalesce: cmd, rx usecs, frames, both again for irq, tx the same, stats,
    # adaptive rx, adaptive tx, ...
    words = [0x0E, 3, 7, 0, 0, 5, 6, 0, 0, 0, 1, 0, *[0] * 11]
    assert decode_coalescing(struct.pack("=23I", *words)) == Coalescing(3, 7, True)


def test_eee():
    # struct ethtool_eee: cmd, supported, advertised, partner's, active, enabled, lpi, timer
    answer = struct.pack("=10I", 0x44, 0x28, 0x28, 0x28, 1, 1, 1, 17, 0, 0)
    assert decode_eee(answer) == Eee(enabled=True, active=True)
    answer = struct.pack("=10I", 0x44, 0x28, 0x28, 0, 0, 1, 1, 17, 0, 0)
    assert decode_eee(answer) == Eee(enabled=True, active=False)


@pytest.mark.parametrize(
    ("speed", "duplex", "expected"),
    [(100, 1, Link(100, True)), (10, 0, Link(10, False)), (0xFFFFFFFF, 0xFF, Link(-1, None))],
)
def test_link(speed, duplex, expected):
    # struct ethtool_link_settings: cmd, speed, duplex, port, ...
    assert decode_link(struct.pack("=IIB", 0x4C, speed, duplex).ljust(48, b"\0")) == expected


def test_read_the_card_of_a_veth_pair(veth):
    card = read_card(veth[0])
    assert (card.driver, card.link, card.up, card.hardware_type) == (
        "veth",
        Link(10000, True),
        True,
        1,
    )
    assert card.coalescing is None
    assert card.refusals["coalescing"] == "Operation not supported"


def test_an_unsupported_request_raises_oserror(veth):
    with pytest.raises(OSError, match="Operation not supported"):
        read_setting(veth[0], "eee")
    with pytest.raises(OSError, match="Operation not supported"):
        write_setting(veth[0], "rx-usecs", 0)


@pytest.fixture
def tap(veth):
    """Interface whose driver supports only one coalescing setting, drivers/net/tun.c."""
    made = subprocess.run(
        ["ip", "tuntap", "add", "dev", "catenary0", "mode", "tap"], capture_output=True, text=True
    )
    if made.returncode != 0:
        pytest.skip(f"no tap: {made.stderr.strip()}")
    yield "catenary0"
    subprocess.run(["ip", "tuntap", "del", "dev", "catenary0", "mode", "tap"], check=True)


def test_write_a_setting_and_refuse_an_unsupported_one(tap):
    assert read_setting(tap, "rx-usecs") == 0
    write_setting(tap, "rx-usecs", 0)
    with pytest.raises(OSError, match=r"not supported|Invalid"):
        write_setting(tap, "rx-usecs", 5)
    assert read_card(tap).coalescing == Coalescing(0, 0, False)


def test_loopback_has_no_driver():
    card = read_card("lo")
    assert isinstance(card, Card)
    assert (card.driver, card.hardware_type) == ("", 772)
