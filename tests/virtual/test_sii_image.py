"""SII images from descriptions, read by the decoder for real ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Junction,
    ModelSensor,
    SafetyLogic,
    SafetyTerminal,
    Servo,
    ServoQuirks,
    SiiQuirks,
)
from catenary.virtual.description import VENDOR_ID
from catenary.virtual.sii_image import checksum, make_sii_image
from catenary.wire.sii import decode_sii
from catenary.wire.sii_categories import GeneralFlags


def model_sensor(**options: object) -> ModelSensor:
    """Return a sensor of a quaternion and a vector, without a plant."""
    sensor = ModelSensor(sensors=("orientation", "gyro"), **options)  # type: ignore[arg-type]
    sensor.measure({"orientation": 4, "gyro": 3})
    return sensor


DEVICES: list[Device] = [
    Coupler(),
    Servo(serial=7, alias=3),
    Servo(axes=8),
    DigitalOutputs(bits=16),
    DigitalInputs(bits=9),
    AnalogInputs(channels=8),
    Junction(port_count=3),
    SafetyLogic(connections=4, size=4),
    SafetyTerminal(),
    model_sensor(),
]


@pytest.mark.parametrize("device", DEVICES, ids=lambda d: d.name)
def test_decoder_returns_the_description(device: Device) -> None:
    description = device.description()
    sii = decode_sii(make_sii_image(description))
    assert sii.header.vendor == VENDOR_ID
    assert sii.header.product == description.product_code
    assert sii.header.station_alias == description.alias
    assert sii.general is not None
    assert sii.general.physical_ports == {2: 0x0011, 3: 0x0111}[len(device.ports)]


@pytest.mark.parametrize(
    "device", [Servo, DigitalOutputs, DigitalInputs, AnalogInputs, SafetyTerminal, model_sensor]
)
@pytest.mark.parametrize("lrw", [True, False])
def test_general_category_shows_missing_lrw_support(
    device: Callable[..., Device], lrw: bool
) -> None:
    """SOEM reads only byte 0x0B, bit 1 (src/ec_config.c, ecx_config_init)."""
    sii = decode_sii(make_sii_image(device(lrw=lrw).description()))
    assert sii.general is not None
    assert bool(sii.general.flags & GeneralFlags.NO_LRW) is not lrw


VARIANTS: list[Device] = [
    *DEVICES,
    *(Servo(lrw=lrw, mailbox_bytes=size) for lrw in (True, False) for size in (64, 128, 256)),
    Servo(quirks=ServoQuirks(watchdog_trigger=False)),
    Servo(sii_quirks=SiiQuirks(pdos="absent")),
    *(AnalogInputs(lrw=lrw, mailbox_bytes=size) for lrw in (True, False) for size in (64, 256)),
    *(model_sensor(lrw=lrw, mailbox_bytes=size) for lrw in (True, False) for size in (64, 256)),
    *(DigitalOutputs(lrw=lrw, bits=bits) for lrw in (True, False) for bits in (1, 8)),
    *(DigitalInputs(lrw=lrw, bits=bits) for lrw in (True, False) for bits in (1, 8)),
    *(SafetyTerminal(lrw=lrw, size=size) for lrw in (True, False) for size in (1, 2, 4)),
    *(SafetyLogic(lrw=lrw, connections=count) for lrw in (True, False) for count in (1, 2)),
]


def test_equal_identities_have_equal_siis() -> None:
    """SOEM reads the SII only once for each identity (ecx_lookup_prev_sii)."""
    images: dict[tuple[int, int], set[bytes]] = {}
    for device in VARIANTS:
        plain = replace(device.whole_description(), name="", alias=0, serial=0)
        image = make_sii_image(plain, device.sii_quirks)
        images.setdefault((plain.product_code, plain.revision), set()).add(image)
    assert {len(of_one_identity) for of_one_identity in images.values()} == {1}


def test_names_aliases_and_serial_numbers_do_not_change_the_revision() -> None:
    named = Servo(name="elbow", alias=3, serial=7).description()
    assert named.revision == Servo().description().revision
    assert named.revision >> 16 == 1


def test_checksum_of_a_real_image(shared_data: Path) -> None:
    image = (shared_data / "sii" / "beckhoff_el2004.bin").read_bytes()
    assert checksum(image) == image[14]
