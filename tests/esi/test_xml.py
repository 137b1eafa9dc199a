"""Parser of ESI files: trees, places in the file, limits."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import EsiError
from catenary.esi.document import LIMITS, Limits, make_document, open_document
from catenary.esi.encoding import encoding_by_name
from catenary.esi.xml import Element, find_elements, read_fragment, root_tag

DEVICE = frozenset({"Devices/Device"})
ALL = frozenset({""})


def tree(data: bytes, limits: Limits = LIMITS) -> Element:
    (found,) = find_elements(make_document(data, "a.xml", limits), ALL, limits=limits)
    return found.element


def test_a_tree_has_tags_texts_attributes_and_lines() -> None:
    root = tree(b'<Info>\n <A b="1">x<B/>y</A>\n <C/>\n</Info>')
    assert [(child.tag, child.line) for child in root.children] == [("A", 2), ("C", 3)]
    assert root.children[0] == Element("A", {"b": "1"}, "xy", (Element("B", {}, "", (), 2),), 2)


def test_namespace_prefixes_are_ignored() -> None:
    root = tree(b'<e:Info xmlns:e="u"><e:A e:b="1" xmlns:f="v"/></e:Info>')
    assert root.tag == "Info"
    assert root.children == (Element("A", {"b": "1"}, "", (), 1),)


def test_only_wanted_elements_and_kept_children_become_trees() -> None:
    data = b"<I><Devices><Device><Type>T</Type><Big><Type/></Big></Device></Devices><Device/></I>"
    document = make_document(data, "a.xml")
    (found,) = find_elements(document, DEVICE, kept=frozenset({"Type"}))
    assert found.path == "Devices/Device"
    assert [child.tag for child in found.element.children] == ["Type"]
    assert found.element.children[0].text == "T"


BODIES = [
    '<Device a="中">é</Device>',
    "<Device/>",
    '<Device a=">/>"/>',
    "<Device></Device >",
    "<Device>/></Device>",
    "<Device><Device/></Device>",
    "<e:Device>a</e:Device>",
]


@pytest.mark.parametrize("codec", ["utf-8", "utf-8-sig", "gb18030", "utf-16", "utf-16-be"])
def test_a_place_gives_the_same_element_again(codec: str) -> None:
    text = "<?xml version='1.0' encoding='gb2312'?>\n<I>\n<Devices>中{}\n</Devices></I>"
    if codec.startswith("utf"):
        text = text.replace("encoding='gb2312'", "")
    data = text.format("\n".join(BODIES)).encode(codec)
    document = make_document(data, "a.xml")
    found = list(find_elements(document, DEVICE))
    assert len(found) == len(BODIES)
    for one, body in zip(found, BODIES, strict=True):
        piece = data[one.offset : one.offset + one.length]
        assert piece.decode(document.encoding.name) == body
        again = read_fragment(piece, document.encoding, file="a.xml", line=one.element.line)
        assert again == one.element
        stored = encoding_by_name(document.encoding.name)
        assert stored is not None
        assert read_fragment(piece, stored, file="a.xml", line=one.element.line) == one.element


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"<I>\n<A>", 2),
        (b"<I>\n</A>", 2),
        (b"", 1),
        (b"no xml", 1),
        (b"<I>&lol;</I>", 1),
        (b'<!DOCTYPE I SYSTEM "x">\n<I/>', 1),
        (b'<!DOCTYPE I [<!ENTITY a "b">]><I>&a;</I>', 1),
        (b"<I/>\n<I/>", 2),
    ],
)
def test_a_fault_names_file_and_line(data: bytes, line: int) -> None:
    with pytest.raises(EsiError, match=rf"^a\.xml:{line}: ") as caught:
        tree(data)
    assert (caught.value.file, caught.value.line) == ("a.xml", line)


SMALL = Limits(
    file_size=1000,
    elements=20,
    tree_elements=10,
    depth=5,
    children=4,
    attributes=2,
    attribute_length=5,
    text_length=10,
)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"<I/>" + b" " * 1000, "the limit is 1000 bytes"),
        (b"<I>" * 6 + b"</I>" * 6, "nested deeper than 5"),
        (b"<I>" + b"<A/>" * 5 + b"</I>", "more than 4 children"),
        (b"<I>" + b"<A><B/><B/></A>" * 4 + b"</I>", "more than 10 elements"),
        (b'<I a="" b="" c=""/>', "more than 2 attributes"),
        (b'<I a="123456"/>', "longer than 5"),
        (b"<I>12345678901</I>", "longer than 10"),
    ],
)
def test_limits_are_enforced(data: bytes, message: str) -> None:
    with pytest.raises(EsiError, match=message):
        tree(data, SMALL)


@pytest.mark.parametrize(
    ("data", "message"),
    [(b"<I>" * 30 + b"</I>" * 30, "nested deeper"), (b"<I>" + b"<A/>" * 30 + b"</I>", "20")],
)
def test_limits_apply_to_ignored_elements(data: bytes, message: str) -> None:
    with pytest.raises(EsiError, match=message):
        list(find_elements(make_document(data, "a.xml"), DEVICE, limits=SMALL))


def test_a_long_comment_is_refused() -> None:
    data = b"<I><!--" + b"x" * 3_000_000 + b"--></I>"
    with pytest.raises(EsiError, match="longer than 1000"):
        tree(data, Limits(token_size=1000))


def test_a_sparse_file_of_1_gb_is_refused_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "big.xml"
    with path.open("wb") as stream:
        stream.truncate(1 << 30)
    with pytest.raises(EsiError, match="1073741824 bytes"):
        open_document(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, tmp_path / "missing", "a\0b"):
        with pytest.raises(EsiError):
            open_document(path)


def test_control_characters_are_replaced() -> None:
    document = make_document(b"<I>\n<A>a\x02b</A></I>\x1a\x00", "a.xml")
    (found,) = find_elements(document, ALL)
    assert found.element.children[0].text == "a b"
    assert str(document.warnings[0]) == "a.xml:2: control character 0x02 replaced by a blank"


def test_blanks_before_the_declaration_are_skipped() -> None:
    document = make_document(b"\n\n <?xml version='1.0'?>\n<I/>", "a.xml")
    (found,) = find_elements(document, ALL)
    assert (found.offset, found.length, found.element.line) == (25, 4, 4)


def test_root_tag() -> None:
    assert root_tag(make_document(b"<!-- a --><e:EtherCATInfo><A>", "a.xml")) == "EtherCATInfo"
    assert root_tag(make_document(b"<!-- a -->", "a.xml")) == ""


@given(st.binary(max_size=200))
def test_any_bytes_raise_nothing_else(data: bytes) -> None:
    for attempt in (data, b"<I>" + data + b"</I>"):
        with suppress(EsiError):
            tree(attempt)
