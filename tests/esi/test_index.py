"""Index of one file: identities, places, references, and files that are not ESI files."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import EsiError
from catenary.esi.device import DeviceKey, RevisionCheck
from catenary.esi.document import make_document
from catenary.esi.index import element_of, index_document, index_file
from catenary.esi.record import FileIndex, Kind
from tests.esi.esi_file import VENDOR, device, esi, module


def index(text: str, codec: str = "utf-8") -> FileIndex:
    return index_document(make_document(text.encode(codec), "a.xml"))


def test_devices_have_identity_rule_and_place() -> None:
    text = esi(
        device(0x10, 0x20, attributes='CheckRevisionNo="EQ_OR_G"', name="A\n drive"),
        device(
            0x11,
            1,
            inner='<HideType RevisionNo="#x0"/><HideType RevisionNo="7" ProductCode="#x9"/>',
        ),
    )
    found = index(text)
    first, second = found.entries
    assert (found.vendor, found.vendor_name, found.groups) == (VENDOR, "Acme", {"G": "Drives"})
    assert (first.kind, first.key) == (Kind.DEVICE, DeviceKey(VENDOR, 0x10, 0x20))
    assert (first.type, first.name) == ("DRIVE-1", "A drive")
    assert first.revision_check is RevisionCheck.EQUAL_OR_GREATER
    assert second.hides == (DeviceKey(VENDOR, 0x11, 0), DeviceKey(VENDOR, 9, 7))
    assert first.line == 1 + text[: text.index("<Device ")].count("\n")
    assert found.warnings == ()


@pytest.mark.parametrize("codec", ["utf-8", "utf-8-sig", "gb2312", "shift_jis", "utf-16"])
def test_a_place_gives_the_device_again(codec: str) -> None:
    text = esi(device(1, name="中文"), device(2, name="中文")).replace(
        'encoding="utf-8"', f'encoding="{codec.removesuffix("-sig")}"'
    )
    data = text.encode(codec)
    found = index_document(make_document(data, "a.xml"))
    for entry in found.entries:
        piece = data[entry.offset : entry.offset + entry.length]
        element = element_of(piece, entry, found.encoding, "a.xml")
        assert element.tag == "Device"
        assert element.all("Name")[1].text == entry.name == "中文"
        assert element.line == entry.line


def test_modules_and_references_are_indexed() -> None:
    found = index(
        esi(
            modules=module(0x11) + module(0x12),
            reference="<InfoReference>Modules\\Io.xml</InfoReference><InfoReference/>",
        )
    )
    assert [(each.kind, each.ident) for each in found.entries] == [
        (Kind.MODULE, 0x11),
        (Kind.MODULE, 0x12),
    ]
    assert found.references == ("Modules/Io.xml",)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (f"<EtherCATModule><Modules>{module(3)}</Modules></EtherCATModule>", Kind.MODULE),
        ("<EtherCATDict><Dictionary><Objects/></Dictionary></EtherCATDict>", Kind.DICTIONARY),
    ],
)
def test_other_roots(text: str, kind: Kind) -> None:
    assert [each.kind for each in index(text).entries] == [kind]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<project><a/></project>", "not an ESI file: root project"),
        ("<EtherCATInfo/>", "no device, module or dictionary"),
    ],
)
def test_other_files_have_a_warning(text: str, message: str) -> None:
    found = index(text)
    assert found.entries == ()
    assert [each.message for each in found.warnings] == [message]


def test_a_device_without_a_valid_number_is_ignored_with_a_warning() -> None:
    found = index(esi(device(), device(2)).replace('"#x1"', '"none"', 1))
    assert [each.product for each in found.entries] == [2]
    assert "ProductCode 'none' is not a number" in found.warnings[-1].message
    assert "the device is ignored" in found.warnings[-1].message


def test_a_device_can_have_its_own_vendor() -> None:
    found = index(esi(device(inner="<Vendor><Id>7</Id><Name>Other</Name></Vendor>")))
    assert found.entries[0].key == DeviceKey(7, 1, 1)


def test_a_truncated_file_is_an_error() -> None:
    with pytest.raises(EsiError, match="not well-formed"):
        index(esi(device())[:-30])


def test_the_shared_files(shared_data: Path) -> None:
    files = [index_file(path) for path in sorted((shared_data / "esi").glob("*.xml"))]
    entries = [entry for each in files for entry in each.entries]
    assert len(files) == 10
    devices = [entry for entry in entries if entry.kind is Kind.DEVICE]
    assert len(devices) == 11
    assert all(entry.vendor and entry.product and entry.type for entry in devices)
