"""Cycles that C reads equal those that Python reads."""

from __future__ import annotations

import ctypes
import os
import subprocess
from pathlib import Path

import pytest

import catenary as cat
from tests.share.c.library import (
    ARGUMENT,
    EMPTY,
    ENDED,
    OVERWRITTEN,
    RUNNING,
    STALE,
    STATE_DEAD,
    STATE_ENDED,
    CError,
    Library,
)
from tests.share.processes import LOOP, Program, started
from tests.share.test_hammer import LAYOUT
from tests.share.test_lease import Cell, cell_of


@pytest.fixture
def cell(name: str):  # type: ignore[no-untyped-def]
    with cell_of(name) as cell:
        yield cell


def test_description_is_that_of_python(cell: Cell, name: str, library: Library) -> None:
    layout = cell.reader.layout
    with library.attach(name) as share:
        handle = share.handle
        assert library.period(handle) == layout.period
        assert library.utc_offset_ns(handle) == layout.utc_offset_ns
        assert library.is_virtual(handle) == 1
        assert library.writer_pid(handle) == os.getpid()
        assert library.row_size(handle) == layout.rows.size
        names = [library.axis_name(handle, k).decode() for k in range(library.axis_count(handle))]
        assert tuple(names) == layout.axes
        assert library.find_axis(handle, names[2].encode()) == 2
        assert library.find_axis(handle, b"elbow") == -1
        assert library.axis_name(handle, 3) is None
        assert library.field_count(handle) == len(layout.fields)
        assert not library.field_at(handle, len(layout.fields))
        assert not library.find_field(handle, b"no such field")
        for k, field in enumerate(layout.fields):
            found = library.field_at(handle, k).contents
            assert found.name.decode() == field.name
            assert found.unit.decode() == field.unit
            assert found.offset == field.offset
            assert found.per_axis == field.per_axis
            kind = cell.reader.dtype[field.name].base
            assert (found.kind.decode(), found.size) == (kind.kind, kind.itemsize)


def test_modes_and_presets_do_not_disturb_a_reader_in_c(name: str, library: Library) -> None:
    with cat.Share(name, modes={"stand": 'a \\ "b"'}, presets=("wave",)) as share:
        share.open(LAYOUT)
        share.append(bytes(share.layout.rows.size - 8))
        with library.attach(name) as found:
            assert library.field_count(found.handle) == len(share.layout.fields)
        share.close()


def test_newest_cycle_equals_that_of_python(cell: Cell, name: str, library: Library) -> None:
    with cell.reader.lease(for_=600.0) as command, library.attach(name) as share:
        command.send(position=[0.01, 0.02, 0.03])
        cell.cycles(200)
        expected = cell.reader.read()
        assert share.read() == expected["number"]
        for field in cell.reader.layout.fields:
            assert share.values(field.name) == pytest.approx(
                expected[field.name].reshape(-1).tolist(), nan_ok=True
            )
        assert share.values("position") == pytest.approx([0.01, 0.02, 0.03], abs=1e-4)


def test_stored_cycles_can_be_read_by_number(cell: Cell, name: str, library: Library) -> None:
    cell.cycles(50)
    with library.attach(name) as share:
        share.read_cycle(20)
        assert share.values("number") == [20.0]
        for missing in (0, cell.reader.number + 1, 2**64 - 1):
            with pytest.raises(CError, match="does not store cycle") as caught:
                share.read_cycle(missing)
            assert caught.value.code == OVERWRITTEN
        assert share.values("number") == [20.0]


def test_row_that_is_too_small_is_refused(cell: Cell, name: str, library: Library) -> None:
    with library.attach(name) as share:
        for row, size in ((share.row, len(share.row) - 1), (None, 1 << 20)):
            with pytest.raises(CError, match="the row needs") as caught:
                library.checked("read", share.handle, row, size, None)
            assert caught.value.code == ARGUMENT


def test_share_without_a_cycle_is_empty(name: str, library: Library) -> None:
    with cat.Share(name) as share:
        share.open(LAYOUT)
        with library.attach(name) as reader:
            assert library.newest(reader.handle) == 0
            with pytest.raises(CError, match="has no cycle yet") as caught:
                reader.read()
            assert caught.value.code == EMPTY
        share.close()


def test_wait_reports_new_cycles_the_timeout_and_the_end(name: str, library: Library) -> None:
    with cell_of(name) as cell:
        share = library.attach(name)
        assert library.checked("wait", share.handle, 0, 60.0) == 1
        newest = library.newest(share.handle)
        assert library.checked("wait", share.handle, newest, 0.0) == 0
        cell.cycles()
        assert library.checked("wait", share.handle, newest, 60.0) == 1
        assert library.state(share.handle) == RUNNING
    with share:
        assert library.state(share.handle) == STATE_ENDED
        assert library.checked("wait", share.handle, newest, -1.0) == 1  # the last cycle
        with pytest.raises(CError, match="has ended") as caught:
            library.checked("wait", share.handle, library.newest(share.handle), -1.0)
        assert caught.value.code == ENDED


def test_program_follows_a_loop_until_its_end(name: str, program: Path) -> None:
    with cell_of(name) as cell:
        client = Program.of([str(program), "follow", name])
        assert client.line() == "0"
        cell.cycles(100)
    assert client.line() == f"{ENDED} {STATE_ENDED} the loop of the share '{name}' has ended"
    client.kill()
    client.close()


def test_killed_loop_is_dead(name: str, program: Path, library: Library) -> None:
    with started(LOOP, name) as loop:
        assert loop.line() == "running"
        client = Program.of([str(program), "follow", name])
        assert client.line() == "0"
        loop.kill()
        dead = client.line()
        client.kill()
        client.close()
    assert dead.startswith(f"-7 {STATE_DEAD} the loop's process has died: process ")
    with pytest.raises(CError, match="is stale: process"):
        library.attach(name)
    with library.attach(name, STALE) as share:
        assert library.state(share.handle) == STATE_DEAD
        assert share.read() >= 100
        with pytest.raises(CError, match="has died"):
            share.lease([0])


def test_library_reads_while_the_locale_has_a_decimal_comma(name: str, library: Library) -> None:
    locales = subprocess.run(["locale", "-a"], capture_output=True, text=True).stdout.split()
    comma = next((each for each in locales if each.startswith(("de_", "fr_", "cs_"))), None)
    if comma is None:
        pytest.skip("no locale with a decimal comma")
    setlocale = ctypes.CDLL(None).setlocale
    with cell_of(name):
        assert setlocale(1, comma.encode())
        try:
            with library.attach(name) as share:
                assert library.period(share.handle) == 1e-3
        finally:
            setlocale(1, b"C")
