"""Objects of ESI dictionaries."""

from __future__ import annotations

import pytest

from catenary.esi.dictionary import EsiDictionary, EsiObjectEntry
from catenary.esi.document import make_document
from catenary.esi.findings import Findings
from catenary.esi.objects import read_dictionary
from catenary.esi.xml import find_elements
from tests.esi import corpus

FINDINGS = Findings("a.xml")


def read(types: str, objects: str, findings: Findings = FINDINGS) -> EsiDictionary:
    text = f"<D><DataTypes>{types}</DataTypes><Objects>{objects}</Objects></D>"
    (found,) = find_elements(make_document(text.encode(), "a.xml"), frozenset({""}))
    return read_dictionary(found.element, findings)


WHOLE = read(corpus.TYPES, corpus.OBJECTS)
ON_OFF = {0: "off", 1: "on"}


def test_the_elements_of_an_array_are_entries() -> None:
    found = WHOLE.objects[0x2000]
    assert found.depends_on_slot
    assert found.entries == (
        EsiObjectEntry(0x2000, 0, "SubIndex 000", "USINT", 8, default=b"\x03"),
        EsiObjectEntry(0x2000, 1, "SubIndex 001", "UINT", 16, "rw", "RT", default=b"\x2b\x1a"),
        EsiObjectEntry(0x2000, 2, "SubIndex 002", "UINT", 16, "rw", "RT"),
        EsiObjectEntry(0x2000, 3, "SubIndex 003", "UINT", 16, "rw", "RT"),
    )


def test_members_of_a_record_without_a_subindex_are_counted() -> None:
    assert WHOLE.objects[0x2001].entries == (
        EsiObjectEntry(0x2001, 0, "Count", "USINT", 8, "rw"),
        EsiObjectEntry(0x2001, 1, "Mode", "DTENUM", 8, "rw", default=b"\x01", enumeration=ON_OFF),
        EsiObjectEntry(0x2001, 5, "Gain", "REAL", 32, "rw", default=b"\0\0\0\x3f", unit=0xFD040000),
    )


def test_variables() -> None:
    assert WHOLE.entry(0x2002) == EsiObjectEntry(
        0x2002, 0, "Mode", "DTENUM", 8, "rw", "R", b"\x01", b"\0", b"\x01", enumeration=ON_OFF
    )
    offset, label = WHOLE.entry(0x2003), WHOLE.entry(0x2004)
    assert offset is not None
    assert label is not None
    assert (offset.default, label.default) == (b"\xfe\xff", b"abcd")
    assert WHOLE.entry(0x2003, 1) is None
    assert FINDINGS.warnings == []


def variable(kind: str, bits: int, info: str) -> str:
    return (
        f"<Object><Index>1</Index><Name>A</Name><Type>{kind}</Type><BitSize>{bits}</BitSize>"
        f"<Info>{info}</Info></Object>"
    )


@pytest.mark.parametrize(
    ("kind", "bits", "info", "expected"),
    [
        ("UINT", 16, "<DefaultData>0102</DefaultData>", b"\x01\x02"),
        ("UINT", 16, "<DefaultValue>#x0102</DefaultValue>", b"\x02\x01"),
        ("DINT", 32, "<DefaultValue>-1</DefaultValue>", b"\xff\xff\xff\xff"),
        ("BOOL", 1, "<DefaultValue>true</DefaultValue>", b"\x01"),
        ("BIT2", 2, "<DefaultValue>3</DefaultValue>", b"\x03"),
        ("REAL", 32, "<DefaultValue>#x3F800000</DefaultValue>", b"\0\0\x80\x3f"),
        ("REAL", 32, "<DefaultValue>1,5</DefaultValue>", b"\0\0\xc0\x3f"),
        ("UINT", 0, "<DefaultValue>1</DefaultValue>", b"\x01\0"),
        ("UNICODE_STRING", 0, "<DefaultString>a</DefaultString>", b"a\0"),
        ("UINT", 16, "<DefaultValue>65536</DefaultValue>", None),
        ("UINT", 16, "<DefaultValue>abc-x</DefaultValue>", None),
        ("UINT", 16, "<DefaultData>xy</DefaultData>", None),
        ("STRING(9999)", 4_000_000_000, "<DefaultValue>1</DefaultValue>", None),
        ("UINT", 16, "", None),
    ],
)
def test_default_values(kind: str, bits: int, info: str, expected: bytes | None) -> None:
    findings = Findings("a.xml")
    entry = read("", variable(kind, bits, info), findings).entry(1)
    assert entry is not None
    assert entry.default == expected
    assert len(findings.warnings) == (1 if info and expected is None else 0)


def record(*members: str) -> str:
    items = "".join(
        f"<SubItem><SubIdx>{n}</SubIdx><Name>{name}</Name><Type>UINT</Type><BitSize>16</BitSize>"
        f"<BitOffs>0</BitOffs></SubItem>"
        for n, name in enumerate(members)
    )
    return f"<DataType><Name>DT</Name><BitSize>32</BitSize>{items}</DataType>"


def infos(*items: tuple[str, int]) -> str:
    return "".join(
        f"<SubItem><Name>{name}</Name><Info><DefaultValue>{value}</DefaultValue></Info></SubItem>"
        for name, value in items
    )


@pytest.mark.parametrize(
    ("members", "items", "expected"),
    [
        (("a", "b"), (("a", 1), ("b", 2)), [1, 2]),
        (("a", "b"), (("b", 2), ("a", 1)), [1, 2]),
        (("a", "b"), (("b", 2),), [None, 2]),
        (("a", "a"), (("a", 1), ("a", 2)), [1, 2]),
        (("a", "b"), (("x", 1), ("y", 2)), [1, 2]),  # translated names
        (("a", "b"), (("x", 1),), [None, None]),
    ],
)
def test_info_belongs_to_the_entry_with_its_name_or_position(
    members: tuple[str, ...], items: tuple[tuple[str, int], ...], expected: list[int | None]
) -> None:
    found = read(record(*members), variable("DT", 32, infos(*items))).objects[1]
    values = [
        None if entry.default is None else int.from_bytes(entry.default, "little")
        for entry in found.entries
    ]
    assert values == expected


def test_the_unit_of_an_array_applies_to_its_elements() -> None:
    found = read(corpus.TYPES, variable("DT2000", 64, "<Unit>#x00010000</Unit>")).objects[1]
    assert [entry.unit for entry in found.entries] == [None, 0x10000, 0x10000, 0x10000]


def test_types_that_refer_to_themselves_end() -> None:
    types = (
        "<DataType><Name>A</Name><BaseType>B</BaseType></DataType>"
        "<DataType><Name>B</Name><BaseType>A</BaseType></DataType>"
        "<DataType><Name>C</Name><SubItem><Name>x</Name><Type>C</Type></SubItem></DataType>"
        "<DataType><Name>D</Name><BaseType>UINT</BaseType><BitSize>16</BitSize><ArrayInfo>"
        "<LBound>1</LBound><Elements>4000000000</Elements></ArrayInfo></DataType>"
        "<DataType/>"
    )
    for kind in "ABCD":
        found = read(types, variable(kind, 16, "<DefaultValue>1</DefaultValue>")).objects[1]
        assert 1 <= len(found.entries) <= 256


def test_repeated_objects_and_subindices_are_ignored() -> None:
    findings = Findings("a.xml")
    types = record("a", "b").replace("<SubIdx>1", "<SubIdx>0")
    found = read(types, 2 * variable("DT", 32, ""), findings)
    assert [entry.name for entry in found.objects[1].entries] == ["a"]
    assert [warning.message for warning in findings.warnings] == [
        "subindex 0 of 0x0001 occurs again; the first one counts",
        "subindex 0 of 0x0001 occurs again; the first one counts",
        "object 0x0001 occurs again; the first one counts",
    ]


def test_the_number_of_warnings_is_bounded() -> None:
    findings = Findings("a.xml")
    read("", "<Object/>" * 3000, findings)
    assert len(findings.warnings) == 1001


def test_the_number_of_entries_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.esi.objects.ENTRIES_MAX", 1000)
    objects = "".join(
        f"<Object><Index>{n}</Index><Type>DTARR</Type></Object>" for n in range(1, 100)
    )
    types = corpus.TYPES.replace("<Elements>3<", "<Elements>255<")
    findings = Findings("a.xml")
    found = read(types, objects, findings)
    assert sum(len(each.entries) for each in found.objects.values()) <= 1000 + 255
    assert "further objects are ignored" in findings.warnings[-1].message
