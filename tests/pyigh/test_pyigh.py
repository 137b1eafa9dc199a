"""Programs for PyIgH, on a double of libethercat and on our own MainDevice."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, MappingError
from catenary.igh import Master
from catenary.model.device import Direction
from catenary.pyigh import MasterBase, SlaveBase, SlaveIO, SlaveServo
from catenary.pyigh.slaves import RawObject
from tests.igh.double import Double, build

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("pyigh"), "1.6.1")


@pytest.fixture(params=["kernel", "own"])
def master(library: Path, request: pytest.FixtureRequest) -> MasterBase:
    if request.param == "own":
        return MasterBase(cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()]))
    Double(library)
    return MasterBase(Master(library=library, virtual_time=True))


def cycle(master: MasterBase, *servos: SlaveServo, goal: int | None = None) -> bool:
    """Run one cycle as published. Return True if all servos are enabled."""
    master.wait()
    master.ecat_master_receive()
    assert isinstance(master.ecat_domain_process(), bool)
    enabled = [servo.enable() for servo in servos]
    if all(enabled) and goal is not None:
        for servo in servos:
            servo.set_position(goal)
    master.ecat_domain_queue()
    master.ecat_write_apptime(0)
    master.ecat_master_send()
    return all(enabled)


def activated(master: MasterBase, *slaves: SlaveBase) -> None:
    for slave in slaves:
        master.ecat_init_slave(slave)
    master.ecat_activate_domain()
    master.ecat_activate_master()


def test_servos_move(master: MasterBase) -> None:
    servos = [SlaveServo(0), SlaveServo(1)]
    with master:
        activated(master, *servos)
        enabled = [cycle(master, *servos) for _ in range(100)]
        assert enabled[-1]
        home = servos[1].read_position()
        for step in range(300):
            cycle(master, *servos, goal=home + 5 * step)
        assert servos[1].read_position() > home + 1000
        assert servos[0].read_mode() == 8
        status = master.ecat_master_status()
        assert (status.slaves_responding, status.al_states, status.link_up) == (2, 8, True)
        assert master.ecat_slave_config_state(servos[0]) == (True, True, 8)
        assert master.ecat_get_slave_info(1).position == 1


def test_each_function_makes_one_call_of_libethercat(library: Path) -> None:
    double = Double(library)
    servo = SlaveServo(0)
    with MasterBase(Master(library=library, virtual_time=True)) as master:
        activated(master, servo)
        double.forget()
        cycle(master, servo)
        assert double.calls() == [
            *("receive", "process 0", "domain_state 0"),
            *("queue 0", "application_time 0", "send"),
        ]
    assert double.changes()[-2:] == ["deactivate", "release_master"]
    with pytest.raises(RuntimeError, match="no process data"):
        servo.read_position()


def test_torque(library: Path) -> None:
    Double(library)
    servo = SlaveServo(0, mode="cst")
    with MasterBase(Master(library=library, virtual_time=True)) as master:
        activated(master, servo)
        for _ in range(30):
            cycle(master)
            if servo.enable():
                servo.set_torque(-120)
        assert servo.read_torque() == -120
        servo.check()
        with pytest.raises(MappingError, match="0x6081:00 is not exchanged"):
            servo.read(0x6081)


def test_inputs_and_outputs() -> None:
    inputs, outputs = cat.virtual.DigitalInputs(), cat.virtual.DigitalOutputs()
    buttons, lamps = SlaveIO(0), SlaveIO(1)
    with MasterBase(cat.Segment([inputs, outputs])) as master:
        activated(master, buttons, lamps)
        lamps.write_digital(1, 1)
        for _ in range(5):
            cycle(master)
        assert lamps.read(*lamps.objects[1].place) == 1
        assert buttons.read_digital(0) == 0
        with pytest.raises(ValueError, match="analogue channel 0"):
            buttons.read_analog(0)


def test_an_object_that_is_mapped_twice_is_one_channel() -> None:
    gauges = cat.virtual.AnalogInputs(channels=1, second_pdo="twice")
    terminal = SlaveIO(0)
    with MasterBase(cat.Segment([gauges])) as master:
        activated(master, terminal)
        gauges.apply_volts(0, 5.0)
        for _ in range(20):
            cycle(master)
        assert terminal.read_analog(0) == 0x4000
        with pytest.raises(ValueError, match="analogue channel 1"):
            terminal.read_analog(1)


def test_any_object_can_be_exchanged(library: Path) -> None:
    double = Double(library)
    double.set(0, 0x6077, 0, 0xFFFE)
    slave = SlaveBase(0, 0xAA, 0x402, [RawObject(0x6077, 0, 16, Direction.INPUT, signed=True)])
    with MasterBase(Master(library=library, virtual_time=True)) as master:
        activated(master, slave)
        for _ in range(30):
            cycle(master)
        assert slave.read(0x6077) == -2


def test_mistakes_of_a_program_are_errors(library: Path) -> None:
    Double(library)
    with MasterBase(Master(library=library, virtual_time=True)) as master:
        with pytest.raises(ConfigurationError, match="there is no slave 5"):
            master.ecat_init_slave(SlaveServo(5))
        with pytest.raises(ConfigurationError, match="are not the expected"):
            master.ecat_init_slave(SlaveServo(0, vendor=1))
        with pytest.raises(ConfigurationError, match="no slave has been added"):
            master.ecat_activate_domain()
        with pytest.raises(RuntimeError, match="ecat_activate_master"):
            master.ecat_master_send()
        activated(master, SlaveServo(0))
        with pytest.raises(ConfigurationError, match="can no longer be configured"):
            master.ecat_init_slave(SlaveServo(1))


def run(name: str, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_example_is_short_and_runs() -> None:
    assert len((EXAMPLES / "pyigh_loop.py").read_text().splitlines()) <= 40
    out = run("pyigh_loop.py")
    assert out.startswith("3 servos")
    assert "al_states=8" in out
    assert "us per cycle" in out


def test_the_same_program_on_the_kernel_master(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CATENARY_LIBETHERCAT", str(library))
    monkeypatch.setenv("DOUBLE_SLAVES", "2")
    out = run("pyigh_loop.py", "igh:0")
    assert out.startswith("2 servos")
    assert "al_states=8" in out


def test_commands_take_effect_together() -> None:
    assert run("command_queue.py").strip() == "moved by [0.001 0.001 0.001]"
