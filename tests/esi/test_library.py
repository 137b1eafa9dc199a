"""Library: files that change, contradict each other, are missing, or belong to two processes."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from catenary.errors import EsiError, EsiLookupError
from catenary.esi.duplicates import differences
from catenary.esi.folders import default_folder
from catenary.esi.library import Library
from catenary.esi.lookup import Rule
from catenary.esi.reader import read_esi
from catenary.esi.record import Record
from tests.esi import corpus
from tests.esi.esi_file import VENDOR, device, esi, module, write


@pytest.fixture
def library(tmp_path: Path) -> Library:
    return Library(tmp_path / "library")


def found(library: Library, product: int = 1, revision: int | None = 1) -> str:
    """Return the name of a device in the library; "nothing" if it has none."""
    device = library.find(VENDOR, product, revision)
    return device.name if device is not None else "nothing"


def restore_time(path: Path, status: os.stat_result) -> None:
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


# place


def test_the_default_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("CATENARY_ESI", raising=False)
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_folder() == tmp_path / ".local/share/catenary/esi"
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert default_folder() == tmp_path / "data/catenary/esi"
    monkeypatch.setenv("XDG_DATA_HOME", "relative")
    assert default_folder() == tmp_path / ".local/share/catenary/esi"
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "mine"))
    assert default_folder() == tmp_path / "mine"


def test_a_lookup_creates_nothing(library: Library, tmp_path: Path) -> None:
    assert library.find(1, 2, 3) is None
    assert library.search("x") == []
    assert os.listdir(tmp_path) == []


# files


def test_added_files_are_found_by_other_objects(library: Library, tmp_path: Path) -> None:
    path = write(tmp_path / "a.xml", device(1, 5, name="Five"), device(1, 7, name="Seven"))
    added = library.add(path)
    assert (added.path, added.devices, added.modules, len(added.files)) == (str(path), 2, 0, 1)
    other = Library(tmp_path / "library")
    assert found(other, revision=5) == "Five"
    assert found(other, revision=None) == "Seven"
    assert found(other, product=2) == "nothing"


def test_a_folder_is_searched_completely_and_later_files_are_found(
    library: Library, tmp_path: Path
) -> None:
    folder = tmp_path / "esi"
    write(folder / "deep/er/A.XML", device(1, name="A"))
    write(folder / ".hidden/b.xml", device(2, name="B"))
    (folder / "readme.txt").touch()
    assert library.add(folder).devices == 1
    library.close()
    write(folder / "c.xml", device(3, name="C"))
    assert [found(library, each) for each in (1, 2, 3)] == ["A", "nothing", "C"]


def test_files_in_the_library_folder_are_found(library: Library) -> None:
    write(library.path / "copied.xml", device(name="Copied"))
    assert found(library) == "Copied"


def test_an_archive_is_extracted_into_the_library(library: Library, tmp_path: Path) -> None:
    archive = tmp_path / "Vendor files.zip"
    with zipfile.ZipFile(archive, "w") as opened:
        opened.writestr("esi/a.xml", esi(device(name="Zipped")))
    added = library.add(archive)
    archive.unlink()
    assert added.devices == 1
    assert Path(added.path).parent == library.path / "archives"
    assert found(library) == "Zipped"
    assert len(library.sources) == 1
    library.remove(added.path)
    assert found(library) == "nothing"
    assert not Path(added.path).exists()


def test_an_unsafe_archive_changes_nothing(library: Library, tmp_path: Path) -> None:
    archive = tmp_path / "x.zip"
    with zipfile.ZipFile(archive, "w") as opened:
        opened.writestr("../../outside.xml", esi(device()))
    with pytest.raises(EsiError, match="would leave the library folder"):
        library.add(archive)
    assert library.sources == ()
    assert not list(tmp_path.rglob("outside.xml"))


@pytest.mark.parametrize("name", ["missing.xml", "text.txt"])
def test_other_paths_are_refused(library: Library, tmp_path: Path, name: str) -> None:
    (tmp_path / "text.txt").write_text("x")
    with pytest.raises(EsiError, match=r"no such file|neither an XML file"):
        library.add(tmp_path / name)


def test_remove_keeps_the_file(library: Library, tmp_path: Path) -> None:
    path = write(tmp_path / "a.xml", device())
    library.add(path)
    library.remove(path)
    assert found(library) == "nothing"
    assert path.exists()
    with pytest.raises(EsiError, match="does not list this path"):
        library.remove(path)


# changes


def test_a_changed_file_is_indexed_again(library: Library, tmp_path: Path) -> None:
    path = write(tmp_path / "a.xml", device(name="Old"))
    library.add(path)
    library.close()
    write(path, device(2), device(name="A new name"))
    assert found(library) == "A new name"


def test_a_touched_file_is_not_indexed_again(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "a.xml", device())
    library.add(path)
    library.close()
    os.utime(path, ns=(1, 1))
    monkeypatch.setattr("catenary.esi.indexed_files.index_file", None)
    assert len(library.records()) == 1


def test_a_change_with_equal_size_and_time_is_found_by_add_and_check(
    library: Library, tmp_path: Path
) -> None:
    path = write(tmp_path / "a.xml", device(name="Old"))
    status = path.stat()
    library.add(path)
    for name in ("New", "Odd"):
        library.close()
        before = library.search("drive")[0].entry.name
        write(path, device(name=name))
        restore_time(path, status)
        library.close()
        assert library.search("drive")[0].entry.name == before  # the index does not notice it
        library.add(path) if name == "New" else library.check()
        assert library.search("drive")[0].entry.name == name


def test_a_stale_place_is_noticed_when_the_device_is_read(library: Library, tmp_path: Path) -> None:
    path = write(tmp_path / "a.xml", device(1, name="One"), device(2, name="Two"))
    status = path.stat()
    library.add(path)
    record = library.search("drive")[0]
    write(path, device(2, name="Two"), device(1, name="One"))
    restore_time(path, status)
    assert library.read(record).name == "One"
    write(path, device(9), device(8))
    with pytest.raises(EsiError):
        library.read(record)


def test_missing_files_are_reported_and_return(library: Library, tmp_path: Path) -> None:
    path = write(tmp_path / "a.xml", device())
    library.add(path)
    library.close()
    path.rename(tmp_path / "moved")
    assert found(library) == "nothing"
    assert library.problems == (f"{path}: missing; add it again, or remove it from the library",)
    library.close()
    (tmp_path / "moved").rename(path)
    assert found(library) == "Drive"
    assert library.problems == ()


def test_files_that_cannot_be_parsed_are_reported(library: Library, tmp_path: Path) -> None:
    write(tmp_path / "esi/good.xml", device())
    (tmp_path / "esi/bad.xml").write_text(esi(device())[:-40])
    (tmp_path / "esi/pom.xml").write_text("<project/>")
    added = library.add(tmp_path / "esi")
    assert added.devices == 1
    texts = [str(warning) for file in added.files for warning in file.warnings]
    assert "bad.xml:" in texts[0]
    assert "not well-formed XML" in texts[0]
    assert texts[1].endswith("not an ESI file: root project")


def test_an_unreadable_file_is_reported(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`root` can read every file, so the refusal is simulated."""
    write(tmp_path / "esi/a.xml", device())
    library.add(tmp_path / "esi")
    library.close()
    monkeypatch.setattr(
        "catenary.esi.indexed_files.os.access", lambda path, _: not str(path).endswith("a.xml")
    )
    assert library.problems == (f"{tmp_path}/esi/a.xml: Permission denied",)
    assert found(library) == "nothing"


def test_an_unreadable_folder_is_reported(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "esi/closed/a.xml", device(1))
    write(tmp_path / "esi/open/a.xml", device(2))
    scandir = os.scandir

    def refuse(path: str) -> object:
        if str(path).endswith("closed"):
            raise PermissionError(13, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    added = library.add(tmp_path / "esi")
    assert added.devices == 1
    assert added.problems == (f"{tmp_path}/esi/closed: Permission denied",)


def test_a_link_out_of_a_folder_is_not_followed(library: Library, tmp_path: Path) -> None:
    write(tmp_path / "other.xml", device(1))
    write(tmp_path / "esi/a.xml", device(2))
    (tmp_path / "esi/link.xml").symlink_to(tmp_path / "other.xml")
    assert library.add(tmp_path / "esi").devices == 1


# index


@pytest.mark.parametrize("damage", ["text", "truncated", "middle", "version", "empty"])
def test_a_damaged_index_is_made_again(library: Library, tmp_path: Path, damage: str) -> None:
    library.add(write(tmp_path / "a.xml", device()))
    library.close()
    index = library.path / "index.sqlite"
    data = index.read_bytes()
    if damage == "version":
        with sqlite3.connect(index) as connection:
            connection.execute("PRAGMA user_version=99")
            connection.execute("DROP TABLE entries")
    else:
        changed = {"text": b"not a database" * 99, "truncated": data[:5000], "empty": b""}
        half = len(data) // 2
        index.write_bytes(changed.get(damage, data[:half] + b"\xa5" * 5000 + data[half + 5000 :]))
    assert found(library) == "Drive"
    assert len(library.sources) == 1


def test_an_index_that_fails_while_open_is_reported(library: Library, tmp_path: Path) -> None:
    library.add(write(tmp_path / "a.xml", device()))
    library._files()._store.close()  # SQLite then raises an error for every request
    for use in (lambda: library.search("x"), lambda: library.files, library.check):
        with pytest.raises(EsiError, match=r"index\.sqlite: the index cannot be used"):
            use()


def test_a_damaged_list_is_reported_and_kept(library: Library) -> None:
    library.path.mkdir()
    (library.path / "library.json").write_text("{")
    with pytest.raises(EsiError, match=r"library\.json: the list of ESI files is damaged"):
        library.find(1, 2, 3)
    assert (library.path / "library.json").read_text() == "{"


def test_an_index_that_cannot_be_written_is_used_in_memory(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library.add(write(tmp_path / "a.xml", device()))
    library.close()
    write(library.path / "b.xml", device(2, name="B"))
    before = (library.path / "index.sqlite").read_bytes()
    monkeypatch.setattr("catenary.esi.indexed_files.os.access", lambda _, mode: mode == os.R_OK)
    assert (found(library), found(library, 2)) == ("Drive", "B")
    assert (library.path / "index.sqlite").read_bytes() == before


PROGRAM = """
import sys
from catenary.esi.duplicates import differences
from catenary.esi.library import Library
for path in sys.argv[2:]:
    Library(sys.argv[1]).add(path)
    assert Library(sys.argv[1]).records()
"""


def test_two_processes_add_files_at_the_same_time(library: Library, tmp_path: Path) -> None:
    halves = [
        [str(write(tmp_path / f"{half}{n}.xml", device(half * 100 + n))) for n in range(8)]
        for half in (1, 2)
    ]
    running = [
        subprocess.Popen([sys.executable, "-c", PROGRAM, str(library.path), *paths])
        for paths in halves
    ]
    assert [process.wait(60) for process in running] == [0, 0]
    assert len(library.sources) == 16
    assert len(library.records()) == 16


# contradictions


def test_the_same_description_twice_is_reported(library: Library, tmp_path: Path) -> None:
    library.add(write(tmp_path / "b.xml", device()))
    library.add(write(tmp_path / "a.xml", device(2), device()))
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert found.source.file == f"{tmp_path}/a.xml"  # added last
    (warning,) = found.warnings
    assert f"{tmp_path}/b.xml:7 has the same description of 0x00005A5A:0x00000001" in str(warning)
    assert str(warning).startswith(f"{found.source}: ")
    assert len(library._duplicates()) == 1


def test_different_descriptions_of_one_device_are_reported(
    library: Library, tmp_path: Path
) -> None:
    write(tmp_path / "esi/b.xml", device(entry="Torque"))
    write(tmp_path / "esi/a.xml", device(entry="Position"))
    library.add(tmp_path / "esi")
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert found.source.file == f"{tmp_path}/esi/a.xml"  # first in the order of names
    text = str(found.warnings[0])
    assert f"{tmp_path}/esi/b.xml:7 describes" in text
    assert "differently: PDOs" in text
    library.add(tmp_path / "esi/b.xml")
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert found.source.file == f"{tmp_path}/esi/b.xml"


def test_a_duplicate_that_cannot_be_read_is_a_warning(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library.add(write(tmp_path / "b.xml", device()))
    library.add(write(tmp_path / "a.xml", device()))
    (tmp_path / "b.xml").unlink()  # after the library was opened
    monkeypatch.setattr("catenary.esi.indexed_files.IndexedFiles.refresh", lambda *_, **__: None)
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert "b.xml:7 has the same key" in str(found.warnings[0])
    assert "cannot be compared: " in str(found.warnings[0])


# lookup


def test_another_revision_is_noted(library: Library, tmp_path: Path) -> None:
    library.add(write(tmp_path / "a.xml", device(1, 5), device(1, 9)))
    found = library.find(VENDOR, 1, 8)
    assert found is not None
    assert found.key.revision == 5
    assert "revision 0x00000005 is used for a device of revision 0x00000008" in str(
        found.warnings[0]
    )


def test_only_newer_revisions_are_an_error_with_candidates(
    library: Library, tmp_path: Path
) -> None:
    library.add(write(tmp_path / "a.xml", device(1, 5), device(1, 9)))
    with pytest.raises(EsiLookupError) as caught:
        library.find(VENDOR, 1, 4)
    assert "only newer revisions: 0x00000009, 0x00000005" in caught.value.message
    assert len(caught.value.candidates) == 2
    assert f"{tmp_path}/a.xml:" in caught.value.candidates[0]


def test_search_by_order_code_then_by_part_of_the_name(library: Library, tmp_path: Path) -> None:
    library.add(
        write(
            tmp_path / "a.xml",
            device(1, 1, type="EL20"),
            device(1, 2, type="EL20", inner='<HideType ProductCode="#x1" RevisionNo="#x1"/>'),
            device(2, type="EL2004", name="4 outputs"),
        )
    )
    assert [(each.entry.type, each.entry.revision) for each in library.search("el20")] == [
        ("EL20", 2)
    ]
    assert [each.entry.type for each in library.search("EL2")] == ["EL20", "EL2004"]
    assert [each.entry.type for each in library.search("4 OUT")] == ["EL2004"]
    assert library.near("EL2005") == ["EL2004", "EL20"]


# modules and dictionaries


def modular(*idents: int) -> str:
    listed = "".join(f"<ModuleIdent>#x{each:x}</ModuleIdent>" for each in idents)
    return device(inner=f"<Slots><Slot><Name>S</Name>{listed}</Slot></Slots>")


def modules_file(*modules: str) -> str:
    text = "".join(modules)
    return (
        f"<EtherCATModule><Vendor><Id>#x{VENDOR:x}</Id></Vendor>"
        f"<Modules>{text}</Modules></EtherCATModule>"
    )


def test_modules_come_from_the_file_its_references_and_the_vendor(
    library: Library, tmp_path: Path
) -> None:
    folder = tmp_path / "esi"
    write(
        folder / "device.xml",
        modular(1, 2, 3, 4),
        modules=module(1, "own"),
        reference="<InfoReference>Sub\\MODULES.xml</InfoReference>"
        "<InfoReference>..\\outside.xml</InfoReference>",
    )
    (tmp_path / "outside.xml").write_text(modules_file(module(4)))
    (folder / "sub").mkdir()
    (folder / "sub/Modules.xml").write_text(modules_file(module(1, "other"), module(2, "two")))
    (folder / "vendor.xml").write_text(modules_file(module(3, "three")))
    library.add(folder)
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert [(each.ident, each.type) for each in found.modules] == [
        (1, "own"),
        (2, "two"),
        (3, "three"),
    ]
    texts = [str(each) for each in found.warnings]
    assert any("'../outside.xml' was not found in" in each for each in texts)
    assert any("module 0x00000004 of a slot was not found" in each for each in texts)


def test_references_in_a_circle_end(library: Library, tmp_path: Path) -> None:
    write(tmp_path / "esi/a.xml", modular(2), reference="<InfoReference>b.xml</InfoReference>")
    write(
        tmp_path / "esi/b.xml",
        modules=module(2),
        reference="<InfoReference>a.xml</InfoReference>",
    )
    library.add(tmp_path / "esi/a.xml")
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert [each.ident for each in found.modules] == [2]


DICTIONARY = """<EtherCATDict><Dictionary><DataTypes/><Objects>
<Object><Index>#x2000</Index><Name>Gain</Name><Type>UINT</Type><BitSize>16</BitSize></Object>
</Objects></Dictionary></EtherCATDict>"""


def test_a_dictionary_comes_from_its_file(library: Library, tmp_path: Path) -> None:
    profile = "<Profile><DictionaryFile>DICT\\Drive.XML</DictionaryFile></Profile>"
    path = write(tmp_path / "a.xml", device(inner=profile))
    (tmp_path / "dict").mkdir()
    (tmp_path / "dict/drive.xml").write_text(DICTIONARY)
    library.add(path)
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert found.dictionary is not None
    assert found.dictionary.objects[0x2000].name == "Gain"


def test_a_missing_dictionary_is_a_warning(library: Library, tmp_path: Path) -> None:
    profile = "<Profile><DictionaryFile>none.xml</DictionaryFile></Profile>"
    library.add(write(tmp_path / "a.xml", device(inner=profile)))
    found = library.find(VENDOR, 1, 1)
    assert found is not None
    assert found.dictionary is None
    assert any("'none.xml' was not found" in str(each) for each in found.warnings)


# temporary libraries


def test_a_library_of_a_folder_or_file_writes_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "esi/a.xml", device())
    write(tmp_path / "esi/b.xml", device(2))
    with Library.of(tmp_path / "esi") as library:
        assert found(library, 2) == "Drive"
    with Library.of(path) as library:
        assert (found(library), found(library, 2)) == ("Drive", "nothing")
    assert sorted(os.listdir(tmp_path / "esi")) == ["a.xml", "b.xml"]


def test_a_temporary_library_cannot_be_changed(tmp_path: Path) -> None:
    path = write(tmp_path / "esi/a.xml", device())
    with Library.of(tmp_path / "esi") as library:
        for change in (library.add, library.remove):
            with pytest.raises(ValueError, match="cannot be changed"):
                change(path)
    assert os.listdir(tmp_path / "esi") == ["a.xml"]


@pytest.mark.parametrize("limit", ["MAX_FILES", "MAX_FOLDERS"])
def test_a_folder_that_is_too_large_is_refused(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    monkeypatch.setattr(f"catenary.esi.sources.{limit}", 2)
    for name in "abc":
        write(tmp_path / "esi" / name / "a.xml", device())
    with pytest.raises(EsiError, match="more than 2"):
        library.add(tmp_path / "esi")
    assert library.sources == ()
    assert "more than 2" in Library.of(tmp_path / "esi").problems[0]


def test_a_folder_that_is_nested_too_deeply_is_reported(library: Library, tmp_path: Path) -> None:
    write(tmp_path / "esi" / "/".join("abcdefghijklmnopqrst") / "a.xml", device())
    (problem,) = library.add(tmp_path / "esi").problems
    assert "folders below level 16 are not searched" in problem


def test_the_index_of_a_large_folder_is_cached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("catenary.esi.folders.SMALL", 100)
    write(tmp_path / "esi/a.xml", device())
    assert found(Library.of(tmp_path / "esi")) == "Drive"
    monkeypatch.setattr("catenary.esi.indexed_files.index_file", None)
    assert found(Library.of(tmp_path / "esi")) == "Drive"
    assert len(list((tmp_path / "cache/catenary/esi").glob("*.sqlite"))) == 1


def test_a_missing_path_and_an_archive_are_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as opened:
        opened.writestr("a.xml", esi(device()))
    with pytest.raises(EsiError, match="no such file or folder"):
        Library.of(tmp_path / "missing")
    with pytest.raises(EsiError, match="cannot be read in place"):
        Library.of(tmp_path / "a.zip")


def test_the_shared_files(shared_data: Path) -> None:
    with Library.of(shared_data / "esi") as library:
        assert len(library.files) == 10
        assert len(library.records()) == 11
        assert library.problems == ()
        for record in library.records():
            choice = library.choose(*record.key)
            assert choice is not None
            assert choice.rule is Rule.EXACT
            assert library.find(*record.key) is not None
        assert len(library._duplicates()) == 1  # two versions of pollen's Orbita2d
        assert json.dumps([str(each) for each in library._duplicates()])


@pytest.mark.parametrize("name", [*corpus.FILES, *corpus.FAULTY_FILES])
def test_a_device_from_its_place_is_that_of_the_whole_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.xml"
    path.write_bytes({**corpus.FILES, **corpus.FAULTY_FILES}[name])
    with Library.of(path) as library:
        records = library.records()
        try:
            whole = read_esi(path)
        except EsiError:
            assert not any(readable(library, record) for record in records)
            return
        assert [each.key for each in records] == [each.key for each in whole.devices]
        for record, device in zip(records, whole.devices, strict=True):
            found = library.read(record)
            assert differences(found, device) == []
            assert found.source == device.source == record.source
            assert set(device.warnings) <= set(found.warnings)


def readable(library: Library, record: Record) -> bool:
    try:
        return bool(library.read(record))
    except EsiError:
        return False
