"""Program 8: a test of a machine on the twin of its line, in virtual time."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, IdentityError
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo

FILE = """\
format = "catenary-machine/1"
target = "eth0"

[loop]
period = "1 ms"

[[device]]
name = "coupler"
position = 0
identity = { vendor = 0x43544E59, product = 0x10001 }

[[device]]
name = "j1"
position = 1
identity = { vendor = 0x43544E59, product = 0x50001, serial = 1 }

[[device]]
name = "j2"
position = 2
identity = { vendor = 0x43544E59, product = 0x50001, serial = 2 }

[[device]]
name = "valves"
position = 3
identity = { vendor = 0x43544E59, product = 0x20008 }

[drives.arm]
axes = ["j1"]
counts_per_turn = 1048576
velocity_limit = 1.0

[drives.gripper]
axes = ["j2"]
counts_per_turn = 1048576
velocity_limit = 1.0

[process_data.valves]
device = "valves"
"""


def real_line() -> Segment:
    """Return the line that is cloned. The gripper is open: at 0.4 rad."""
    line = Segment([Coupler(), Servo(serial=1), Servo(serial=2), DigitalOutputs(bits=8)])
    gripper = line[2]
    assert isinstance(gripper, Servo)
    gripper.move_to(0.4)
    return line


@pytest.fixture(scope="module")
def cloned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a clone."""
    folder = tmp_path_factory.mktemp("clone") / "line"
    cat.clone(real_line(), folder, pre_op=True)
    return folder


@pytest.fixture
def folder(cloned: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with machine.toml and the clone line/."""
    shutil.copytree(cloned, tmp_path / "line")
    (tmp_path / "machine.toml").write_text(FILE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def machine(folder: Path) -> Iterator[cat.Machine]:
    with cat.Machine("machine.toml", target="virtual:line/") as machine:
        yield machine


def test_gripper_closes(machine: cat.Machine) -> None:
    jaw = machine.drives["gripper"]
    with machine.loop() as loop:
        assert jaw.actual.position[0] == pytest.approx(0.4, abs=1e-3)  # as in the clone
        loop.wait(jaw.move_to(0.0), timeout=2.0)
        assert jaw.actual.position[0] == pytest.approx(0.0, abs=1e-4)


def test_lost_drive_is_reported(machine: cat.Machine) -> None:
    with pytest.raises(cat.WorkingCounterError, match="j2"), machine.loop() as loop:  # noqa: PT012
        machine.segment["j2"].power_off()
        loop.run_for(0.1)


def lose_gripper(machine: cat.Machine) -> None:
    with machine.loop() as loop:
        machine.segment["j2"].power_off()
        loop.run_for(0.1)


def test_a_drive_with_power_returns(machine: cat.Machine) -> None:
    with pytest.raises(cat.WorkingCounterError, match="j2"):
        lose_gripper(machine)
    assert machine.segment["j2"].state == 0
    machine.segment["j2"].power_on()
    assert machine.segment["j2"].state == 1
    machine.main.scan()
    with machine.loop() as loop:
        loop.run_for(0.05)
        assert machine.segment["j2"].state == 8


def test_names_of_the_clone_and_of_the_file_find_devices(machine: cat.Machine) -> None:
    segment = machine.segment
    assert segment["j1"] is segment[1]
    assert segment["coupler"] is segment["Catenary virtual coupler"]
    with pytest.raises(KeyError, match="devices 1, 2 are named 'Catenary virtual servo'"):
        segment["Catenary virtual servo"]
    with pytest.raises(KeyError, match="no device is named 'j3'; the names are 'coupler', 'j1'"):
        segment["j3"]


def test_a_name_keeps_its_place_after_an_exchange(machine: cat.Machine) -> None:
    spare = Servo(serial=9)
    machine.segment.inject(cat.virtual.faults.Swap(device=2, with_=spare, for_=0.01))
    with pytest.raises(cat.CatenaryError), machine.loop() as loop:
        loop.run_for(0.1)
    assert machine.segment["j2"] is spare


def test_events_name_devices_as_the_file(machine: cat.Machine) -> None:
    assert str(machine.subs["j2"].station) == "device 2 (j2, Catenary virtual servo)"


def test_another_identity_is_refused(folder: Path) -> None:
    (folder / "machine.toml").write_text(FILE.replace("serial = 2", "serial = 3"))
    with (
        pytest.raises(IdentityError, match="j2"),
        cat.Machine("machine.toml", target="virtual:line/"),
    ):
        pass


def test_a_folder_without_a_clone_is_refused(folder: Path) -> None:
    (folder / "line" / "line.toml").unlink()
    with pytest.raises(ConfigurationError, match="not a finished clone"):
        cat.Machine("machine.toml", target="virtual:line/")


def test_a_missing_folder_is_refused(folder: Path) -> None:
    with pytest.raises(ConfigurationError, match="lime/: No such file"):
        cat.Machine("machine.toml", target="virtual:lime/")


def test_the_machine_file_may_name_the_clone(folder: Path) -> None:
    (folder / "machine.toml").write_text(FILE.replace('"eth0"', '"virtual:line/"'))
    with cat.Machine("machine.toml") as machine:
        assert len(machine.segment) == 4


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_run_for_needs_a_positive_time(machine: cat.Machine, seconds: float) -> None:
    with machine.loop() as loop, pytest.raises(ValueError, match="must be positive and finite"):
        loop.run_for(seconds)


def test_run_for_lasts_as_long_as_requested(machine: cat.Machine) -> None:
    with machine.loop() as loop:
        before = machine.segment.time
        loop.run_for(0.25)
        assert machine.segment.time - before == pytest.approx(0.25, abs=3e-3)
