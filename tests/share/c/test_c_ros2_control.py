"""The part of examples/ros2_control that does not use ROS, on a loop in virtual time."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import pytest

from catenary.errors import LeaseError
from catenary.share import Reason
from tests.share.c.compile import C11, HERE, INCLUDE, SANITIZERS, build, has_sanitizers
from tests.share.processes import Program, comes_true
from tests.share.test_lease import Cell, cell_of

EXAMPLE = HERE.parents[2] / "examples" / "ros2_control"
CPP = ("c++", "-std=c++17")


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    options = SANITIZERS if has_sanitizers(folder) else ()
    library = build(folder / "share.o", C11, *options, "-c", INCLUDE / "catenary_share.c")
    sources = HERE / "arm_driver.cpp", EXAMPLE / "src" / "arm_share.cpp", library
    return build(folder / "driver", CPP, *options, f"-I{EXAMPLE / 'src'}", *sources)


class Arm:
    """A process with an ArmShare, and one step at a time."""

    def __init__(self, program: Program) -> None:
        self._program = program

    def step(self, line: str) -> str:
        stream = self._program.process.stdin
        assert stream is not None
        stream.write(line + "\n")
        stream.flush()
        return self._program.line()

    def read(self) -> list[float]:
        return [float(word) for word in self.step("read").split()]


@contextmanager
def arm_of(
    driver: Path, name: str, axes: tuple[str, ...], quantity: str = "position", lease: float = 600.0
) -> Iterator[Arm]:
    program = Program.of([str(driver), name, quantity, str(lease), *axes])
    try:
        yield Arm(program)
    finally:
        program.kill()
        program.close()


@pytest.fixture
def cell(name: str) -> Iterator[Cell]:
    with cell_of(name) as cell:
        yield cell


def test_axes_follow_the_written_commands(cell: Cell, name: str, driver: Path) -> None:
    with arm_of(driver, name, (cell.names[2], cell.names[0])) as arm:
        assert arm.step("open") == arm.step("activate") == ""
        assert arm.step("command 0.02 0.01") == arm.step("write") == ""
        cell.cycles(200)
        expected = cell.reader.read()
        number, *values = arm.read()
        assert number == expected["number"]
        for field, found in zip(
            ("position", "velocity", "torque"),
            (values[0:2], values[2:4], values[4:6]),
            strict=True,
        ):
            assert found == pytest.approx([expected[field][2], expected[field][0]])
        assert values[:2] == pytest.approx([0.02, 0.01], abs=1e-4)
        assert arm.step("deactivate") == ""
        [end] = cell.cycles()
        assert end.reason == Reason.RELEASED


def test_effort_is_sent_as_torque(cell: Cell, name: str, driver: Path) -> None:
    with arm_of(driver, name, cell.names, "effort") as arm:
        arm.step("open")
        arm.step("activate")
        arm.step("command 1 2 3")
        assert arm.step("write") == ""
        [command] = cell.share.commands()
        assert command.position is command.velocity is None
        assert command.torque == pytest.approx([1.0, 2.0, 3.0])


def test_without_a_command_the_lease_is_only_renewed(cell: Cell, name: str, driver: Path) -> None:
    desk = cell.share._desk
    assert desk is not None
    with arm_of(driver, name, cell.names) as arm:
        arm.step("open")
        arm.step("activate")
        before = max(desk.deadlines_ns.load_all())
        assert arm.step("write") == ""
        assert max(desk.deadlines_ns.load_all()) > before
        assert cell.share.commands() == []


def test_activation_fails_while_another_client_has_an_axis(
    cell: Cell, name: str, driver: Path
) -> None:
    with arm_of(driver, name, cell.names) as arm:
        arm.step("open")
        with cell.reader.lease(axes=[1]):
            assert f"error: axis '{cell.names[1]}' is leased to process" in arm.step("activate")
        assert arm.step("activate") == ""
        with pytest.raises(LeaseError, match=r"leased to process \d+ \(driver\)"):
            cell.reader.lease(axes=[1])


def test_write_fails_after_the_lease_has_expired(cell: Cell, name: str, driver: Path) -> None:
    with arm_of(driver, name, cell.names, lease=1e-6) as arm:
        arm.step("open")
        arm.step("activate")
        assert comes_true(lambda: bool(cell.cycles()))
        arm.step("command 0.1 0.1 0.1")
        assert "has ended: not renewed in time" in arm.step("write")


def test_read_fails_after_the_end_of_the_loop(name: str, driver: Path) -> None:
    with cell_of(name) as cell, arm_of(driver, name, cell.names) as arm:
        arm.step("open")
        arm.step("activate")
        cell.cycles(10)
        assert arm.read()[0] == cell.reader.number
        cell.loop.close()
        while not (line := arm.step("read")).startswith("error"):
            pass  # the last cycles
        ended = f"error: the loop of the share '{name}' has ended"
        assert line == arm.step("write") == ended
        assert arm.step("open") == ""  # to read its last cycle
        assert arm.step("activate") == ended


def test_missing_axis_and_missing_share_are_reported(cell: Cell, name: str, driver: Path) -> None:
    with arm_of(driver, name, ("elbow",)) as arm:
        assert arm.step("open") == f"error: the share '{name}' has no axis 'elbow'"
        assert arm.step("activate") == f"error: the share '{name}' is not open"
    with arm_of(driver, f"{name}-2", ("elbow",)) as arm:
        assert "there is no share" in arm.step("open")


def test_part_without_ros_builds_with_cmake(tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("no cmake")
    options = "-DWITH_ROS=OFF", f"-DCATENARY_INCLUDE={INCLUDE}"
    subprocess.run(["cmake", "-S", EXAMPLE, "-B", tmp_path, *options], check=True)
    subprocess.run(["cmake", "--build", tmp_path], check=True)
    assert (tmp_path / "libarm_share.a").is_file()


def test_plugin_names_agree() -> None:
    library = ElementTree.parse(EXAMPLE / "catenary_ros2_control.xml").getroot()
    [plugin] = library.findall("class")
    package = ElementTree.parse(EXAMPLE / "package.xml").getroot().findtext("name")
    robot = ElementTree.parse(EXAMPLE / "arm.ros2_control.xacro").getroot()
    build_file = (EXAMPLE / "CMakeLists.txt").read_text()
    source = (EXAMPLE / "src" / "catenary_system.cpp").read_text()
    assert library.get("path") == package
    assert f"project({package} " in build_file
    assert robot.findtext(".//plugin") == plugin.get("name")
    assert (
        f"PLUGINLIB_EXPORT_CLASS({plugin.get('type')}, {plugin.get('base_class_type')})" in source
    )
