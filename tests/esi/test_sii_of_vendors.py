"""Images built from ESIs, compared with the images of the same vendors.

Each difference has a reason in a table. A difference without a reason fails, and so does a reason
without a difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from catenary.esi.reader import read_esi
from catenary.esi.sii import build_sii
from catenary.wire.sii import HEADER_SIZE, decode_sii
from tests.esi.sii_facts import differences

# Generator of the EaserCAT images: kubabuda/EEPROM_generator, src/generators/EEPROM.js
EASERCAT = {
    "categories": "the generator writes neither PDOs nor clock modes",
    "general image": "the generator has a field for it; our data model of an ESI has none",
    "general flags": "the generator always writes 0, although DataLinkLayer is true",
    "general byte 14": "the generator leaves the copy of the group number 0",
    "FMMU 3": "padding: 0 there, 0xFF here, as in Beckhoff's images",
    "?xPDO *": "the generator writes no PDOs",
    "OpMode *": "the generator writes no clock modes",
}
# Generator of Pollen's images: one category for each PDO and OpMode, as in Newtec's esctool
POLLEN = {
    "categories": "the generator writes one category for each PDO and OpMode",
    "header vendor": "the generator reads the malformed number 0xF3F as 0",
    "general order": "the generator does not store the order code",
    "SyncManager 2 use": "the generator does not know the text and writes 0",
    "?xPDO 0x* entry * type": "the generator writes UINT8 as 6 (UINT); it is 5 (USINT)",
    "OpMode 1 shift_time_ns": "ESI 2000200000; the image has 1882234944",
    "OpMode 1 assign_activate": "ESI 0x0300; the generator wrote 0",
    "OpMode 1 sync0_factor": "ESI 1; the generator wrote 0",
}
REASONS: Mapping[str, Mapping[str, str]] = {
    "metalmusings_EaserCAT_2000": EASERCAT,
    "metalmusings_EaserCAT_6000": EASERCAT,
    "pollen_LeftElbowOrbita2d_fw1.0": {
        **POLLEN,
        "SyncManager [01] use": "the generator does not know the text and writes 0",
    },
    "pollen_Orbita2d": {
        **POLLEN,
        "SyncManager 3 use": "the generator does not know the text and writes 0",
        "general flags": "the generator writes 0, although DataLinkLayer is true",
    },
}
# Bytes of the header that differ: the vendor ID of Pollen
HEADERS = {
    "metalmusings_EaserCAT_2000": [],
    "metalmusings_EaserCAT_6000": [],
    "pollen_LeftElbowOrbita2d_fw1.0": [0x10, 0x11],
    "pollen_Orbita2d": [0x10, 0x11],
}


def images(shared_data: Path, name: str) -> tuple[bytes, bytes]:
    """Return the vendor's image, and ours with the same serial number."""
    vendor = (shared_data / "sii" / f"{name}.bin").read_bytes()
    [device] = read_esi(shared_data / "esi" / f"{name}.xml").devices
    return vendor, build_sii(device, serial=decode_sii(vendor).header.serial)


@pytest.mark.parametrize("name", REASONS)
def test_each_difference_has_a_reason(shared_data: Path, name: str) -> None:
    vendor, built = images(shared_data, name)
    different = differences(decode_sii(vendor), decode_sii(built))
    reasons = REASONS[name]
    unexplained = {
        field: values
        for field, values in different.items()
        if not any(fnmatchcase(field, pattern) for pattern in reasons)
    }
    assert unexplained == {}
    unused = [
        pattern
        for pattern in reasons
        if not any(fnmatchcase(field, pattern) for field in different)
    ]
    assert unused == []


@pytest.mark.parametrize("name", HEADERS)
def test_the_header_is_equal_bit_for_bit(shared_data: Path, name: str) -> None:
    vendor, built = images(shared_data, name)
    places = [place for place in range(HEADER_SIZE) if vendor[place] != built[place]]
    assert places == HEADERS[name]


@pytest.mark.parametrize("name", REASONS)
def test_the_sync_managers_are_equal_except_for_their_use(shared_data: Path, name: str) -> None:
    vendor, built = (decode_sii(image) for image in images(shared_data, name))
    assert [(e.address, e.length, e.control, e.enable) for e in vendor.sync_managers] == [
        (e.address, e.length, e.control, e.enable) for e in built.sync_managers
    ]


@pytest.mark.parametrize("name", ["pollen_LeftElbowOrbita2d_fw1.0", "pollen_Orbita2d"])
def test_the_pdos_are_equal_with_names_flags_and_lengths(shared_data: Path, name: str) -> None:
    vendor, built = images(shared_data, name)
    different = differences(decode_sii(vendor), decode_sii(built))
    fields = [field for field in different if "PDO" in field]
    assert fields
    assert all(different[field] == (6, 5) for field in fields)
