"""Reader of ESI files: every quirk of the corpus, and faulty files."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import EsiError
from catenary.esi.device import DeviceKey, EsiDevice, EsiFile, RevisionCheck
from catenary.esi.devices import Vendor
from catenary.esi.document import Document, make_document
from catenary.esi.modules import with_modules
from catenary.esi.reader import (
    DEVICE_PATHS,
    MODULE_PATHS,
    read_device,
    read_document,
    read_esi,
    read_module,
)
from catenary.esi.xml import find_elements
from tests.esi import corpus, esi_file

NAME = "a.xml"
KEY = DeviceKey(0xABC, 0x1234, 0x10002)


def read(data: bytes) -> EsiFile:
    return read_document(make_document(data, NAME))


def device_of(name: str) -> EsiDevice:
    return read(corpus.FILES[name]).devices[0]


def warnings_of(file: EsiFile) -> list[str]:
    return [str(each) for part in (file, *file.devices) for each in part.warnings]


@pytest.mark.parametrize("name", corpus.FILES)
def test_every_file_of_the_corpus_is_read(name: str) -> None:
    file = read(corpus.FILES[name])
    assert file.devices or file.modules or file.dictionary
    for device in file.devices:
        assert device.key == KEY or "vendor" in name
        assert device.source.line > 1 or b"?>" not in corpus.FILES[name]


@pytest.mark.parametrize("name", corpus.FAULTY_FILES)
def test_every_faulty_file_is_refused_with_its_name(name: str) -> None:
    with pytest.raises(EsiError, match=r"^a\.xml(:\d+)?: "):
        read(corpus.FAULTY_FILES[name])


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("gb2312", "伺服驱动器"),
        ("gb2312, declared as UTF-8", "伺服驱动器"),
        ("UTF-8, declared as gb2312", "伺服驱动器"),
        ("shift_jis", "サーボ表示"),
        ("windows-1252", "für µm"),
        ("Latin-1, declared as UTF-8", "für µm"),
        ("no declaration, Latin-1", "für µm"),
        ("unknown encoding", "für µm"),
        ("UTF-16", "Example"),
        ("UTF-16 declared", "Example"),
        ("control characters", "Exam ple"),
        ("newlines in names", "Exam ple"),
        ("languages", "Example"),
        ("no language", "Example"),
        ("namespace", "Example"),
    ],
)
def test_names(name: str, expected: str) -> None:
    assert device_of(name).name == expected


@pytest.mark.parametrize(
    "name",
    [
        "plain",
        "every element",
        "no declaration",
        "byte-order mark",
        "UTF-16",
        "gb2312",
        "shift_jis",
        "windows-1252",
        "numbers",
        "languages",
        "no SubIndex",
        "gap",
        "alternative mappings",
        "type attributes",
        "references",
        "vendor in device",
        "modules only",
        "dictionary only",
    ],
)
def test_valid_notations_cause_no_warnings(name: str) -> None:
    assert warnings_of(read(corpus.FILES[name])) == []


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no declaration, Latin-1", "a.xml:2: UTF-8, the default encoding, does not fit"),
        ("UTF-8, declared as gb2312", "a.xml:1: the declared encoding 'gb2312' does not fit"),
        ("faulty characters", "a.xml:3: "),
        ("control characters", "a.xml:2: control character 0x01"),
        ("absurd numbers", "a.xml:3: Sm/@StartAddress: '99999"),
        ("absurd numbers", "a.xml:3: Index: '#xFFFFFFFFFF' does not fit into 16 bits"),
        ("absurd numbers", "a.xml:3: BitLen: '1e99' "),
        ("BitLen 0", "a.xml:3: entry 0x0000 has 0 bits; ignored"),
        ("BitLen 0", "a.xml:3: entry 0x7000 has 0 bits; kept"),
        ("no BitLen", "a.xml:3: Entry has no valid BitLen; 16 bits assumed from its type"),
        ("SyncManager that does not exist", "SyncManager 5, which the device does not have"),
        ("unknown SyncManager", "unknown text 'AxisIn'; used as OUTPUTS because of its PDOs"),
        ("init commands", "a.xml:3: InitCmd without index, data or transition is ignored"),
        ("no vendor", "a.xml:3: neither file nor device has a vendor; 0 assumed"),
        ("faulty device before a good one", "a.xml:3: ProductCode 'abc-x' is not a number"),
    ],
)
def test_faults_become_warnings_with_file_and_line(name: str, message: str) -> None:
    file = read(corpus.FILES[name])
    assert any(message in warning for warning in warnings_of(file)), warnings_of(file)


def test_a_faulty_device_does_not_hide_the_next_one() -> None:
    file = read(corpus.FILES["faulty device before a good one"])
    assert [device.source.line for device in file.devices] == [4]
    assert "the device is ignored" in file.warnings[0].message


def test_the_error_of_an_unusable_file_names_the_first_faulty_device() -> None:
    with pytest.raises(EsiError, match="ProductCode '#x1334910000' is not a number") as caught:
        read(corpus.FAULTY_FILES["only a faulty device"])
    assert caught.value.line == 3


def test_type_attributes() -> None:
    device = device_of("type attributes")
    assert device.revision_check is RevisionCheck.EQUAL_OR_GREATER
    assert device.hides == (KEY._replace(revision=0x10001), KEY._replace(revision=1))
    assert device.alternatives == (DeviceKey(0xABC, 7, 0),)
    assert device.sub_devices == ("EX2",)
    assert device.use_lrd_lwr
    assert device.config_in_safe_op


def test_the_vendor_of_a_device_overrides_that_of_the_file() -> None:
    device = device_of("vendor in device")
    assert (device.key.vendor, device.vendor_name) == (5, "Five")


def test_vendor_groups_and_references() -> None:
    file = read(corpus.FILES["references"])
    assert (file.vendor, file.vendor_name) == (0xABC, "Example")
    assert file.groups == {"IO": "In and out"}
    assert file.references == ("Sub/Modules.xml",)
    assert file.devices[0].dictionary_file == "Sub/Dict.xml"
    assert (file.devices[0].dictionary, file.devices[0].modules) == (None, ())


def references(name: str) -> Document | None:
    names = {"Sub/Modules.xml": "modules only", "Sub/Dict.xml": "dictionary only"}
    return make_document(corpus.FILES[names[name]], name) if name in names else None


def test_referenced_files_are_read() -> None:
    document = make_document(corpus.FILES["references"], NAME)
    file = read_document(document, references=references)
    (device,) = file.devices
    assert [module.ident for module in device.modules] == [1, 2, 3]
    assert device.modules[0].source.file == "Sub/Modules.xml"
    assert device.dictionary is not None
    assert sorted(device.dictionary.objects) == [0x2000, 0x2001, 0x2002, 0x2003, 0x2004]
    assert file.warnings == ()


def faulty(name: str) -> Document:
    if name.endswith("Dict.xml"):
        raise EsiError("cannot be read", file=name)
    return make_document(b"<html/>", name)


def truncated(name: str) -> Document:
    found = references(name)
    assert found is not None
    return make_document(found.data[:-20], name)


def test_references_that_cannot_be_used_become_warnings() -> None:
    document = make_document(corpus.FILES["references"], NAME)
    missing = read_document(document, references=lambda name: None)
    assert len(missing.warnings) == 2
    assert "'Sub/Modules.xml' was not found" in missing.warnings[0].message
    unusable = read_document(document, references=faulty)
    assert ["is not an ESI" in str(each) for each in unusable.warnings] == [True, False]
    assert str(unusable.warnings[1]).startswith("Sub/Dict.xml:")
    faults = read_document(document, references=truncated).warnings
    assert [each.source.file for each in faults] == ["Sub/Modules.xml", "Sub/Dict.xml"]
    assert all("the referenced file is ignored" in each.message for each in faults)


def test_a_dictionary_that_several_devices_name_is_read_once() -> None:
    part = "<Profile><DictionaryFile>Sub\\Dict.xml</DictionaryFile></Profile>"
    names: list[str] = []
    document = make_document(corpus.esi(*[corpus.device(part)] * 3).encode(), NAME)
    file = read_document(document, references=lambda name: names.append(name) or references(name))
    assert names == ["Sub/Dict.xml"]
    assert all(device.dictionary is not None for device in file.devices)


def test_modules_and_dictionaries_as_roots() -> None:
    assert [module.ident for module in read(corpus.FILES["modules only"]).modules] == [1, 2, 3, 4]
    found = read(corpus.FILES["dictionary only"]).dictionary
    assert found is not None
    assert len(found.objects) == 5


def test_modules_are_accepted_by_identification_or_class() -> None:
    file = read(corpus.FILES["every element"])
    (device,) = file.devices
    assert [module.ident for module in device.modules] == [1, 2, 3]
    assert with_modules(device, file.modules[:1]).modules == file.modules[:1]
    assert file.modules[1].init_commands[0].index == 0x1C12
    assert file.modules[1].dictionary is not None


def test_unknown_elements_are_listed_once() -> None:
    assert device_of("unknown elements").unknown == ("Info/Port", "Extra")


@pytest.mark.parametrize("name", corpus.FILES)
def test_one_element_from_its_bytes_equals_that_of_the_file(name: str) -> None:
    data = corpus.FILES[name]
    document = make_document(data, NAME)
    file = read_document(document)
    usable = {device.source.line: device for device in file.devices}
    modules = {module.ident: module for module in file.modules}
    for found in find_elements(document, DEVICE_PATHS | MODULE_PATHS):
        piece = data[found.offset : found.offset + found.length]
        line = found.element.line
        if found.path in MODULE_PATHS:
            module = read_module(piece, document.encoding, file=NAME, line=line)
            assert module == modules[module.ident]
        elif line in usable:
            vendor = Vendor(file.vendor, file.vendor_name)
            device = read_device(
                piece, document.encoding, file=NAME, line=line, vendor=vendor, modules=file.modules
            )
            assert device == usable[line]


def test_a_file_is_read_from_disk(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_bytes(corpus.FILES["plain"])
    assert read_esi(path).devices[0].source.file == str(path)
    with pytest.raises(EsiError, match="cannot be read"):
        read_esi(tmp_path / "b.xml")


def test_many_devices_are_not_in_memory_as_one_tree() -> None:
    device = corpus.device(corpus.SM, corpus.RX, corpus.TX)
    found = find_elements(make_document(corpus.esi(*[device] * 1000).encode(), NAME), DEVICE_PATHS)
    assert sum(1 for _ in found) == 1000


EVERY = corpus.FILES["every element"]
NUMBER = st.one_of(
    st.integers().map(str),
    st.integers(0).map("#x{:x}".format),
    st.text(max_size=8),
    st.sampled_from(["", "#x", "-", "1e400", "9" * 5000, "true", "<", "&amp;", "\0"]),
)


@given(st.data())
def test_any_mutation_of_bytes_raises_nothing_but_esi_errors(data: st.DataObject) -> None:
    changed = bytearray(EVERY)
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(changed)))
        size = data.draw(st.integers(0, 20))
        changed[at : at + size] = data.draw(st.binary(max_size=20))
    with suppress(EsiError):
        read(bytes(changed))


@given(st.data())
def test_any_text_or_attribute_raises_nothing_but_esi_errors(data: st.DataObject) -> None:
    text = EVERY.decode()
    for _ in range(data.draw(st.integers(1, 6))):
        starts = [at + 1 for at, letter in enumerate(text) if letter in '>"']
        start = data.draw(st.sampled_from(starts))
        end = min(at for at in (text.find("<", start), text.find('"', start), len(text)) if at >= 0)
        text = text[:start] + data.draw(NUMBER) + text[end:]
    with suppress(EsiError):
        read(text.encode("utf-8", "replace"))


@given(st.data())
def test_any_removed_element_raises_nothing_but_esi_errors(data: st.DataObject) -> None:
    parts = EVERY.decode().replace("><", ">\n<").split("\n")
    leaves = [part for part in parts if "</" in part and not part.startswith("</")]
    removed = set(data.draw(st.lists(st.sampled_from(leaves), max_size=30)))
    with suppress(EsiError):
        read("\n".join(part for part in parts if part not in removed).encode())


def test_init_commands_of_soe_have_idn_and_drive(tmp_path: Path) -> None:
    """Those without a value, or for a drive that cannot exist, are warnings."""
    soe = (
        "<Mailbox><SoE><InitCmd><Transition>PS</Transition><IDN>#x800A</IDN><Data>3412</Data>"
        '<Comment>word</Comment></InitCmd><InitCmd Chn="1"><Transition>SO</Transition><IDN>2</IDN>'
        "<Data>e803</Data></InitCmd><InitCmd><Transition>SO</Transition><IDN>2</IDN></InitCmd>"
        '<InitCmd Chn="9"><Transition>SO</Transition><IDN>2</IDN><Data>00</Data></InitCmd>'
        "</SoE></Mailbox>"
    )
    [found] = read_esi(esi_file.write(tmp_path / "a.xml", esi_file.device(inner=soe))).devices
    assert found.mailbox is not None
    first, second = found.mailbox.idn_commands
    assert (first.transitions, first.number, first.data) == (("PS",), 0x800A, b"\x34\x12")
    assert (first.drive, first.comment, second.drive) == (0, "word", 1)
    warnings = [str(each) for each in found.warnings]
    assert sum("InitCmd" in each for each in warnings) == 2
