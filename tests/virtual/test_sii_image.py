"""Images made from descriptions, read by the decoder that judges real ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Junction,
    Servo,
)
from catenary.virtual.description import VENDOR_ID
from catenary.virtual.sii_image import checksum, make_sii_image
from catenary.wire.sii import decode_sii

DEVICES: list[Device] = [
    Coupler(),
    Servo(serial=7, alias=3),
    Servo(axes=8),
    DigitalOutputs(bits=16),
    DigitalInputs(bits=9),
    AnalogInputs(channels=8),
    Junction(port_count=3),
]


@pytest.mark.parametrize("device", DEVICES, ids=lambda d: d.name)
def test_the_decoder_finds_what_was_described(device: Device) -> None:
    description = device.description()
    sii = decode_sii(make_sii_image(description))
    assert sii.header.vendor == VENDOR_ID
    assert sii.header.product == description.product_code
    assert sii.header.station_alias == description.alias
    assert sii.general is not None
    assert sii.general.physical_ports == {2: 0x0011, 3: 0x0111}[len(device.ports)]


def test_the_checksum_of_a_real_image(shared_data: Path) -> None:
    image = (shared_data / "sii" / "beckhoff_el2004.bin").read_bytes()
    assert checksum(image) == image[14]
