"""AoE: the header, fragments, and the data of the ADS services; tshark as the judge."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire import ads
from catenary.wire.ads_error import ERRORS, UNKNOWN_ERROR, ads_meaning
from catenary.wire.ads_response import (
    AdsState,
    DeviceInfo,
    Sample,
    States,
    decode_data,
    decode_device_info,
    decode_notification,
    decode_result,
    decode_states,
    encode_notification,
    encode_result,
)
from catenary.wire.aoe import (
    Address,
    Command,
    Flag,
    Fragment,
    Message,
    decode_aoe,
    fragments,
    join,
    net_id_of,
    net_id_text,
)
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.pcapng import Packet, encode_header, encode_packet
from tests.wire.strategies import u16, u32

DEVICE = Address(bytes((127, 0, 0, 1, 16, 1)), 0xFFFF)
MAIN = Address(bytes((127, 0, 0, 1, 1, 1)), 0x8000)

# Header as in the tables of WAGO's manual 765-1205/100-000, 14.1.3; data as in ecataoe.h (SSC).
# Each entry: target, source, command, flags, length, error and invoke ID, then the data.
ADDRESSES = "7f0000011001ffff 7f0000010101 0080".replace(" ", "")
GOLDEN = {
    ADDRESSES + "0200 0400 0c000000 00000000 07000000 02f30000 01001810 04000000": (
        ads.Read(0xF302, 0x1018_0001, 4)
    ),
    ADDRESSES + "0300 0400 0f000000 00000000 07000000 20400000 10000000 03000000 616263": (
        ads.Write(0x4020, 0x10, b"abc")
    ),
    ADDRESSES + "0900 0400 11000000 00000000 07000000 20400000 10000000 02000000 01000000 ff": (
        ads.ReadWrite(0x4020, 0x10, 2, b"\xff")
    ),
    ADDRESSES + "0100 0400 00000000 00000000 07000000": ads.ReadDeviceInfo(),
    ADDRESSES + "0400 0400 00000000 00000000 07000000": ads.ReadState(),
    ADDRESSES + "0500 0400 08000000 00000000 07000000 0500 0000 00000000": ads.WriteControl(5),
    ADDRESSES
    + "0600 0400 28000000 00000000 07000000 20400000 10000000 04000000 04000000 00000000 "
    + "10270000"
    + "00" * 16: ads.AddNotification(0x4020, 0x10, 4, ads.Transmission.ON_CHANGE, 0, 10_000),
    ADDRESSES + "0700 0400 04000000 00000000 07000000 2a000000": ads.DeleteNotification(42),
}
REQUESTS = {bytes.fromhex(text): request for text, request in GOLDEN.items()}

addresses = st.builds(Address, st.binary(min_size=6, max_size=6), u16)
plain = st.integers(0, 0xFFFF).filter(lambda number: number != Command.FRAGMENT)
messages = st.builds(Message, addresses, addresses, plain, st.binary(max_size=200), u32, u16, u32)
parts = st.builds(Fragment, addresses, addresses, u16, u16, st.binary(max_size=40), u16, u32)


def message(request: ads.Request) -> Message:
    return Message(DEVICE, MAIN, request.command, request.encode(), 7)


@pytest.mark.parametrize("encoded", REQUESTS)
def test_golden_bytes(encoded: bytes) -> None:
    request = REQUESTS[encoded]
    assert message(request).encode() == encoded
    found = decode_aoe(encoded)
    assert found == message(request)
    assert ads.decode_request(found.command, found.data) == request


@given(st.one_of(messages, parts))
def test_every_message_survives_a_round_trip(sent: Message | Fragment) -> None:
    assert decode_aoe(sent.encode()) == sent
    assert decode_aoe(sent.encode() + b"padding") == sent


@given(messages, st.integers(48, 200))
def test_fragments_join_to_the_message(sent: Message, size: int) -> None:
    found = list(fragments(sent, size, 9))
    assert all(len(each.encode()) <= size for each in found)
    assert [each.number for each in found] == list(range(len(found)))
    assert {each.packet for each in found} == {9}
    data = b"".join(each.data for each in found)
    assert found[0].total == len(data)
    assert found[0].invoke_id == sent.invoke_id
    assert join(found[0], data) == sent


def test_the_first_fragment_as_the_ssc_sends_it() -> None:
    """ecataoe.c, AmsFragRes: the rest of the header, then the data, behind a second header."""
    response = message(ads.ReadState()).answered(bytes(range(40)))
    first, second = fragments(response, 64, 3)
    head = "7f0000010101 0080 7f0000011001 ffff 0209 0200 20000000 00000000"
    own = "0400 0500 28000000 00000000 07000000"
    assert first.encode() == bytes.fromhex(f"{head} 0000 0300 {own}") + bytes(range(16))
    assert second.encode()[28:] == bytes.fromhex("0100 0300") + bytes(range(16, 40))
    assert first.is_answer
    assert not second.is_answer
    answer = Fragment(MAIN, DEVICE, 3, 0, flags=Flag.RESPONSE)
    assert Fragment(DEVICE, MAIN, 3, 0, b"x", 0).acknowledge() == answer
    assert answer.is_response


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (bytes(31), "needs 32 bytes, received 31"),
        (bytes(20) + b"\x01" + bytes(11), "announces 1 bytes, 0 received"),
    ],
)
def test_lying_lengths_are_refused(data: bytes, match: str) -> None:
    with pytest.raises(DecodeError, match=match):
        decode_aoe(data)


def test_invalid_fragments_are_refused() -> None:
    short = Fragment(DEVICE, MAIN, 1, 0, bytes(15))
    assert short.invoke_id == -1
    with pytest.raises(DecodeError, match="first fragment has 15 bytes"):
        _ = short.total
    nested = Fragment(DEVICE, MAIN, 1, 0, b"x").encode()[16:]
    with pytest.raises(DecodeError, match="another fragment"):
        join(short, nested)
    with pytest.raises(ValueError, match="too small for fragments"):
        list(fragments(message(ads.ReadState()), 40, 1))


@pytest.mark.parametrize(
    "wrong",
    [
        Message(Address(b"abc", 1), MAIN, 1),
        Message(DEVICE, Address(bytes(6), 1 << 16), 1),
        Message(DEVICE, MAIN, 1 << 16),
        Message(DEVICE, MAIN, 1, b"", -1),
        Fragment(DEVICE, MAIN, 1, 1 << 16),
    ],
)
def test_fields_that_do_not_fit_are_refused(wrong: Message | Fragment) -> None:
    with pytest.raises(ValueError, match="AoE"):
        wrong.encode()


def test_net_ids_as_text() -> None:
    assert net_id_of("127.0.0.1.16.1") == DEVICE.net_id
    assert net_id_text(DEVICE.net_id) == "127.0.0.1.16.1"
    assert str(DEVICE) == "127.0.0.1.16.1:65535"
    for text in ("", "1.2.3.4.5", "1.2.3.4.5.x", "1.2.3.4.5.256", "1.2.3.4.5.-1"):
        with pytest.raises(ValueError, match="is not a NetId"):
            net_id_of(text)


def test_responses() -> None:
    assert decode_result(bytes.fromhex("02070000")) == 0x702
    assert decode_data(encode_result(0, b"abc")) == b"abc"
    assert encode_result(0x702) == bytes.fromhex("02070000")
    info = bytes.fromhex("00000000 02 0b 9f08") + b"TCatPlcCtrl".ljust(16, b"\0")
    assert decode_device_info(info) == DeviceInfo("TCatPlcCtrl", 2, 11, 2207)
    assert DeviceInfo("TCatPlcCtrl", 2, 11, 2207).encode() == info
    assert decode_states(bytes.fromhex("00000000 0500 0100")) == States(AdsState.RUN, 1)
    assert States(5, 0).name == "RUN"
    assert States(99, 0).name == "state 99"


@pytest.mark.parametrize("size", [0, 2, 4])
def test_data_of_another_length_than_announced_are_refused(size: int) -> None:
    with pytest.raises(DecodeError, match=f"{size} bytes announced, 3 received"):
        decode_data(bytes(4) + size.to_bytes(4, "little") + b"abc")


def test_notifications() -> None:
    # length, 1 stamp: time, 2 samples: handle and size of each
    data = bytes.fromhex("1f000000 01000000 0100000000000000 02000000")
    data += bytes.fromhex("05000000 02000000 aabb 06000000 01000000 cc")
    assert decode_notification(data) == (Sample(5, 1, b"\xaa\xbb"), Sample(6, 1, b"\xcc"))
    samples = (Sample(1, 2, b"abc"), Sample(3, 4, b""))
    assert decode_notification(encode_notification(samples)) == samples
    with pytest.raises(DecodeError, match="exceeds"):
        decode_notification(data[:-1])
    with pytest.raises(DecodeError, match="at most 1024"):
        decode_notification(bytes(4) + b"\xff" * 4)
    with pytest.raises(DecodeError, match=r"notification of \d+ bytes"):
        decode_notification(b"\xff\xff\0\0" + data[4:])


def test_every_error_has_a_text() -> None:
    assert all(meaning.text for meaning in ERRORS.values())
    assert ads_meaning(0x0702).text == "invalid index group"
    assert ads_meaning(0x9999) is UNKNOWN_ERROR


def test_tshark_reads_the_same_fields(tshark: str, tmp_path: Path) -> None:
    """Let Wireshark's dissector of AMS judge the encoder, the only foreign judge of AoE."""
    read = message(ads.Read(0xF302, 0x1018_0001, 4))
    sent = [
        *map(message, GOLDEN.values()),
        read.answered(encode_result(0, b"\x02\0\0\0")),
        read.answered(encode_result(0x702)),
        message(ads.ReadDeviceInfo()).answered(DeviceInfo("probe", 1, 2, 3).encode()),
        message(ads.ReadState()).answered(States(5, 1).encode()),
    ]
    frames = [
        encode_frame([Datagram(EcatCommand.FPWR, 0x1000_1001, _mailbox(each.encode()), 1, 1)])
        for each in sent
    ]
    path = tmp_path / "aoe.pcapng"
    path.write_bytes(
        encode_header("eth0") + b"".join(encode_packet(Packet(0, frame)) for frame in frames)
    )
    names = ("targetnetid", "targetport", "sendernetid", "senderport", "cmdid", "stateflags")
    names += ("cbdata", "errorcode", "invokeid", "ads_indexgroup", "ads_indexoffset")
    names += ("ads_cbreadlength", "ads_cbwritelength", "adsresult", "ads_state", "ads_devicename")
    names += ("ads_notificationhandle", "ads_cycletime")
    options = [part for name in names for part in ("-e", f"ams.{name}")]
    done = subprocess.run(
        [tshark, "-r", str(path), "-T", "fields", *options, "-e", "_ws.malformed"],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert [row[4:9] for row in rows] == [
        [str(each.command), f"0x{each.flags:04x}", str(len(each.data)), "0x00000000", "0x00000007"]
        for each in sent
    ]
    assert [row[:4] for row in rows[:8]] == [
        ["127.0.0.1.16.1", "65535", "127.0.0.1.1.1", "32768"]
    ] * 8
    assert [row[:4] for row in rows[8:]] == [
        ["127.0.0.1.1.1", "32768", "127.0.0.1.16.1", "65535"]
    ] * 4
    assert [row[-1] for row in rows] == [""] * len(sent)
    found = [dict(zip(names[9:], row[9:-1], strict=True)) for row in rows]
    place = {"ads_indexgroup": "0x00004020", "ads_indexoffset": "0x00000010"}
    assert [{name: text for name, text in row.items() if text} for row in found] == [
        {"ads_indexgroup": "0x0000f302", "ads_indexoffset": "0x10180001"},
        place,
        place | {"ads_cbreadlength": "2", "ads_cbwritelength": "1"},
        {},
        {},
        {"ads_state": "0x0005"},
        place | {"ads_cycletime": "10000"},
        {"ads_notificationhandle": "0x0000002a"},
        {"adsresult": "0x00000000"},
        {},  # the dissector expects data after a result
        {"adsresult": "0x00000000", "ads_devicename": "probe"},
        {"adsresult": "0x00000000", "ads_state": "0x0005"},
    ]


def _mailbox(data: bytes) -> bytes:
    return Mailbox(Type.AOE, data, 1).encode(128)
