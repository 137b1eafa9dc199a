"""Fuzz targets for every codec of `catenary.wire` and `catenary.types`, and for captures.

    python tests/fuzz/fuzz_wire.py [--seconds N] [--seed S] [--target NAME]

Any bytes give a value or DecodeError; a value encodes, and its encoding is stable. With atheris
installed and one --target, coverage guides the search; else mutations of golden bytes do.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import random
import struct
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import Any

from catenary import types
from catenary.capture import EventStream
from catenary.capture.notes import notes
from catenary.errors import DecodeError
from catenary.wire import (
    ads,
    ads_response,
    al,
    aoe,
    capture,
    clock,
    coe,
    datagram,
    diagnosis_history,
    dl,
    eoe,
    eoe_address,
    error_counters,
    features,
    fmmu,
    foe,
    frame,
    fsoe,
    gateway,
    latch,
    mailbox,
    pcap,
    pcapng,
    register,
    sdo_information,
    sercos,
    sercos_values,
    sii,
    sii_categories,
    sii_interface,
    soe,
    sync_manager,
    voe,
)
from catenary.wire.eoe_address import EthernetAddress, MacFilter
from catenary.wire.eoe_frames import MAX_FRAME, FrameAssembler, fragments_of


@dataclass(frozen=True)
class Target:
    """One decoder. `encode` converts its value back to bytes; None if there is no encoder."""

    name: str
    decode: Callable[[bytes], Any]
    encode: Callable[[Any], bytes] | None
    corpus: tuple[bytes, ...]
    exact: bool = False  # True if `encode` restores every byte


def check(target: Target, data: bytes) -> None:
    """Raises AssertionError, or whatever a broken decoder raises."""
    try:
        value = target.decode(data)
    except DecodeError:
        return
    if target.encode is None:
        return
    first = target.encode(value)
    if target.exact:
        assert first == data, f"{target.name}: {data.hex()} became {first.hex()}"
    again = target.encode(target.decode(first))
    assert again == first, f"{target.name}: {first.hex()} became {again.hex()}"


def _sercos_value(data: bytes) -> tuple[sercos.Attribute, sercos_values.Value]:
    """Decode an attribute and the value that follows it."""
    attribute = sercos.decode_attribute(data[:4])
    return attribute, sercos_values.decode_value(attribute, data[4:])


def _method(value: Any) -> bytes:
    encoded = value.encode()
    assert isinstance(encoded, bytes)
    return encoded


def _first(data: bytes) -> datagram.Datagram:
    return datagram.decode_datagram(data)[0]


def _timeline(data: bytes) -> list[str]:
    """Return the text of every event of a capture, and its notes."""
    stream = EventStream(io.BytesIO(data).read)
    texts = [f"{event.step} {event.content}" for event in stream]
    return [*texts, *notes(stream.counts, stream.masters)]


def _timeline_of_frames(data: bytes) -> list[str]:
    """Return the timeline of frames, each with its length in two bytes before it."""
    blocks, rest = [pcapng.encode_header("eth0")], data
    while len(rest) > 2:
        size = int.from_bytes(rest[:2], "little") % frame.MAXIMUM_SIZE
        packet = pcapng.Packet(20_000 * len(blocks), rest[2 : 2 + size])
        blocks.append(pcapng.encode_packet(packet))
        rest = rest[2 + size :]
    return _timeline(b"".join(blocks))


def _ads_request(data: bytes) -> ads.Request:
    """Decode a request. The first byte is its command."""
    return ads.decode_request(data[0] if data else 0, data[1:])


def _encoded_ads_request(request: ads.Request) -> bytes:
    return bytes((request.command,)) + request.encode()


def _assembled(data: bytes) -> list[bytes]:
    """Return the Ethernet frames of EoE fragments, each with its length in a byte before it."""
    assembler, frames, rest = FrameAssembler(), [], data
    while rest:
        part, rest = rest[1 : 1 + rest[0]], rest[1 + rest[0] :]
        try:
            message = eoe.decode_eoe(part)
        except DecodeError:
            continue
        if isinstance(message, eoe.Fragment):
            frames.append(assembler.add(message, len(rest)) or b"")
    assert all(len(frame) <= MAX_FRAME for frame in frames)
    return frames


def _word(name: str, decode: Callable[[int], Any], size: int, *values: int) -> Target:
    """Return the target of a register word of `size` bytes."""

    def from_bytes(data: bytes) -> Any:
        return decode(int.from_bytes(data[:size], "little"))

    def to_bytes(value: Any) -> bytes:
        word = getattr(value, "word", getattr(value, "byte", None))
        assert isinstance(word, int)
        return word.to_bytes(size, "little")

    corpus = tuple(value.to_bytes(size, "little") for value in values)
    return Target(name, from_bytes, to_bytes, corpus)


def _type(entry: types.DataType[Any]) -> Target:
    corpus = (bytes(entry.size or 6), b"\x01" * (entry.size or 6), b"\xff" * entry.size)
    return Target(f"types.{entry.name}", entry.decode, entry.encode, corpus)


# ethercrab's tests/replay-ek1100-el2828-el2889.pcapng, frame 2296: two datagrams
FRAME = bytes.fromhex(
    "ffffffffffff10101010101088a41c10047c001030010280000000000000047d021030010200000000000000"
)
# ethercrab's dumps/twincat-scan-boxes.pcapng, frame 0: the header counts one byte too many
TWINCAT_FRAME = bytes.fromhex("0101050100007285c28dd3c488a40e100840020001010100040000020000").ljust(
    60, b"\x00"
)
STRINGS = sii_categories.encode_strings(("Servo", "drive", "in"))
GENERAL = sii_categories.General(name=1, order=2, coe=sii_categories.CoeDetails.SDO).encode()
SYNC_MANAGERS = bytes.fromhex("001000022600010100120002220001020016000024000103001a000020000104")
PDO = bytes.fromhex("0016010000051100007001060101000001160100000711001070010601010000")
CLOCK_MODES = bytes.fromhex("000000000000000000000000000000070000000000000000")
SII = sii.Sii(
    sii.Header(vendor=2, product=0x044C2C52, revision=0x00120000),
    (
        sii.Category(sii.CategoryType.STRINGS, STRINGS),
        sii.Category(sii.CategoryType.GENERAL, GENERAL),
        sii.Category(sii.CategoryType.FMMU, b"\x01\x02\x03\xff"),
        sii.Category(sii.CategoryType.SYNC_MANAGER, SYNC_MANAGERS),
        sii.Category(sii.CategoryType.TXPDO, PDO),
        sii.Category(sii.CategoryType.DISTRIBUTED_CLOCKS, CLOCK_MODES),
    ),
).encode()
SDO_DOWNLOAD = bytes.fromhex("00202f121c0000000000")
COE = (
    SDO_DOWNLOAD,
    bytes.fromhex("003060121c0000000000"),
    bytes.fromhex("00304108100006000000454b31393134"),
    coe.UploadRequest(0x1018, 1).encode(),
    coe.UploadSegment(True, False, b"abcdefghijk").encode(),
    coe.DownloadSegment(False, True, b"abc").encode(),
    coe.UploadSegmentRequest(True).encode(),
    coe.DownloadSegmentResponse(True).encode(),
    coe.Abort(0x1000, 0, 0x06020000).encode(),
    coe.Emergency(0x8611, 0x21, b"12345").encode(),
    sdo_information.list_request(sdo_information.ListType.ALL).encode(),
)
PCAP = (
    struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    + struct.pack("<4I", 1, 2, len(FRAME), len(FRAME))
    + FRAME
)
ADS_REQUESTS: tuple[ads.Request, ...] = (
    ads.Read(0xF302, 0x10180001, 4),
    ads.Write(0x4020, 0, b"abc"),
    ads.ReadWrite(0x4020, 0, 4, b"abc"),
    ads.WriteControl(5, 0, b"x"),
    ads.AddNotification(0x4020, 0, 4, 4, 0, 10_000),
    ads.DeleteNotification(1),
    ads.ReadDeviceInfo(),
    ads.ReadState(),
)
ADDRESSES = (aoe.Address(bytes((1, 2, 3, 4, 5, 6)), 0xFFFF), aoe.Address(bytes(6), 0x8000))
AOE = tuple(aoe.Message(*ADDRESSES, each.command, each.encode(), 7) for each in ADS_REQUESTS)
AOE_FRAGMENTS = tuple(aoe.fragments(AOE[2], 48, 1))
ADS_SAMPLES = (ads_response.Sample(1, 5, b"abcd"), ads_response.Sample(2, 6, b""))
MAILBOX_DATA = mailbox.Mailbox(mailbox.Type.COE, SDO_DOWNLOAD, 1).encode(64)
BRING_UP = tuple(
    frame.encode_frame([datagram.Datagram(command, address, data, i, counter)], source=source)
    for i, (command, address, data) in enumerate(
        (
            (datagram.EcatCommand.APWR, 0x0010_0000, b"\x01\x10"),
            (datagram.EcatCommand.FPWR, 0x0800_1001, bytes.fromhex("0010400026000100")),
            (datagram.EcatCommand.FPWR, 0x0808_1001, bytes.fromhex("4010400022000100")),
            (datagram.EcatCommand.FPWR, 0x1000_1001, MAILBOX_DATA),
            (datagram.EcatCommand.FPRD, 0x1040_1001, MAILBOX_DATA),
            (datagram.EcatCommand.FPWR, 0x0502_1001, bytes.fromhex("000108000000")),
            (datagram.EcatCommand.FPRD, 0x0508_1001, SII[16:24]),
            (datagram.EcatCommand.FPRD, 0x0130_1001, bytes.fromhex("140000001a00")),
            (datagram.EcatCommand.FRMW, 0x0910_1001, bytes(8)),
            (datagram.EcatCommand.LRW, 0x0001_0000, bytes(4)),
        )
    )
    for counter, source in ((0, b"\x10" * 6), (1, b"\x12" + b"\x10" * 5))
)
EOE_FRAGMENTS = b"".join(
    len(each.encode()).to_bytes(1, "little") + each.encode()
    for number in range(3)
    for each in fragments_of(bytes(300), number, 100)
)
FRAMES = b"".join(len(each).to_bytes(2, "little") + each for each in BRING_UP)
TIMELINE = pcapng.encode_header("eth0") + b"".join(
    pcapng.encode_packet(pcapng.Packet(20_000 * i, data)) for i, data in enumerate(BRING_UP)
)
CAPTURE = pcapng.encode_header("eth0") + pcapng.encode_packet(pcapng.Packet(5, FRAME, "hello"))

TARGETS = (
    *(_type(entry) for entry in types.ALL),
    Target("datagram.decode_datagram", _first, _method, (FRAME[16:30], FRAME[30:])),
    Target("frame.decode_frame", frame.decode_frame, _method, (FRAME, TWINCAT_FRAME), exact=True),
    Target("frame.is_alien", frame.is_alien, None, (FRAME, TWINCAT_FRAME)),
    Target("frame.is_own", lambda data: frame.is_own(data, FRAME[6:12]), None, (FRAME,)),
    Target("register.Register.unpack", register.AL_STATUS.unpack, None, (b"\x08\x00",)),
    _word("al.AlControl.from_word", al.AlControl.from_word, 2, 0x11, 0x08),
    _word("al.AlStatus.from_word", al.AlStatus.from_word, 2, 0x08, 0x14),
    _word("dl.DlControl.from_word", dl.DlControl.from_word, 4, 0x01070001),
    _word("dl.DlStatus.from_word", dl.DlStatus.from_word, 2, 0x5A31),
    _word("sync_manager.Control.from_byte", sync_manager.Control.from_byte, 1, 0x26, 0x64),
    _word(
        "sii_interface.ControlStatus.from_word", sii_interface.ControlStatus.from_word, 2, 0x8160
    ),
    Target(
        "sync_manager.decode_sync_manager",
        sync_manager.decode_sync_manager,
        _method,
        (bytes.fromhex("000f010044000100"),),
    ),
    Target(
        "fmmu.decode_fmmu",
        fmmu.decode_fmmu,
        _method,
        (bytes.fromhex("0000000001000007000f000201000000"),),
    ),
    Target("features.decode_information", features.decode_information, _method, (b"\x11" * 10,)),
    Target(
        "error_counters.decode_error_counters",
        error_counters.decode_error_counters,
        _method,
        (bytes(range(20)),),
    ),
    Target("clock.decode_clock", clock.decode_clock, _method, (bytes(range(56)),)),
    Target(
        "clock.decode_receive_times",
        clock.decode_receive_times,
        clock.encode_receive_times,
        (bytes(range(16)),),
        exact=True,
    ),
    Target(
        "clock.decode_difference",
        lambda data: clock.decode_difference(int.from_bytes(data[:4], "little")),
        lambda value: clock.encode_difference(value).to_bytes(4, "little"),
        (b"\x01\x00\x00\x80",),
    ),
    Target("sii.decode_sii", sii.decode_sii, _method, (SII,), exact=True),
    Target("sii.decode_header", sii.decode_header, _method, (SII[:128],)),
    Target("sii.decode_category_header", sii.decode_category_header, None, (SII[128:132],)),
    Target(
        "sii_categories.decode_strings",
        sii_categories.decode_strings,
        sii_categories.encode_strings,
        (STRINGS,),
    ),
    Target("sii_categories.decode_general", sii_categories.decode_general, _method, (GENERAL,)),
    Target(
        "sii_categories.decode_sync_managers",
        sii_categories.decode_sync_managers,
        sii_categories.encode_sync_managers,
        (SYNC_MANAGERS,),
    ),
    Target(
        "sii_categories.decode_pdos",
        sii_categories.decode_pdos,
        sii_categories.encode_pdos,
        (PDO,),
    ),
    Target(
        "sii_categories.decode_clock_modes",
        sii_categories.decode_clock_modes,
        sii_categories.encode_clock_modes,
        (CLOCK_MODES,),
    ),
    Target(
        "mailbox.decode_mailbox",
        mailbox.decode_mailbox,
        _method,
        (mailbox.Mailbox(mailbox.Type.COE, SDO_DOWNLOAD, 1).encode(128),),
    ),
    Target("mailbox.decode_error", mailbox.decode_error, _method, (b"\x01\x00\x04\x00",)),
    Target("coe.decode_coe", coe.decode_coe, _method, COE),
    Target(
        "fsoe.decode",
        fsoe.decode,
        fsoe.encode,
        (bytes.fromhex("4e0734120100"), bytes.fromhex("360102aabb0304ccdd0500")),
        exact=True,
    ),
    Target(
        "foe.decode_foe",
        foe.decode_foe,
        _method,
        (
            foe.WriteRequest("app.efw", 0x1234).encode(),
            foe.Data(1, bytes(range(40))).encode(),
            foe.Acknowledge(1).encode(),
            foe.Error(0x8003, "full").encode(),
            foe.Busy(3, 100, "erase").encode(),
        ),
    ),
    Target(
        "aoe.decode_aoe",
        aoe.decode_aoe,
        _method,
        tuple(each.encode() for each in (*AOE, *AOE_FRAGMENTS)),
    ),
    Target(
        "ads.decode_request",
        _ads_request,
        _encoded_ads_request,
        tuple(bytes((each.command,)) + each.encode() for each in ADS_REQUESTS),
    ),
    Target("ads_response.decode_result", ads_response.decode_result, None, (bytes(4),)),
    Target(
        "ads_response.decode_data",
        ads_response.decode_data,
        lambda data: ads_response.encode_result(0, data),
        (ads_response.encode_result(0, b"abcd"),),
    ),
    Target(
        "ads_response.decode_device_info",
        ads_response.decode_device_info,
        _method,
        (ads_response.DeviceInfo("probe", 1, 2, 3).encode(),),
    ),
    Target(
        "ads_response.decode_states",
        ads_response.decode_states,
        _method,
        (ads_response.States(5, 1).encode(),),
    ),
    Target(
        "ads_response.decode_handle",
        ads_response.decode_handle,
        ads_response.encode_handle,
        (ads_response.encode_handle(3),),
    ),
    Target(
        "ads_response.decode_notification",
        ads_response.decode_notification,
        ads_response.encode_notification,
        (ads_response.encode_notification(ADS_SAMPLES),),
    ),
    Target("voe.decode_voe", voe.decode_voe, _method, (voe.VoeMessage(2, 1, b"hello").encode(),)),
    Target(
        "gateway.decode_gateway",
        gateway.decode_gateway,
        gateway.encode_gateway,
        (
            bytes.fromhex("10500a00e903002300204180f90200000000"),
            gateway.encode_gateway(mailbox.Mailbox(mailbox.Type.FOE, bytes(64), 7, 0x1002)),
        ),
    ),
    Target(
        "eoe.decode_eoe",
        eoe.decode_eoe,
        _method,
        (
            eoe.Fragment(0, 3, 5, bytes(range(64)), False).encode(),
            eoe.Fragment(1, 2, 5, bytes(range(9)), time_stamp=7).encode(),
            eoe.TimeStamp(5, 7).encode(),
            eoe.SetAddress(EthernetAddress(b"\2" * 6, IPv4Address("10.0.0.2"))).encode(),
            eoe.GetAddressResult(EthernetAddress(name="drive")).encode(),
            bytes.fromhex("0701000006000000") + bytes(8),  # without gaps
            eoe.SetFilter(MacFilter((b"\2" * 6,), (b"\xff" * 6,), True)).encode(),
            eoe.SetFilterResult(0x0401).encode(),
        ),
    ),
    Target(
        "eoe_address.decode_address",
        eoe_address.decode_address,
        _method,
        (EthernetAddress(b"\2" * 6, IPv4Address("10.0.0.2"), name="drive").encode(), bytes(4)),
    ),
    Target(
        "eoe_address.decode_filter",
        eoe_address.decode_filter,
        _method,
        (MacFilter((b"\2" * 6,), (b"\xff" * 6,)).encode(),),
    ),
    Target(
        "soe.decode_soe",
        soe.decode_soe,
        _method,
        (
            soe.Message(soe.OpCode.READ_REQUEST, 47, soe.Element.VALUE).encode(),
            soe.Message(soe.OpCode.READ_RESPONSE, 2, data=bytes(9), incomplete=True).encode(),
            soe.Message(soe.OpCode.WRITE_RESPONSE, 1, data=b"\x05\x70", error=True).encode(),
        ),
        exact=True,
    ),
    Target("sercos.decode_attribute", sercos.decode_attribute, _method, (b"\x01\x00\x22\x04",)),
    Target(
        "sercos_values.decode_value",
        _sercos_value,
        lambda pair: pair[0].encode() + sercos_values.encode_value(*pair),
        (
            bytes.fromhex("01005500" + "0400080033000a80"),
            bytes.fromhex("01002204" + "3a300000"),
            bytes.fromhex("01006300" + "000000000000f83f"),
        ),
    ),
    Target(
        "diagnosis_history.decode_diagnosis_message",
        diagnosis_history.decode_diagnosis_message,
        diagnosis_history.DiagnosisMessage.encode,
        (
            bytes.fromhex("020000e1020202371fc59d6131000000050002050080"),
            bytes.fromhex("01e0000001040000000000000000000003100102030220") + b"OK",
        ),
    ),
    Target(
        "latch.decode_times",
        lambda data: latch.decode_times(data, 32 << (len(data) & 1)),
        None,
        (bytes(range(16)),),
    ),
    Target(
        "sdo_information.decode_sdo_information",
        sdo_information.decode_sdo_information,
        _method,
        (bytes.fromhex("008001000000") + b"\x01\x00",),
    ),
    Target(
        "sdo_information.decode_object_list",
        sdo_information.decode_object_list,
        _method,
        (bytes.fromhex("010000100810"),),
    ),
    Target(
        "sdo_information.decode_object_description",
        sdo_information.decode_object_description,
        _method,
        (bytes.fromhex("001007000007") + b"Device type",),
    ),
    Target(
        "sdo_information.decode_entry_description",
        sdo_information.decode_entry_description,
        _method,
        (bytes.fromhex("00100000070020000700") + b"Device type",),
    ),
    Target("sdo_information.decode_error", sdo_information.decode_error, None, (bytes(4),)),
    Target("pcapng.decode_pcapng", pcapng.decode_pcapng, None, (CAPTURE,)),
    Target("capture.decode_capture", capture.decode_capture, None, (CAPTURE, PCAP)),
    Target("pcap.decode_pcap", pcap.decode_pcap, None, (PCAP,)),
    Target("eoe_frames.FrameAssembler", _assembled, None, (EOE_FRAGMENTS,)),
    Target("capture.EventStream", _timeline, None, (TIMELINE, PCAP)),
    Target("capture.EventStream of frames", _timeline_of_frames, None, (FRAMES,)),
)

_TELLING = (0x00, 0x01, 0x07, 0x0F, 0x7F, 0x80, 0xFE, 0xFF)
_MAXIMUM_SIZE = 4096


def mutations(corpus: tuple[bytes, ...], random_source: random.Random) -> Iterator[bytes]:
    """Yield mutations of the corpus, endlessly."""
    while True:
        data = bytearray(random_source.choice((*corpus, b"")))
        for _ in range(random_source.randint(1, 8)):
            _mutate(data, random_source)
        yield bytes(data[:_MAXIMUM_SIZE])


def _mutate(data: bytearray, random_source: random.Random) -> None:
    place = random_source.randint(0, len(data))
    choice = random_source.randrange(6)
    if choice == 0:
        data[place:place] = random_source.randbytes(random_source.randint(1, 16))
    elif choice == 1:
        del data[place : place + random_source.randint(1, 16)]
    elif choice == 2:
        data[place:place] = data[place : place + random_source.randint(1, 64)]
    elif place < len(data):
        telling = random_source.choice(_TELLING)
        data[place] = (telling, data[place] ^ 1 << random_source.randrange(8), place & 0xFF)[
            choice - 3
        ]


def fuzz(
    targets: tuple[Target, ...], seed: int, *, rounds: int, seconds: float | None = None
) -> int:
    """`rounds` inputs for each target; with `seconds`, again until they are over. Returns the
    number of inputs tried."""
    end = None if seconds is None else time.monotonic() + seconds
    tried = 0
    sources = [
        mutations(target.corpus, random.Random(f"{seed} {target.name}")) for target in targets
    ]
    while True:
        for target, source in zip(targets, sources, strict=True):
            for _ in range(rounds):
                _check_reporting(target, next(source))
            tried += rounds
        if end is None or time.monotonic() >= end:
            return tried


def _check_reporting(target: Target, data: bytes) -> None:
    try:
        check(target, data)
    except Exception as error:
        error.add_note(f"fuzz target {target.name}, input {data.hex()}")
        raise


def _fuzz_with_atheris(target: Target, seconds: float, seed: int) -> None:
    import atheris  # type: ignore[import-not-found]

    limits = [f"-max_total_time={int(seconds)}", f"-seed={seed}", f"-max_len={_MAXIMUM_SIZE}"]
    atheris.instrument_all()
    atheris.Setup([sys.argv[0], *limits], lambda data: _check_reporting(target, data))
    atheris.Fuzz()


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--target", choices=[target.name for target in TARGETS])
    arguments = parser.parse_args()
    chosen = tuple(each for each in TARGETS if arguments.target in (None, each.name))
    if arguments.target and importlib.util.find_spec("atheris"):
        _fuzz_with_atheris(chosen[0], arguments.seconds, arguments.seed)
        return 0
    tried = fuzz(chosen, arguments.seed, rounds=200, seconds=arguments.seconds)
    print(f"{tried} inputs on {len(chosen)} targets, seed {arguments.seed}: no finding")
    return 0


if __name__ == "__main__":
    sys.exit(main())
