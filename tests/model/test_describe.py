"""Descriptions from real and faulty SII images (`data/MANIFEST.tsv` lists the sources)."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Identity, mapped_entries
from catenary.virtual import Servo, SiiQuirks
from catenary.virtual.sii_image import make_sii_image
from catenary.wire.sii_categories import SyncManagerUse

INFORMATION = bytes((0x11, 0, 2, 0, 3, 4, 8, 0x0F, 0, 0))


def described(image: bytes) -> DeviceDescription:
    return describe(
        5,
        station_address=0x1006,
        alias=0,
        dl_status=0x0A00,
        information=INFORMATION,
        image=image,
    )


@pytest.fixture
def image(shared_data: Path, request: pytest.FixtureRequest) -> bytes:
    return (shared_data / "sii" / f"{request.param}.bin").read_bytes()


@pytest.mark.parametrize("image", ["beckhoff_ek1100"], indirect=True)
def test_a_coupler_has_neither_mailbox_nor_process_data(image: bytes) -> None:
    device = described(image)
    assert device.order == "EK1100"
    assert device.name.startswith("EK1100 EtherCAT")
    assert device.identity == Identity(2, 0x044C_2C52, 0x0012_0000, 0)
    assert device.mailbox is None
    assert device.outputs == device.inputs == ()


@pytest.mark.parametrize("image", ["beckhoff_el2004"], indirect=True)
def test_a_terminal_of_four_bits(image: bytes) -> None:
    device = described(image)
    [assignment] = device.outputs
    assert (assignment.sync_manager, assignment.bit_length, assignment.byte_length) == (0, 4, 1)
    assert all(pdo.fixed for pdo in device.output_pdos)
    assert device.inputs == ()


@pytest.mark.parametrize("image", ["beckhoff_el2889"], indirect=True)
def test_a_terminal_with_two_sync_managers(image: bytes) -> None:
    device = described(image)
    assert [(a.sync_manager, a.bit_length) for a in device.outputs] == [(0, 8), (1, 8)]
    assert [channel.start for channel in device.sync_managers] == [0x0F00, 0x0F01]


@pytest.mark.parametrize("image", ["metalmusings_EaserCAT_6000"], indirect=True)
def test_a_card_with_pdos_only_in_its_dictionary(image: bytes) -> None:
    device = described(image)
    assert device.mailbox is not None
    assert device.mailbox.coe
    assert (device.mailbox.receive_offset, device.mailbox.receive_size) == (0x1000, 512)
    assert device.outputs == device.inputs == ()
    uses = [channel.use for channel in device.sync_managers]
    assert uses[2:] == [SyncManagerUse.OUTPUTS, SyncManagerUse.INPUTS]


@pytest.mark.parametrize("image", ["pollen_Orbita2d"], indirect=True)
def test_vendor_0_without_fmmus_and_end_mark(image: bytes) -> None:
    device = described(image)
    assert device.identity.vendor == 0
    assert device.name == "Orbita2d"
    assert [a.bit_length for a in device.outputs] == [344]
    assert [a.bit_length for a in device.inputs] == [528]
    assert device.notes == ()


@pytest.mark.parametrize("image", ["pollen_LeftElbowOrbita2d_fw1.0"], indirect=True)
def test_a_pdo_with_an_unsuitable_sync_manager_is_noted(image: bytes) -> None:
    device = described(image)
    assert [(a.sync_manager, [pdo.index for pdo in a.pdos]) for a in device.inputs] == [
        (2, [0x1800])
    ]
    assert any("0x1700" in note for note in device.notes)


@pytest.mark.parametrize("image", ["empty_issue286"], indirect=True)
def test_an_unprogrammed_eeprom_gives_an_unknown_device(image: bytes) -> None:
    device = described(image)
    assert device.name == "unknown"
    assert device.mailbox is None
    assert device.notes


@pytest.mark.parametrize("image", ["beckhoff_el2004"], indirect=True)
def test_a_wrong_checksum_is_only_noted(image: bytes) -> None:
    device = described(image[:14] + bytes([image[14] ^ 0xFF]) + image[15:])
    assert device.order == "EL2004"
    assert any("checksum" in note for note in device.notes)


def test_every_shared_image_is_described(shared_data: Path) -> None:
    images = sorted((shared_data / "sii").glob("*.bin"))
    assert images
    for path in images:
        described(path.read_bytes())


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=600))
def test_any_bytes_are_described(image: bytes) -> None:
    described(image)


@settings(max_examples=200, deadline=None)
@given(data=st.binary(max_size=400), product=st.integers(1, 0xFFFF_FFFE))
def test_any_categories_are_described(data: bytes, product: int) -> None:
    header = bytes(14) + b"\xa4\x88" + bytes(4) + product.to_bytes(4, "little")
    described(header.ljust(128, b"\x00") + data)


def made(**quirks: object) -> DeviceDescription:
    servo = Servo(sii_quirks=SiiQuirks(**quirks))  # type: ignore[arg-type]
    return described(make_sii_image(servo.description(), servo.sii_quirks))


@pytest.mark.parametrize("size", [1, 8, 15, 1487, 65535])
def test_a_mailbox_larger_than_a_datagram_is_omitted_with_a_note(size: int) -> None:
    device = made(mailbox_size=size)
    assert device.mailbox is None
    assert device.notes == (
        f"its SII specifies a mailbox of {size} bytes at 0x1000, which is not used: a mailbox has "
        "16 to 1486 bytes and begins at 0x1000 or above",
    )


@pytest.mark.parametrize("size", [16, 128, 1486])
def test_any_other_mailbox_is_used(size: int) -> None:
    device = made(mailbox_size=size)
    assert device.mailbox is not None
    assert device.mailbox.send_size == size
    assert device.notes == ()


def test_excess_sync_managers_are_omitted_with_a_note() -> None:
    device = made(sync_managers=17)
    assert len(device.sync_managers) == 4  # as in INFORMATION
    assert device.notes == ("its SII has 17 SyncManagers, its controller has 4",)
    assert made(sync_managers=4).notes == ()


def test_control_characters_are_removed_from_names() -> None:
    device = made(text_prefix="\x1b[2J\n")
    assert device.name == "[2JCatenary virtual servo"
    assert all(entry.name.isprintable() for entry in mapped_entries(device.outputs))
