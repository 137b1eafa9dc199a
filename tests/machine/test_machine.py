"""Machine: the objects of a machine file, and the checks before a device changes."""

from __future__ import annotations

import inspect
import math
from pathlib import Path

import pytest

from catenary.errors import (
    ConfigurationError,
    IdentityError,
    MachineFileError,
    SegmentError,
)
from catenary.loop import Loop, Scheduling, StopPolicy
from catenary.machine import Machine
from catenary.types import INT, USINT
from catenary.virtual import Coupler, DigitalOutputs, Segment
from tests.esi import servo_file
from tests.machine.files import SMALL, small_segment, write_small

AL_STATUS = 0x0130
INIT = 1


def states(segment: Segment) -> set[int]:
    """Return the states that the devices of a segment are in."""
    return {device.core.peek(device.position, AL_STATUS, 1)[0] & 0xF for device in segment}


def test_drives_process_data_and_devices_have_the_names_of_the_file(tmp_path: Path) -> None:
    with Machine(write_small(tmp_path)) as machine:
        assert machine.drives["arm"].names == ("base", "roll", "pitch")
        assert [sub.position for sub in machine.drives["arm"].subs] == [3, 4, 4]
        assert machine.drives["gripper"].names == ("hand",)
        assert list(machine.process_data) == ["valves", "gauge"]
        assert list(machine.subs) == ["coupler", "valves", "gauge", "j1", "wrist", "hand"]
        assert machine.subs["wrist"].alias == 12


def test_open_returns_the_machine(tmp_path: Path) -> None:
    machine = Machine(write_small(tmp_path)).open()
    try:
        assert list(machine.drives) == ["arm", "gripper"]
    finally:
        machine.close()


def test_a_loop_runs_with_the_options_of_the_file(tmp_path: Path) -> None:
    with Machine(write_small(tmp_path)) as machine:
        arm = machine.drives["arm"]
        with machine.loop() as loop:
            start = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = start + 0.1 * math.sin(cycle.time)
                if cycle.time > 0.5:
                    break
            assert start == pytest.approx([0, math.pi / 2, 0], abs=1e-3)
            assert arm.actual.position - start == pytest.approx(0.1 * math.sin(0.5), abs=5e-3)
            assert loop.plan.cycle.period_ns == 1_000_000


def test_outputs_and_inputs_have_names_and_units(tmp_path: Path) -> None:
    segment = small_segment()
    with Machine(write_small(tmp_path), target=segment) as machine:
        valves, gauge = machine.process_data["valves"], machine.process_data["gauge"]
        segment[2].apply_volts(0, 5.0)
        with machine.loop() as loop:
            for cycle in loop:
                valves["clamp"] = True
                if cycle.number == 20:
                    break
            assert segment[1].outputs == 0b01
            assert gauge["force"] == pytest.approx(16.383, abs=0.01)
        assert segment[1].outputs == 0


def test_start_up_objects_are_written(tmp_path: Path) -> None:
    with Machine(write_small(tmp_path)) as machine:
        assert "0x8000:01" in str(machine.main.plan(*machine.requests))
        with machine.loop():
            pass
        assert machine.subs["gauge"].sdo.read(0x8000, 1, type=USINT) == 3
        assert machine.subs["wrist"].sdo.read(0x605A, 0, type=INT) == 6


def test_options_of_a_loop_override_those_of_the_file(tmp_path: Path) -> None:
    with (
        Machine(write_small(tmp_path)) as machine,
        machine.loop(
            period=2e-3,
            log=10,
            stop=StopPolicy(lost_limit=9),
            scheduling=Scheduling(receive="poll"),
        ) as loop,
    ):
        assert loop.plan.cycle.period_ns == 2_000_000
        for cycle in loop:
            if cycle.number == 30:
                break
        assert len(loop.log) == 10


def test_a_target_overrides_that_of_the_file(tmp_path: Path) -> None:
    segment = small_segment()
    path = write_small(tmp_path, SMALL.replace("virtual:line.toml", "eth0"))
    with Machine(path, target=segment) as machine:
        assert machine.segment is segment


def test_a_target_of_the_file_counts_from_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_small(tmp_path)
    monkeypatch.chdir("/")
    with Machine(path) as machine:
        assert len(machine.segment) == 6


def test_the_suffix_of_a_machine_file_does_not_matter(tmp_path: Path) -> None:
    path = write_small(tmp_path).rename(tmp_path / "cell.machine")
    with Machine(path) as machine:
        assert len(machine.segment) == 6


def test_a_file_without_a_target_needs_one(tmp_path: Path) -> None:
    path = write_small(tmp_path, SMALL.replace('target = "virtual:line.toml"\n', ""))
    with pytest.raises(MachineFileError, match='key "target" is missing'):
        Machine(path)
    with Machine(path, target=small_segment()) as machine:
        assert machine.drives


def test_a_ring_also_has_its_segment(tmp_path: Path) -> None:
    path = write_small(tmp_path)
    line = tmp_path / "line.toml"
    line.write_text("ring = true\n" + line.read_text())
    with Machine(path) as machine:
        assert machine.segment.ring


def test_a_network_interface_has_no_segment(tmp_path: Path) -> None:
    path = write_small(tmp_path, SMALL.replace("virtual:line.toml", "eth0"))
    with pytest.raises(RuntimeError, match="not virtual"):
        _ = Machine(path).segment


def test_a_machine_that_is_not_open_raises_an_error(tmp_path: Path) -> None:
    machine = Machine(write_small(tmp_path))
    with pytest.raises(RuntimeError, match="not open"):
        _ = machine.drives
    with machine:
        assert machine.drives
    with pytest.raises(RuntimeError, match="not open"):
        machine.loop()


def test_an_optional_device_may_be_absent(tmp_path: Path) -> None:
    with Machine(write_small(tmp_path), target=small_segment(hand=False)) as machine:
        assert list(machine.drives) == ["arm"]
        with pytest.raises(
            KeyError, match='"gripper" is absent: device "hand": no device has alias 20'
        ):
            _ = machine.drives["gripper"]
        with machine.loop() as loop:
            next(loop)


def test_a_lost_optional_device_does_not_end_the_loop(tmp_path: Path) -> None:
    segment = small_segment()
    with Machine(write_small(tmp_path), target=segment) as machine, machine.loop() as loop:
        next(loop)
        segment[5].switch_off()
        for cycle in loop:
            if cycle.number > 50:
                break
        assert not machine.drives["gripper"].present.any()
        assert machine.drives["arm"].present.all()


def test_the_error_for_an_unknown_name_has_the_nearest_one(tmp_path: Path) -> None:
    with Machine(write_small(tmp_path)) as machine:
        with pytest.raises(KeyError, match='no drives "amr"; did you mean "arm"'):
            _ = machine.drives["amr"]
        with pytest.raises(KeyError, match='no process data "x"; known names are valves, gauge'):
            _ = machine.process_data["x"]


def test_another_device_is_refused_before_a_device_changes(tmp_path: Path) -> None:
    path = write_small(tmp_path)
    segment = Segment([DigitalOutputs(), Coupler(), *small_segment()][:2])
    with pytest.raises(IdentityError) as caught, Machine(path, target=segment):
        pass
    error = caught.value
    assert str(path) in error.message
    assert 'device "coupler"' in error.message
    assert "position 0" in error.message
    assert "expected vendor 0x43544E59 product 0x00010001" in error.message
    assert "found vendor 0x43544E59 product 0x00020004" in error.message
    assert 'it has the identity of "valves"; check' in error.hint
    assert error.position == 0
    assert states(segment) == {INIT}
    assert len(error.__notes__) == 4  # valves, and what is missing


def test_a_missing_device_is_refused(tmp_path: Path) -> None:
    devices = [Coupler(), DigitalOutputs()]
    with (
        pytest.raises(SegmentError, match='device "gauge": no device has position 2') as caught,
        Machine(write_small(tmp_path), target=Segment(devices)),
    ):
        pass
    assert "the segment has 2 devices" in caught.value.hint


def test_a_device_without_its_alias_is_named(tmp_path: Path) -> None:
    path = write_small(tmp_path)
    (tmp_path / "line.toml").write_text(
        (tmp_path / "line.toml").read_text().replace("alias = 12\n", "")
    )
    with pytest.raises(SegmentError, match="no device has alias 12") as caught, Machine(path):
        pass
    assert "position 4 (Catenary virtual servo) has this identity and no alias" in caught.value.hint
    assert "catenary alias TARGET 4 12" in caught.value.hint


def test_an_empty_eeprom_is_the_cause(tmp_path: Path) -> None:
    class Erased(Coupler):
        def sii_image(self) -> bytes:
            return b"\xff" * 2048

    segment = Segment([Erased(), DigitalOutputs()])
    with (
        pytest.raises(IdentityError) as caught,
        Machine(write_small(tmp_path), target=segment),
    ):
        pass
    assert caught.value.hint.startswith("its EEPROM has no identity; SII: checksum 0xFFFF")


def test_two_devices_with_one_alias_are_refused(tmp_path: Path) -> None:
    path = write_small(tmp_path)
    line = tmp_path / "line.toml"
    line.write_text(line.read_text().replace("alias = 20", "alias = 11"))
    with pytest.raises(IdentityError, match="positions 3, 5 have the same alias 11"), Machine(path):
        pass


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (
            '"j1", "wrist/0", "wrist/2"',
            '"wrist/2": .* no axis in slot 2; its axes are "wrist/0", "wrist/1"',
        ),
        ('"j1", "hand", "wrist"', '"wrist" has 2 axes; write one of "wrist/0", "wrist/1"'),
        ('"j1", "coupler", "valves"', "is not a drive"),
    ],
)
def test_a_missing_axis_is_refused_with_its_line(axes: str, message: str, tmp_path: Path) -> None:
    roles = SMALL[SMALL.index("[drives.gripper]") : SMALL.index("[process_data.valves]")]
    text = SMALL.replace('"j1", "wrist/0", "wrist/1"', axes).replace(roles, "")
    with (
        pytest.raises(MachineFileError, match=message) as caught,
        Machine(write_small(tmp_path, text)),
    ):
        pass
    assert caught.value.key is not None
    assert caught.value.key.startswith("drives.arm")
    assert caught.value.line in (45, 46)


def test_an_object_outside_all_pdos_is_refused(tmp_path: Path) -> None:
    path = write_small(tmp_path, SMALL.replace("0x7010:01", "0x7090:01"))
    message = "0x7090:01 is not in a PDO of device 1"
    with pytest.raises(MachineFileError, match=message) as caught, Machine(path):
        pass
    assert caught.value.key == "process_data.valves.outputs.vacuum"


def test_a_missing_esi_file_is_refused_with_its_key(tmp_path: Path) -> None:
    text = SMALL.replace("position = 2", 'position = 2\nesi = "gauge.xml"')
    machine = Machine(write_small(tmp_path, text))
    with pytest.raises(MachineFileError, match="there is no file or folder") as caught:
        machine.open()
    assert caught.value.key == "device[2].esi"


def test_the_esi_file_of_another_device_is_refused_with_its_key(tmp_path: Path) -> None:
    esi = servo_file.write(tmp_path, "gauge.xml", product=7)
    text = SMALL.replace("position = 2", 'position = 2\nesi = "gauge.xml"')
    machine = Machine(write_small(tmp_path, text))
    with pytest.raises(MachineFileError, match="does not describe device") as caught:
        machine.open()
    assert caught.value.key == "device[2].esi"
    assert str(esi) in str(caught.value)


def test_the_esi_file_of_a_device_can_be_in_another_folder(tmp_path: Path) -> None:
    folder = tmp_path / "machine"
    folder.mkdir()
    path = servo_file.write(tmp_path)
    key = f'esi = "../{path.name}"'
    text = SMALL.replace("alias = 11", f"alias = 11\n{key}")
    with Machine(write_small(folder, text)) as machine:
        esi = machine.subs["j1"].esi
        assert esi is not None
        assert esi.source.file == str(path)


def test_a_folder_of_esi_files_at_the_top(tmp_path: Path) -> None:
    (tmp_path / "esi").mkdir()
    path = servo_file.write(tmp_path / "esi")
    text = SMALL.replace("[loop]", 'esi = "esi"\n\n[loop]', 1)
    with Machine(write_small(tmp_path, text)) as machine:
        found = [sub.esi for sub in machine.main.subs if sub.esi is not None]
        assert {each.source.file for each in found} == {str(path)}


def test_a_machine_without_roles_has_no_loop(tmp_path: Path) -> None:
    text = SMALL[: SMALL.index("[drives.arm]")]
    with (
        Machine(write_small(tmp_path, text)) as machine,
        pytest.raises(MachineFileError, match="no drives, process data or copies have"),
    ):
        machine.loop()


def test_the_mode_of_a_device_is_used_where_the_role_has_no_clock(tmp_path: Path) -> None:
    clock = 'clock = { op_mode = "DC Sync0", shift = "250 us" }\n'
    mode = '\nop_mode = "DC Sync0"'
    text = SMALL.replace(clock, "").replace("alias = 11", "alias = 11" + mode)
    with pytest.raises(MachineFileError, match="different values of op_mode"):
        Machine(write_small(tmp_path, text))
    text = text.replace("alias = 12", "alias = 12" + mode)
    with Machine(write_small(tmp_path, text)) as machine:
        plan = machine.main.plan(*machine.requests)
    assert {each.position: each.sync.op_mode for each in plan.devices if each.sync} == {
        3: "DC Sync0",
        4: "DC Sync0",
    }


def test_the_options_of_a_loop_are_those_of_the_api() -> None:
    def options(function: object) -> set[str]:
        found = inspect.signature(function).parameters.values()  # type: ignore[arg-type]
        return {each.name for each in found if each.kind is each.KEYWORD_ONLY}

    assert options(Machine.loop) == options(Loop)


def test_columns_may_be_objects_of_the_manufacturer(tmp_path: Path) -> None:
    table = '{ name = "torque_now", object = "0x6077:00", type = "INT", scale = 0.001 }'
    text = SMALL.replace('["following_error"]', f'["following_error", {table}]')
    with Machine(write_small(tmp_path, text)) as machine, machine.loop() as loop:
        next(loop)
        assert machine.drives["arm"].actual["torque_now"].shape == (3,)
        assert machine.drives["arm"].actual["following_error"].shape == (3,)


@pytest.mark.parametrize("option", ["true", '{ edges = ["rising"], times = false }'])
def test_touch_probes_need_drives_that_have_them(tmp_path: Path, option: str) -> None:
    text = SMALL.replace('["following_error"]', f'["following_error"]\ntouch_probe = {option}')
    with (
        Machine(write_small(tmp_path, text)) as machine,
        pytest.raises(ConfigurationError, match="the drive has no object 0x60B8"),
        machine.loop(),
    ):
        raise AssertionError("the loop was opened")


def test_safe_outputs_are_sent_when_the_loop_ends(tmp_path: Path) -> None:
    segment = small_segment()
    with Machine(write_small(tmp_path), target=segment) as machine:
        with machine.loop() as loop:
            for cycle in loop:
                machine.process_data["valves"]["clamp"] = True
                if cycle.number == 20:
                    break
        assert segment[1].core.output_image(1, 0)[0] & 0b11 == 0b10  # what the frames left behind
