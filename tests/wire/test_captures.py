"""Captures and SII images of real devices in the shared data: all of them round-trip."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.errors import DecodeError
from catenary.wire.capture import decode_capture
from catenary.wire.coe import (
    DownloadRequest,
    DownloadResponse,
    Message,
    UploadRequest,
    UploadResponse,
    decode_coe,
)
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.fmmu import decode_fmmu
from catenary.wire.frame import Frame, decode_frame
from catenary.wire.mailbox import Mailbox, Type, decode_mailbox
from catenary.wire.register import (
    FMMU_COUNT,
    PROCESS_RAM,
    SYNC_MANAGER_COUNT,
    fmmu,
    sync_manager,
)
from catenary.wire.sii import MailboxProtocol, decode_sii
from catenary.wire.sync_manager import decode_sync_manager

# From shared/data/MANIFEST.tsv: number of frames in each capture, and of CoE messages
CAPTURES = {
    "ecrab_replay-dc.pcapng": (3604, 0),
    "ecrab_replay-ek1100-el2828-el2889.pcapng": (3578, 0),
    "ecrab_replay-ek1914-el3004-configure.pcapng": (1104, 24),
    "ecrab_replay-ek1914-segmented-upload.pcapng": (964, 2),
    "ecrab_rs-example-sii-el2004.ecatonly.pcapng": (254, 0),
    "ecrab_soem-sdinfo-ek1100-el1004.ecatonly.pcapng": (580, 0),
    "ecrab_soem-sdinfo-ek1100-only.ecatonly.pcapng": (188, 0),
    "ecrab_soem-sdinfo-no-slaves.ecatonly.pcapng": (19, 0),
    "ecrab_twincat-scan-boxes.ecatonly.pcapng": (1412, 0),
}
IMAGES = {
    # file: vendor, product, name of the device
    "beckhoff_ek1100.bin": (2, 0x044C2C52, "EK1100 EtherCAT-Koppler (2A E-Bus)"),
    "beckhoff_el2004.bin": (2, 0x07D43052, "EL2004 4K. Dig. Ausgang 24V, 0.5A"),
    "beckhoff_el2828.bin": (2, 0x0B0C3052, "EL2828 8K. Dig. Ausgang 24V, 2A"),
    "beckhoff_el2889.bin": (2, 0x0B493052, "EL2889 16K. Dig. Ausgang 24V, 0.5A, negativ"),
    "metalmusings_EaserCAT_2000.bin": (2730, 0x00BBBCCC, "MetalMusings EaserCAT 2000"),
    "metalmusings_EaserCAT_6000.bin": (2730, 0x6000, "MetalMusings EaserCAT 6000"),
    # vendor 0 is a mistake of the vendor, not a fault of the format
    "pollen_LeftElbowOrbita2d_fw1.0.bin": (0, 1, "LeftElbowOrbita2d"),
    "pollen_Orbita2d.bin": (0, 1, "Orbita2d"),
}


DECODERS = {
    **{fmmu(k).address: decode_fmmu for k in range(FMMU_COUNT)},
    **{sync_manager(k).address: decode_sync_manager for k in range(SYNC_MANAGER_COUNT)},
}


def captured(path: Path) -> list[bytes]:
    return [packet.data for packet in decode_capture(path.read_bytes()).packets]


def frames_of(folder: Path, name: str) -> list[Frame]:
    return [decode_frame(data) for data in captured(folder / "pcap" / name)]


def mailboxes(frames: list[Frame]) -> Iterator[tuple[Datagram, Mailbox]]:
    """Return the mailbox messages that devices received or sent, as whole buffers."""
    for frame in frames:
        for datagram in frame.datagrams:
            physical = datagram.command in (EcatCommand.FPRD, EcatCommand.FPWR)
            if physical and datagram.ado >= PROCESS_RAM and datagram.working_counter:
                yield datagram, decode_mailbox(datagram.data)


def test_every_captured_frame_round_trips(shared_data):
    counts = {}
    for path in (shared_data / "pcap").glob("*.pcapng"):
        packets = captured(path)
        counts[path.name] = len(packets)
        for data in packets:
            assert decode_frame(data).encode() == data
    assert {name: counts[name] for name in CAPTURES} == {
        name: frames for name, (frames, _) in CAPTURES.items()
    }


@pytest.mark.parametrize("name", CAPTURES)
def test_every_mailbox_message_round_trips(shared_data, name):
    frames = frames_of(shared_data, name)
    count = 0
    for datagram, message in mailboxes(frames):
        assert message.type is Type.COE
        size = len(message.data) + 6
        assert message.encode() == datagram.data[:size]
        check_coe(datagram.command, message.data)
        count += 1
    assert count == CAPTURES[name][1]


def check_coe(command: EcatCommand, data: bytes) -> None:
    message = decode_coe(data)
    if command is EcatCommand.FPWR:
        assert message.encode() == data
    else:  # the reserved bytes of the EL3004's download responses contain arbitrary values
        assert decode_coe(message.encode()) == message
        assert message.encode()[:6] == data[:6]


def messages_of(frames: list[Frame]) -> list[Message]:
    return [decode_coe(message.data) for _, message in mailboxes(frames)]


def test_messages_of_an_analogue_input(shared_data):
    messages = messages_of(frames_of(shared_data, "ecrab_replay-ek1914-el3004-configure.pcapng"))
    kinds = [type(message) for message in messages]
    assert kinds == [DownloadRequest, DownloadResponse] * 7 + [UploadRequest, UploadResponse] * 5
    assert messages[-1] == UploadResponse(0x1C13, 0, b"\x04", 1, expedited=True)


def test_upload_of_a_name(shared_data):
    messages = messages_of(frames_of(shared_data, "ecrab_replay-ek1914-segmented-upload.pcapng"))
    assert messages == [UploadRequest(0x1008, 0), UploadResponse(0x1008, 0, b"EK1914", 6)]


def test_sync_manager_and_fmmu_blocks_round_trip(shared_data):
    frames = frames_of(shared_data, "ecrab_replay-dc.pcapng")
    blocks = [
        datagram
        for frame in frames
        for datagram in frame.datagrams
        if datagram.command is EcatCommand.FPWR and datagram.ado in DECODERS and any(datagram.data)
    ]
    assert len(blocks) >= 8
    for datagram in blocks:
        assert DECODERS[datagram.ado](datagram.data).encode() == datagram.data


def test_every_sii_image_round_trips_or_is_refused(shared_data):
    refused = {}
    for path in (shared_data / "sii").glob("*.bin"):
        image = path.read_bytes()
        try:
            assert decode_sii(image).encode() == image
        except DecodeError as error:
            refused[path.name] = error.message
    assert refused["empty_issue286.bin"] == "SII: checksum 0x0000, expected 0x0042"
    assert not refused.keys() & IMAGES.keys()


@pytest.mark.parametrize(("name", "expected"), IMAGES.items())
def test_identity_and_name_in_sii_images(shared_data, name, expected):
    sii = decode_sii((shared_data / "sii" / name).read_bytes())
    assert sii.general is not None
    found = (sii.header.vendor, sii.header.product, sii.string(sii.general.name))
    assert found == expected


def test_pdos_of_a_drive(shared_data):
    sii = decode_sii((shared_data / "sii" / "pollen_Orbita2d.bin").read_bytes())
    assert [pdo.index for pdo in sii.transmit_pdos] == [0x1700, 0x1800]
    assert [pdo.index for pdo in sii.receive_pdos] == [0x1600]
    assert len(sii.clock_modes) == 2
    assert sii.header.mailbox_protocols == MailboxProtocol.COE | MailboxProtocol.FOE


def test_intel_hex_and_binary_images_are_equal(shared_data):
    text = (shared_data / "sii" / "metalmusings_EaserCAT_2000.hex").read_text()
    records = [bytes.fromhex(line[1:]) for line in text.split()]
    image = b"".join(record[4:-1] for record in records if record[3] == 0)
    assert image == (shared_data / "sii" / "metalmusings_EaserCAT_2000.bin").read_bytes()
    assert decode_sii(image).header.vendor == 2730
