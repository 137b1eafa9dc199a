"""EoE: fragments, addresses, filters, and bytes that are not valid."""

from __future__ import annotations

import subprocess
from ipaddress import IPv4Address
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.eoe import (
    Fragment,
    GetAddress,
    GetAddressResult,
    GetFilter,
    GetFilterResult,
    Message,
    Result,
    SetAddress,
    SetAddressResult,
    SetFilter,
    SetFilterResult,
    TimeStamp,
    decode_eoe,
    result_text,
)
from catenary.wire.eoe_address import EthernetAddress, MacFilter
from catenary.wire.frame import encode_frame
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.pcapng import Packet, encode_header, encode_packet
from tests.wire.strategies import u16, u32

MAC = bytes.fromhex("020000000001")
ALL = EthernetAddress(
    MAC,
    IPv4Address("192.168.7.2"),
    IPv4Address("255.255.255.0"),
    IPv4Address("192.168.7.1"),
    IPv4Address("8.8.4.4"),
    "drive",
)
ADDRESS = (
    MAC.hex() + "0207a8c0" + "00ffffff" + "0107a8c0" + "04040808" + "6472697665".ljust(64, "0")
)

ip = st.none() | st.integers(0, 0xFFFF_FFFF).map(IPv4Address)
mac = st.binary(min_size=6, max_size=6)
name = st.none() | st.text(st.characters(min_codepoint=1, max_codepoint=0x7F), max_size=32)
address = st.builds(EthernetAddress, st.none() | mac, ip, ip, ip, ip, name, st.booleans())
port, four = st.integers(0, 15), st.integers(0, 15)
six = st.integers(0, 63)
data = st.binary(max_size=40)
filters = st.builds(
    MacFilter,
    st.lists(mac, max_size=15).map(tuple),
    st.lists(mac, max_size=3).map(tuple),
    st.booleans(),
)
messages: st.SearchStrategy[Message] = st.one_of(
    st.builds(Fragment, six, six, four, data, st.just(False), st.none(), st.booleans(), port),
    st.builds(Fragment, six, six, four, data, st.just(True), st.none() | u32, st.booleans(), port),
    st.builds(TimeStamp, four, u32, port),
    st.builds(SetAddress, address, port),
    st.builds(SetAddressResult, u16, port),
    st.builds(GetAddress, port),
    st.builds(GetAddressResult, st.none() | address, u16, port),
    st.builds(SetFilter, filters, port),
    st.builds(SetFilterResult, u16, port),
    st.builds(GetFilter, port),
    st.builds(GetFilterResult, st.none() | filters, u16, port),
)

# From the tables of ETG.1000.6 §5.7, as the SSC (ecateoe.h) and IgH (fsm_eoe.c) use them.
GOLDEN: dict[str, Message] = {
    "00000001" + "00" * 32: Fragment(0, 4, 0, bytes(32), last=False),
    "00014110" + "abcd": Fragment(1, 1, 1, b"\xab\xcd"),
    "10070232" + "01020304" + "78563412": Fragment(
        2, 8, 3, b"\1\2\3\4", True, 0x12345678, True, port=1
    ),
    "01010050" + "04030201": TimeStamp(5, 0x01020304),
    "02010000" + "3f000000" + ADDRESS: SetAddress(ALL),
    "02010000" + "00000100" + "00" * 54: SetAddress(EthernetAddress(append_time=True)),
    "03010000": SetAddressResult(),
    "03010102": SetAddressResult(Result.NO_IP_SUPPORT),
    "06010000": GetAddress(),
    "07010000" + "3f000000" + ADDRESS: GetAddressResult(ALL),
    "07010200": GetAddressResult(None, Result.UNSUPPORTED_TYPE),
    "04010000" + "9100" + MAC.hex() + "00" * 90 + "ff" * 6 + "00" * 18: SetFilter(
        MacFilter((MAC,), (b"\xff" * 6,), True)
    ),
    "05010104": SetFilterResult(Result.NO_FILTER_SUPPORT),
    "08010000": GetFilter(),
    "09010000" + "0000" + "00" * 120: GetFilterResult(MacFilter()),
}


@pytest.mark.parametrize("encoded", GOLDEN)
def test_golden_bytes(encoded: str) -> None:
    message = GOLDEN[encoded]
    assert message.encode().hex() == encoded
    assert decode_eoe(bytes.fromhex(encoded)) == message


@given(messages)
def test_every_message_survives_a_round_trip(message: Message) -> None:
    assert decode_eoe(message.encode()) == message


@given(st.binary(max_size=140))
def test_any_bytes_give_a_message_or_decode_error(data: bytes) -> None:
    try:
        message = decode_eoe(data)
    except DecodeError:
        return
    assert decode_eoe(message.encode()) == message


def test_an_address_without_gaps_as_of_soem() -> None:
    # SOEM (ecx_EOEsetIp) and SOES (EOE_get_ip) send present fields only.
    packed = bytes.fromhex("07010000" + "06000000" + "0207a8c0" + "00ffffff")
    assert decode_eoe(packed) == GetAddressResult(EthernetAddress(ip=ALL.ip, mask=ALL.mask))
    short_name = bytes.fromhex("07010000" + "20000000") + b"drive"
    assert decode_eoe(short_name) == GetAddressResult(EthernetAddress(name="drive"))


def test_gaps_are_found() -> None:
    assert not EthernetAddress().has_gap
    assert not EthernetAddress(MAC, ALL.ip).has_gap
    assert EthernetAddress(ip=ALL.ip).has_gap
    assert EthernetAddress(MAC, ALL.ip, name="x").has_gap


def test_a_time_stamp_belongs_to_the_last_fragment_only() -> None:
    assert decode_eoe(bytes.fromhex("00020000" + "0102030405")) == Fragment(
        0, 0, 0, b"\1\2\3\4\5", last=False
    )


@pytest.mark.parametrize(
    "data",
    [
        *("", "000100", "0a010000", "0f010000"),
        *("01010000" + "0102", "00030000" + "010203"),  # time stamps
        *("02010000" + "0100", "02010000" + "01000000" + "0102", "07010000" + "20000000"),
        *("04010000" + "0000", "09010000" + "00" * 121),
    ],
)
def test_short_messages_and_unknown_types_are_refused(data: str) -> None:
    with pytest.raises(DecodeError, match="EoE"):
        decode_eoe(bytes.fromhex(data))


@pytest.mark.parametrize(
    "message",
    [
        *(Fragment(64, 0, 0, b""), Fragment(0, 64, 0, b""), Fragment(0, 0, 16, b"")),
        Fragment(0, 0, 0, b"", last=False, time_stamp=1),
        *(Fragment(0, 0, 0, b"", time_stamp=1 << 32), Fragment(0, 0, 0, b"", port=16)),
        *(TimeStamp(16, 0), TimeStamp(0, -1), SetAddressResult(1 << 16), GetAddress(-1)),
        SetAddress(EthernetAddress(mac=b"12345")),
        SetAddress(EthernetAddress(name="x" * 33)),
        SetAddress(EthernetAddress(name="ä")),
        *(SetFilter(MacFilter((MAC,) * 16)), SetFilter(MacFilter((), (MAC,) * 4))),
        SetFilter(MacFilter((b"1",))),
    ],
)
def test_fields_that_do_not_fit_are_refused(message: Message) -> None:
    with pytest.raises(ValueError, match="EoE"):
        message.encode()


def test_every_result_has_a_text() -> None:
    assert all(result_text(result) for result in Result)
    assert result_text(0x1234) == "code of the vendor"


def test_tshark_reads_the_same_fields(tshark: str, tmp_path: Path) -> None:
    """Let Wireshark's dissector judge the encoder.

    It does not show addresses in answers. It expects the flags of a filter in another place than
    the SSC (ecateoe.h), and cannot judge filters.
    """
    path = tmp_path / "eoe.pcapng"
    frames = [
        encode_frame([Datagram(EcatCommand.FPWR, 0x1000_1001, _mailbox(each.encode()), 1, 1)])
        for each in GOLDEN.values()
    ]
    path.write_bytes(
        encode_header("eth0") + b"".join(encode_packet(Packet(0, frame)) for frame in frames)
    )
    fields = (
        *("type", "fragno", "offset", "frame", "last", "timestamp", "init.macaddr"),
        *("init.ipaddr", "init.subnetmask", "init.defaultgateway", "init.dnsserver"),
        *("init.dnsname", "init.append_timestamp"),
    )
    options = [part for name in fields for part in ("-e", f"ecat_mailbox.eoe.{name}")]
    done = subprocess.run(
        [tshark, "-r", str(path), "-T", "fields", *options],
        capture_output=True,
        text=True,
        check=True,
    )
    found = [line.split("\t") for line in done.stdout.splitlines()]
    assert [row[0] for row in found] == [str(int(encoded[1], 16)) for encoded in GOLDEN]
    assert ["|".join(row[1:]) for row in found[:6]] == [
        "0|128|0|0||||||||",
        "1|32|1|1||||||||",
        "2|256|3|1|305419896|||||||",
        "||||16909060|||||||",
        "|||||02:00:00:00:00:01|192.168.7.2|255.255.255.0|192.168.7.1|8.8.4.4|drive|0",
        "|||||00:00:00:00:00:00|0.0.0.0|0.0.0.0|0.0.0.0|0.0.0.0||1",
    ]


def _mailbox(data: bytes) -> bytes:
    return Mailbox(Type.EOE, data, counter=1).encode(256)
