"""Safe values of outputs are sent whenever the loop ends, before the devices leave OP."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import cast

import pytest

import catenary as cat
from catenary.bus import MainDevice
from catenary.core import CYCLE_STOPPED
from catenary.drive import Drives, ProcessData
from catenary.loop.safe_outputs import confirm_safe
from catenary.loop.session import Session
from catenary.loop.signals import SignalGuard
from catenary.plan.cycle import ExecutionMode
from catenary.plan.request import Views
from catenary.realtime import VirtualClock
from catenary.virtual import Coupler, Segment, Servo
from catenary.virtual.faults import power_cycle
from tests.force_sensor import ForceSensor

SENSOR = 2


class Cell:
    def __init__(self) -> None:
        self.sensor = ForceSensor()
        self.segment = Segment([Coupler(), Servo(), self.sensor])
        self.main = MainDevice(self.segment)


@pytest.fixture
def cell() -> Cell:
    return Cell()


def run(cell: Cell, end: Callable[[cat.Loop], None], **options: object) -> ProcessData:
    with cell.main as main:
        main.scan()
        data = ProcessData(main.subs[SENSOR], **options)  # type: ignore[arg-type]
        with cat.Loop(data, period=1e-3) as loop:
            data["Lamp"], data["Tare"] = 50, True
            for cycle in loop:
                if cycle.number == 20:
                    break
            assert (cell.sensor.lamp, cell.sensor.tare) == (50, True)
            end(loop)
    return data


def test_at_the_end_of_the_block(cell: Cell) -> None:
    data = run(cell, lambda loop: None, safe={"Lamp": 7})
    assert (cell.sensor.lamp, cell.sensor.tare) == (7, False)
    assert bytes(data.outputs) == b"\x00\x07\x00"


def test_bytes_of_the_whole_outputs(cell: Cell) -> None:
    run(cell, lambda loop: None, safe=b"\x01\x02\x03")
    assert (cell.sensor.lamp, cell.sensor.tare) == (0x0302, True)


def test_without_safe_values_all_outputs_become_0(cell: Cell) -> None:
    run(cell, lambda loop: None)
    assert (cell.sensor.lamp, cell.sensor.tare) == (0, False)


def test_after_an_error_of_the_program(cell: Cell) -> None:
    def fail(loop: cat.Loop) -> None:
        raise KeyError("a mistake")

    with pytest.raises(KeyError, match="a mistake"):
        run(cell, fail, safe={"Lamp": 7})
    assert cell.sensor.lamp == 7


def test_unsent_values_do_not_follow_the_safe_ones(cell: Cell) -> None:
    with cell.main as main:
        main.scan()
        data = ProcessData(main.subs[SENSOR], safe={"Lamp": 7})
        with cat.Loop(data) as loop:
            next(loop)
            data["Lamp"] = 99
    assert cell.sensor.lamp == 7


@pytest.mark.parametrize("divider", [1, 8])
def test_a_divided_device_gets_them_too(cell: Cell, divider: int) -> None:
    with cell.main as main:
        main.scan()
        arm = Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0)
        data = ProcessData(main.subs[SENSOR], safe={"Lamp": 7}, divider=divider)
        with cat.Loop(arm, data) as loop:
            data["Lamp"] = 50
            for _ in range(3 * divider):
                next(loop)
            assert cell.sensor.lamp == 50
    assert cell.sensor.lamp == 7


def test_while_the_axes_still_brake(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outputs need not wait for the axes: a laser is off at once."""
    stop_axes = Session._stop_axes
    lamps: list[int] = []

    def observed(running: Session, guard: SignalGuard) -> None:
        lamps.append(cell.sensor.lamp)
        stop_axes(running, guard)
        lamps.append(cell.sensor.lamp)

    monkeypatch.setattr(Session, "_stop_axes", observed)
    with cell.main as main:
        main.scan()
        arm = Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=10.0)
        data = ProcessData(main.subs[SENSOR], safe={"Lamp": 7})
        with cat.Loop(arm, data) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                data["Lamp"] = 50
                arm.target.position[:] = home + 2.0 * cycle.time
                if cycle.time > 0.3:
                    break
    assert lamps == [50, 7]


def test_a_lost_device_is_named(cell: Cell) -> None:
    def pull(loop: cat.Loop) -> None:
        cell.segment.inject(power_cycle(SENSOR, at=0.0, for_=60.0))
        for _ in loop:
            pass

    with pytest.raises(cat.WorkingCounterError) as caught:
        run(cell, pull, safe={"Lamp": 7})
    notes = "\n".join(caught.value.__notes__)
    assert "device 2 Force sensor did not confirm the safe values" in notes


def test_a_device_gets_them_while_another_one_of_its_unit_is_silent() -> None:
    ours, other = ForceSensor(), ForceSensor()
    segment = Segment([Coupler(), ours, other])
    with MainDevice(segment) as main:
        main.scan()
        data = ProcessData(main.subs[1], safe={"Lamp": 7})
        rest = ProcessData(main.subs[2], outputs={})

        def run_until_it_is_silent() -> None:
            with cat.Loop(data, rest) as loop:
                data["Lamp"] = 50
                segment.inject(power_cycle(2, at=0.0, for_=60.0))
                for _ in loop:
                    pass

        with pytest.raises(cat.WorkingCounterError) as caught:
            run_until_it_is_silent()
        assert ours.lamp == 7
    assert "even if another device of its sync unit is silent" in "\n".join(caught.value.__notes__)


def test_devices_that_are_not_required_confirm_nothing_after_the_cycle_has_ended(
    cell: Cell,
) -> None:
    with cell.main as main:
        main.scan()
        data = ProcessData(main.subs[SENSOR], required=False)
        plan = main.plan(data).cycle
    views = cast(Views, SimpleNamespace(unit_valid=[0] * len(plan.sync_units)))
    guard = cast(SignalGuard, SimpleNamespace(hurry=False))
    confirm_safe(plan, views, lambda: CYCLE_STOPPED, guard)


def test_a_device_that_is_not_required_may_be_gone(cell: Cell) -> None:
    with cell.main as main:
        main.scan()
        arm = Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0)
        data = ProcessData(main.subs[SENSOR], safe={"Lamp": 7}, required=False)
        with cat.Loop(arm, data) as loop:
            cell.segment.inject(power_cycle(SENSOR, at=0.0, for_=60.0))
            for cycle in loop:
                if cycle.time > 0.1:
                    break
            assert not data.present


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_in_both_modes(cell: Cell, execution: ExecutionMode) -> None:
    with cell.main as main:
        main.scan()
        data = ProcessData(main.subs[SENSOR], safe={"Lamp": 7})
        with cat.Loop(data, execution=execution) as loop:
            data["Lamp"] = 50
            next(loop)
            next(loop)
            next(loop)
    assert cell.sensor.lamp == 7


def test_on_each_of_several_networks() -> None:
    clock = VirtualClock()
    sensors = [ForceSensor(), ForceSensor()]
    mains = [MainDevice(Segment([Coupler(), each], clock=clock)) for each in sensors]
    with mains[0], mains[1]:
        data = [ProcessData(main.scan()[1], safe={"Lamp": 7}) for main in mains]
        with cat.Loop(*data) as loop:
            for each in data:
                each["Lamp"] = 50
            for _ in range(4):
                next(loop)
            assert [sensor.lamp for sensor in sensors] == [50, 50]
        assert [sensor.lamp for sensor in sensors] == [7, 7]


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_in_real_time_the_native_thread_sends_them(execution: ExecutionMode) -> None:
    """Nothing is said of how timely."""
    sensor = ForceSensor()
    with MainDevice(Segment([Coupler(), sensor], clock="monotonic")) as main:
        data = ProcessData(main.scan()[1], safe={"Lamp": 7})
        patience = cat.StopPolicy(lost_limit=1_000_000)
        with cat.Loop(data, period=2e-3, execution=execution, watchdog=0, stop=patience) as loop:
            for _ in loop:
                data["Lamp"] = 50
                if sensor.lamp == 50:
                    break
    assert sensor.lamp == 7
