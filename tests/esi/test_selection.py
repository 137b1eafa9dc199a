"""Choice of one device in an ESI file."""

from __future__ import annotations

import pytest

from catenary.errors import ConfigurationError
from catenary.esi.device import DeviceKey, EsiDevice, EsiFile
from catenary.esi.selection import select_device


def device(product: int, revision: int, order: str, name: str) -> EsiDevice:
    return EsiDevice(DeviceKey(2, product, revision), "Vendor", order, name)


OLD = device(0x10, 1, "EL3104", "Analogue input")
NEW = device(0x10, 2, "EL3104", "Analogue input")
OTHER = device(0x20, 1, "EL31", "Another input")
FILE = EsiFile("vendor.xml", 2, "Vendor", (OLD, NEW, OTHER))


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ("el3104", NEW),
        ("Analogue input", NEW),
        ("EL31", OTHER),
        ("another", OTHER),
        ("0x10", NEW),
        ("16:1", OLD),
        ("0x20:1", OTHER),
    ],
)
def test_a_device_is_found(wanted: str, expected: EsiDevice) -> None:
    assert select_device(FILE, wanted) is expected


def test_the_only_device_needs_no_name() -> None:
    assert select_device(EsiFile("a.xml", 2, "V", (OTHER,))) is OTHER


@pytest.mark.parametrize(
    ("wanted", "text"),
    [
        ("", "several devices"),
        ("input", "several devices for 'input'"),
        ("0x10:9", "no device for '0x10:9'"),
        ("0x10:1:2", "no device"),
    ],
)
def test_an_ambiguous_or_unknown_device_is_refused(wanted: str, text: str) -> None:
    with pytest.raises(
        ConfigurationError, match=r"EL31 \(0x00000020:0x00000001\)|EL3104"
    ) as caught:
        select_device(FILE, wanted)
    assert text in caught.value.message


def test_a_file_without_devices_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="the file has no device"):
        select_device(EsiFile("a.xml", 2, "V"))
