"""Program that operates all devices of a target, in its own process."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import LoopError
from catenary.operate import OperateProcess
from tests.machine.files import write_small
from tests.share.names import own_name
from tests.share.processes import comes_true


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("operate") as name:
        yield name


def test_it_operates_all_drives_disabled_and_allows_jogs(name: str) -> None:
    notes: list[str] = []
    with OperateProcess("virtual", name, notes.append) as program:
        assert "is starting" in program.problem()
        assert comes_true(lambda: not program.problem())
        with cat.attach(name) as reader:
            assert comes_true(lambda: reader.number > 100)
            assert len(reader.layout.axes) == 3
            assert reader.layout.jog
            assert not reader.read()["enabled"].any()
            with reader.lease() as lease:
                lease.request("enable")
                assert comes_true(lambda: reader.read()["enabled"].all())
                with lease.jog(reader.layout.axes[0], 0.5, distance=0.05) as jog:
                    assert comes_true(lambda: jog.beat() or jog.status.over)
            assert reader.read()["commanded_position"][0] == pytest.approx(0.05)
            program.end()
            assert reader.state == "ended"
    assert len([note for note in notes if "counts per turn" in note]) == 3
    assert "1 rad/s" in notes[0]


def test_an_error_of_the_target_is_raised(name: str) -> None:
    notes: list[str] = []
    with (
        OperateProcess("no-such-nic0", name, notes.append) as program,
        pytest.raises(LoopError, match="the program for no-such-nic0 has ended: ") as caught,
    ):
        program.wait_until_ready()
    assert program.problem() == caught.value.message
    assert "hint:" not in program.problem()
    assert notes == []


def test_a_killed_program_is_reported(name: str) -> None:
    with OperateProcess("virtual", name, str) as program:
        program.wait_until_ready()
        os.kill(program.pid, signal.SIGKILL)
        assert comes_true(lambda: "status -9" in program.problem())


def test_a_machine_file_gives_the_drives_and_limits(name: str, tmp_path: Path) -> None:
    with OperateProcess(str(write_small(tmp_path)), name, str) as program:
        assert comes_true(lambda: "is starting" not in program.problem())
        assert program.problem() == ""
        with cat.attach(name) as reader:
            assert reader.layout.axes[:3] == ("base", "roll", "pitch")
            assert comes_true(lambda: reader.number > 10)
            assert not reader.read()["enabled"].any()
