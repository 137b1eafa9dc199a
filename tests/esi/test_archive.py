"""Extraction of archives, and what is refused."""

from __future__ import annotations

import os
import stat
import zipfile
from pathlib import Path

import pytest

from catenary.errors import EsiError
from catenary.esi.archive import Bounds, extract

XML = b"<EtherCATInfo/>"


def archive(tmp_path: Path, *members: str | zipfile.ZipInfo, data: bytes = XML) -> Path:
    path = tmp_path / "esi.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as opened:
        for each in members:
            opened.writestr(each, data, zipfile.ZIP_DEFLATED)
    return path


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_only_xml_files_are_extracted(tmp_path: Path) -> None:
    path = archive(tmp_path, "a.xml", "Sub\\b.XML", "manual.pdf", "dir/")
    into = tmp_path / "library"
    into.mkdir()
    assert extract(path, into / "x") == [into / "x" / "a.xml", into / "x" / "Sub" / "b.XML"]
    assert files(into) == ["x/Sub/b.XML", "x/a.xml"]
    extract(path, into / "x")  # again: it is replaced
    assert files(into) == ["x/Sub/b.XML", "x/a.xml"]


def link() -> zipfile.ZipInfo:
    member = zipfile.ZipInfo("link.xml")
    member.external_attr = (stat.S_IFLNK | 0o777) << 16
    return member


@pytest.mark.parametrize(
    ("members", "message"),
    [
        (("../a.xml",), "would leave the library folder"),
        (("x/../../a.xml",), "would leave the library folder"),
        (("..\\a.xml",), "would leave the library folder"),
        (("/a.xml",), "would leave the library folder"),
        (("C:\\a.xml",), "would leave the library folder"),
        (("\\\\server\\a.xml",), "would leave the library folder"),
        (("good.xml", "../picture.bmp"), "would leave the library folder"),
        ((link(),), "is a symbolic link"),
        (("a.xml", "A.XML"), "has two members with the name 'A.XML'"),
        (("a.xml", "./a.xml"), "has two members with the name './a.xml'"),
        (("readme.txt",), "the archive has no XML file"),
        (("a" * 300 + ".xml",), "not a valid ZIP archive"),
        (("a.xml", "a.xml/b.xml"), "not a valid ZIP archive"),
        (("1.xml", "2.xml", "3.xml", "4.xml"), "has 4 members; the limit is 3"),
    ],
)
def test_unsafe_archives_are_refused(
    tmp_path: Path, members: tuple[str | zipfile.ZipInfo, ...], message: str
) -> None:
    path = archive(tmp_path, *members)
    into = tmp_path / "library"
    into.mkdir()
    with pytest.raises(EsiError) as caught:
        extract(path, into / "x", Bounds(members=3))
    assert message in str(caught.value)
    assert caught.value.hint
    assert files(tmp_path) == ["esi.zip"]
    assert os.listdir(into) == []


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (Bounds(small=1000), r"is compressed 8\d*:1"),
        (Bounds(member_size=99_999), "has 100000 bytes; the limit is 99999"),
        (Bounds(total_size=199_999), "larger than 199999 bytes when extracted"),
    ],
)
def test_bombs_are_refused(tmp_path: Path, bounds: Bounds, message: str) -> None:
    path = archive(tmp_path, "a.xml", "b.xml", data=bytes(100_000))
    with pytest.raises(EsiError, match=message):
        extract(path, tmp_path / "x", bounds)
    assert files(tmp_path) == ["esi.zip"]


def test_a_member_cannot_be_larger_than_it_states(tmp_path: Path) -> None:
    path = archive(tmp_path, "a.xml", data=bytes(100_000))
    raw = path.read_bytes().replace((100_000).to_bytes(4, "little"), (10).to_bytes(4, "little"))
    path.write_bytes(raw)
    with pytest.raises(EsiError, match="not a valid ZIP archive"):
        extract(path, tmp_path / "x")
    assert files(tmp_path) == ["esi.zip"]


@pytest.mark.parametrize("cut", [30, 100, 150])
def test_a_damaged_archive_is_reported(tmp_path: Path, cut: int) -> None:
    path = archive(tmp_path, "a.xml", data=os.urandom(100))
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(EsiError, match="not a valid ZIP archive"):
        extract(path, tmp_path / "x")


def test_an_encrypted_member_is_refused(tmp_path: Path) -> None:
    path = archive(tmp_path, "a.xml")
    raw = bytearray(path.read_bytes())
    raw[6] |= 1
    raw[raw.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(raw)
    with pytest.raises(EsiError, match="is encrypted"):
        extract(path, tmp_path / "x")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_damaged_data_of_other_methods_are_reported(tmp_path: Path, method: int) -> None:
    path = tmp_path / "esi.zip"
    with zipfile.ZipFile(path, "w", method) as made:
        made.writestr("a.xml", os.urandom(1000))
    raw = bytearray(path.read_bytes())
    for at in range(45, 500):  # after the name
        raw[at] ^= 0xFF
    path.write_bytes(raw)
    with pytest.raises(EsiError, match="not a valid ZIP archive"):
        extract(path, tmp_path / "x")
    assert files(tmp_path) == ["esi.zip"]
