"""Twins from clones: a clone of the twins equals the clone they came from."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.clone import clone_segment
from catenary.errors import CloneError, ConfigurationError, SdoAbort
from catenary.line import ClonedDevice, Line, read_line, write_line
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Junction,
    MappingQuirks,
    Motor,
    Plant,
    Segment,
    Servo,
    ServoQuirks,
    Twin,
    TwinOptions,
    faults,
    read_segment,
)
from catenary.wire import register
from catenary.wire.sdo_information import Access
from tests.virtual.plants import PENDULUM
from tests.virtual.test_esi_files import DEVICES
from tests.virtual.test_twin_from_sii import IMAGES

TURN = 2**20
# Registers that a MainDevice writes: a twin has the values after power-on.
WRITTEN = (
    *(register.fmmu(k).address for k in range(16)),
    *(register.sync_manager(k).address for k in range(16)),
    *(each.address for each in (register.RECEIVE_TIMES, register.SYSTEM_TIME_OFFSET)),
    *(each.address for each in (register.SYSTEM_TIME_DELAY, register.SYNC_CYCLE_TIMES)),
    *(register.SYSTEM_TIME_DIFFERENCE_FILTER.address, register.ASSIGN_ACTIVATE.address),
    *(register.WATCHDOG_DIVIDER.address, register.WATCHDOG_TIME_PROCESS_DATA.address),
)
COUNTERS = (register.ERROR_COUNTERS.address,)


def own_line() -> Segment:
    """Return a tree with devices of every own kind."""
    devices = [
        Coupler(),
        DigitalOutputs(bits=8),
        Servo(axes=2, name="wrist", serial=7, alias=3),
        AnalogInputs(),
        DigitalInputs(),
        Junction(),
        Servo(name="left", clock_bits=32),
        Servo(name="right", lrw=False, quirks=ServoQuirks(quick_stop_option="absent")),
    ]
    return Segment(devices, behind={6: (5, 1), 7: (5, 2)})


def cloned(source: Segment, folder: Path) -> Line:
    cat.clone(source, folder, pre_op=True)
    return read_line(folder)


def and_again(source: Segment, folder: Path) -> tuple[Line, Line]:
    """Return a clone of a segment, and a clone of its twins."""
    first = cloned(source, folder / "first")
    return first, cloned(Segment.from_clone(folder / "first"), folder / "second")


def test_the_clone_of_a_twin_is_identical(tmp_path: Path) -> None:
    first, second = and_again(own_line(), tmp_path)
    assert first.complete
    assert first == second
    assert contents(tmp_path / "first") == contents(tmp_path / "second")


def contents(folder: Path) -> dict[Path, bytes]:
    """Return the content of all files of a folder."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder): path.read_bytes() for path in files}


@pytest.mark.parametrize("file", [file for file, *_ in IMAGES])
def test_the_clone_of_a_twin_of_an_sii_is_identical(
    shared_data: Path, tmp_path: Path, file: str
) -> None:
    first, second = and_again(Segment([Device.from_sii(shared_data / "sii" / file)]), tmp_path)
    assert first == second


@pytest.mark.parametrize(("file", "name"), [(file, name) for file, name, *_ in DEVICES])
def test_the_clone_of_a_twin_of_an_esi_is_identical(
    shared_data: Path, tmp_path: Path, file: str, name: str
) -> None:
    twin = Device.from_esi(shared_data / "esi" / file, name)
    first, second = and_again(Segment([twin]), tmp_path)
    assert first == second


def after_power_on(device: ClonedDevice) -> ClonedDevice:
    """Return a device without what a MainDevice configures, and without counters."""
    left_out = (*WRITTEN, *COUNTERS)
    kept = {at: data for at, data in device.registers.items() if at not in left_out}
    return replace(device, registers=kept, station_address=0)


def test_after_a_loop_only_what_the_master_wrote_and_counters_differ(tmp_path: Path) -> None:
    source = Segment([Coupler(), Servo(axes=2, serial=5), AnalogInputs()])
    with cat.MainDevice(source) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=1.0, dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_to([0.3, -0.2]))
    source[1].count_errors(1, invalid_frames=3)
    first, second = and_again(source, tmp_path)
    assert first != second
    assert [after_power_on(each) for each in first.devices] == [
        after_power_on(each) for each in second.devices
    ]


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the clone of a small line. Its drive is at 0.5 rad."""
    servo = Servo(name="elbow", serial=5, counts_per_turn=4096, rated_torque=1.0)
    source = Segment([Coupler(), servo, AnalogInputs()])
    servo.move_to(0.5)
    folder = tmp_path_factory.mktemp("line") / "line"
    cat.clone(source, folder, pre_op=True)
    return folder


def twin_of(segment: Segment, key: int | str) -> Twin:
    device = segment[key]
    assert isinstance(device, Twin)
    return device


def test_a_drive_starts_where_it_was_and_moves(line: Path) -> None:
    segment = Segment.from_clone(line)
    twin = twin_of(segment, "elbow")
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=4096, velocity_limit=1.0, dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            assert arm.actual.position[0] == pytest.approx(0.5, abs=2e-3)
            loop.wait(arm.move_to(0.0))
            assert twin.axis_position() == pytest.approx(0.0, abs=5e-3)


def test_motors_have_what_the_objects_tell(line: Path) -> None:
    [motor] = twin_of(Segment.from_clone(line), "elbow").motors
    assert (motor.counts_per_turn, motor.rated_torque) == (4096, 1.0)
    assert motor.inertia == Motor().inertia / 2


def test_positions_survive_a_power_cycle(line: Path) -> None:
    segment = Segment.from_clone(line)
    twin = twin_of(segment, "elbow")
    twin.move_to(1.5)
    twin.power_off()
    twin.power_on()
    assert twin.axis_position() == pytest.approx(1.5)


def test_quirks_and_motors_are_options(line: Path) -> None:
    options = TwinOptions(
        quirks=ServoQuirks(bit_12="never", follows_without_bit_12=True),
        motor=Motor(inertia=1e-3),
    )
    segment = Segment.from_clone(line, options={"elbow": options})
    twin = twin_of(segment, "elbow")
    assert twin.motors[0].inertia == 5e-4
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=4096, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_by(0.2))
            statusword = int.from_bytes(twin.read_object(0x6041), "little")
            assert statusword & 0x1000 == 0


def test_an_option_for_an_unknown_device_is_refused(line: Path) -> None:
    with pytest.raises(ConfigurationError, match="no device is named 'knee'") as caught:
        Segment.from_clone(line, options={"knee": TwinOptions()})
    assert "elbow" in caught.value.hint


def test_a_fault_of_a_twin_is_reported(line: Path) -> None:
    segment = Segment.from_clone(line, faults=[faults.DriveFault(device=1, code=0x7300, at=0.5)])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=4096, velocity_limit=1.0)
        with pytest.raises(cat.DriveError, match="0x7300"):
            hold(arm)


def hold(arm: cat.Drives) -> None:
    with cat.Loop(arm, period=1e-3) as loop:
        loop.run_for(2.0)


def test_a_plant_moves_with_the_twins(line: Path, tmp_path: Path) -> None:
    model = tmp_path / "pendulum.xml"
    model.write_text(PENDULUM)
    plant = Plant(model)
    options = {"elbow": TwinOptions(motor=Motor(rated_torque=20.0))}
    edited(line, tmp_path / "line", lambda device: with_torque(device, 20_000))
    segment = Segment.from_clone(tmp_path / "line", plant=plant, options=options)
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=4096, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_by(0.3))
            assert plant.data.joint("swing").qpos[0] == pytest.approx(0.3, abs=0.02)


def with_torque(device: ClonedDevice, torque: int) -> ClonedDevice:
    """Return a drive with another rated torque [mN·m] in its object 0x6076."""
    return with_entry(device, 0x6076, 0, value=torque.to_bytes(4, "little"))


def with_entry(device: ClonedDevice, index: int, subindex: int, **changes: object) -> ClonedDevice:
    objects = tuple(
        replace(
            each,
            entries=tuple(
                replace(entry, **changes)  # type: ignore[arg-type]
                if entry.subindex == subindex
                else entry
                for entry in each.entries
            ),
        )
        if each.index == index
        else each
        for each in device.objects
    )
    return replace(device, objects=objects)


def edited(line: Path, folder: Path, change: Callable[[ClonedDevice], ClonedDevice]) -> Path:
    """Write a clone with another device 1."""
    found = read_line(line)
    devices = tuple(change(each) if each.position == 1 else each for each in found.devices)
    write_line(replace(found, devices=devices), folder)
    return folder


def test_the_rights_of_the_clone_are_kept(line: Path, tmp_path: Path) -> None:
    """One entry is writable in PRE-OP only. The device refuses to upload another one."""
    rights = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP | Access.WRITE_PRE_OP

    def change(device: ClonedDevice) -> ClonedDevice:
        device = with_entry(device, 0x2102, 0, access=rights)
        return with_entry(device, 0x6081, 0, value=None, abort=0x0800_0020)

    with cat.MainDevice(Segment.from_clone(edited(line, tmp_path / "line", change))) as main:
        sub = main.scan()[1]
        sub.sdo.write(0x2102, 0, b"\1\0")
        with pytest.raises(SdoAbort, match="0x08000020"):
            sub.sdo.read(0x6081)
        sub.request_state("SAFE_OP")
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.write(0x2102, 0, b"\2\0")
        assert caught.value.code == 0x0800_0022
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.read(0x5FFF)
        assert caught.value.code == 0x0602_0000


def test_rules_of_pdos_are_those_of_the_clone(tmp_path: Path) -> None:
    fixed = MappingQuirks(fixed_pdos="declared", fixed_lists="declared")
    cat.clone(Segment([Servo(mapping_quirks=fixed)]), tmp_path / "line", pre_op=True)
    with cat.MainDevice(Segment.from_clone(tmp_path / "line")) as main:
        [sub] = main.scan()
        for index in (0x1600, 0x1C12):
            with pytest.raises(SdoAbort) as caught:
                sub.sdo.write(index, 0, b"\0")
            assert caught.value.code == 0x0601_0002


def test_the_assignment_of_the_clone_is_that_at_power_on(tmp_path: Path) -> None:
    other = MappingQuirks(power_up=(0x1602, 0x1A01))
    cat.clone(Segment([Servo(mapping_quirks=other)]), tmp_path / "line", pre_op=True)
    with cat.MainDevice(Segment.from_clone(tmp_path / "line")) as main:
        [sub] = main.scan()
        assert [pdo.index for each in sub.description.outputs for pdo in each.pdos] == [0x1602]
        assert [pdo.index for each in sub.description.inputs for pdo in each.pdos] == [0x1A01]


def test_a_device_in_op_gives_no_twin(tmp_path: Path) -> None:
    """A clone reads only the registers of such a device."""
    line = Segment([Coupler(), Servo(name="elbow")])
    with cat.MainDevice(line) as main:
        main.scan()[1].request_state("SAFE_OP")
        folder = tmp_path / "line"
        clone_segment(main, folder)
    with pytest.raises(
        ConfigurationError, match=r"line: device 1 .*: its SII was not read"
    ) as caught:
        Segment.from_clone(folder)
    assert "clone the segment again" in caught.value.hint


def test_a_damaged_sii_names_the_device(line: Path, tmp_path: Path) -> None:
    def cut(device: ClonedDevice) -> ClonedDevice:
        assert device.sii is not None
        return replace(device, sii=device.sii[:200])

    with pytest.raises(ConfigurationError, match=r"device 1 \(elbow\): SII: .*200|bytes"):
        Segment.from_clone(edited(line, tmp_path / "line", cut))


def test_a_segment_file_may_be_a_clone(line: Path) -> None:
    assert [device.name for device in read_segment(line)] == [
        device.name for device in read_line(line).devices
    ]


def test_a_clone_cannot_be_a_ring(line: Path) -> None:
    with pytest.raises(ConfigurationError, match="a clone cannot be a ring"):
        read_segment(line, ring=True)


def test_a_damaged_file_is_named(line: Path, tmp_path: Path) -> None:
    shutil.copytree(line, tmp_path / "line")
    (tmp_path / "line" / "line.toml").write_text("format = 2\n")
    with pytest.raises(CloneError, match=r"line\.toml"):
        read_segment(tmp_path / "line")


@pytest.mark.parametrize(("option", "shown"), [(6, b"\6\0"), ("absent", None), (2, b"\x05\0")])
def test_a_quirk_has_priority_over_an_option_code_of_the_clone(
    line: Path, tmp_path: Path, option: int | str, shown: bytes | None
) -> None:
    def change(device: ClonedDevice) -> ClonedDevice:
        return with_entry(device, 0x605A, 0, value=b"\x05\0")

    edited(line, tmp_path / "line", change)
    quirks = ServoQuirks(quick_stop_option=option)  # type: ignore[arg-type]
    segment = Segment.from_clone(tmp_path / "line", options={"elbow": TwinOptions(quirks=quirks)})
    with cat.MainDevice(segment) as main:
        sub = main.scan()[1]
        if shown is not None:
            assert sub.sdo.read(0x605A) == shown
            return
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.read(0x605A)
        assert caught.value.code == 0x0602_0000


def test_a_quirk_of_the_sii_contradicts_a_file() -> None:
    with pytest.raises(ValueError, match="quirk watchdog_trigger: a twin has what its file gives"):
        TwinOptions(quirks=ServoQuirks(watchdog_trigger=False))


def test_an_object_that_no_pdo_carries_can_be_mapped(tmp_path: Path) -> None:
    """0x2102 is mappable in the edited clone. A program maps it, and writes it cyclically."""
    rights = Access(0x3F) | Access.RXPDO_MAPPABLE
    source = Segment([Coupler(), Servo(serial=1)])
    cat.clone(source, tmp_path / "first", pre_op=True)
    edited(
        tmp_path / "first",
        tmp_path / "line",
        lambda device: with_entry(device, 0x2102, 0, access=rights),
    )
    segment = Segment.from_clone(tmp_path / "line")
    with cat.MainDevice(segment) as main:
        data = cat.ProcessData(main.scan()[1], outputs={"word": (0x2102, 0, cat.types.UINT)})
        with cat.Loop(data, period=2e-3) as loop:
            data["word"] = 0x1234
            loop.run_for(0.02)
            assert twin_of(segment, 1).read_object(0x2102) == b"\x34\x12"
