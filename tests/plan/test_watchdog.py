"""Process-data watchdog of each device: its time and its trigger bit."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.model.device import DeviceDescription
from catenary.plan.options import PlanOptions
from catenary.plan.planner import make_plan
from catenary.plan.request import DeviceRequest, ObjectReference
from tests.plan.devices import Asking, lamps, servo

MILLISECOND = 1_000_000
TORQUE = ObjectReference(0x6071, 0, 16)
TORQUE_OF_SLOT_1 = ObjectReference(0x6871, 0, 16)


def with_control(device: DeviceDescription, control: int) -> DeviceDescription:
    """The device with this control byte of SyncManager 2 in its SII."""
    channels = tuple(
        replace(channel, control=control) if channel.index == 2 else channel
        for channel in device.sync_managers
    )
    return replace(device, sync_managers=channels)


def watchdog_ns(
    *outputs: ObjectReference, divider: int = 1, period: float = 1e-3, watchdog: float | None = None
) -> int:
    request = Asking({0: DeviceRequest(outputs=outputs, divider=divider)})
    options = PlanOptions(period=period, watchdog=watchdog)
    return make_plan([servo(0)], [request], options).devices[0].watchdog_ns


def test_100_ms_unless_torques_are_commanded() -> None:
    assert watchdog_ns() == watchdog_ns(ObjectReference(0x607A, 0, 32)) == 100 * MILLISECOND


@pytest.mark.parametrize(
    ("period", "divider", "expected"),
    [(1e-3, 1, 10), (0.25e-3, 1, 10), (4e-3, 1, 20), (1e-3, 3, 15), (50e-3, 1, 250)],
)
def test_in_cst_10_ms_or_five_exchanges(period: float, divider: int, expected: int) -> None:
    assert watchdog_ns(TORQUE, period=period, divider=divider) == expected * MILLISECOND


def test_five_exchanges_are_rounded_up_to_the_registers_unit() -> None:
    assert watchdog_ns(TORQUE, period=2.01e-3) == 10_100_000


def test_an_optional_torque_is_not_cst() -> None:
    optional = replace(TORQUE, required=False)
    assert watchdog_ns(optional) == 100 * MILLISECOND


def test_only_the_device_in_cst_has_the_short_watchdog() -> None:
    plan = make_plan(
        [servo(0), servo(1), lamps(2)], [Asking({1: DeviceRequest(outputs=(TORQUE,))})]
    )
    assert [device.watchdog_ns for device in plan.devices] == [
        100 * MILLISECOND,
        10 * MILLISECOND,
        100 * MILLISECOND,
    ]
    assert "device   1  Servo  station 0x1002  13 out, 13 in, watchdog 10 ms" in str(plan)


def test_the_requested_time_is_used() -> None:
    assert watchdog_ns(TORQUE, watchdog=0.05) == 50 * MILLISECOND
    assert watchdog_ns(TORQUE, watchdog=0) == 0


def test_a_period_too_long_for_the_register() -> None:
    with pytest.raises(ValueError, match=r"watchdog of 7.5 s: use 0.0001 to 6.5535 s"):
        watchdog_ns(TORQUE, period=1.5)


@pytest.mark.parametrize("control", [0x24, 0x64, 0x04, 0x44])
def test_the_trigger_bit_agrees_with_the_time(control: int) -> None:
    for watchdog, expected in ((None, control | 0x40), (0, control & ~0x40)):
        plan = make_plan([with_control(servo(0), control)], options=PlanOptions(watchdog=watchdog))
        outputs, inputs = plan.devices[0].layout.sync_managers
        assert outputs.control == expected
        assert outputs.triggers_watchdog is (watchdog is None)
        assert inputs.control == 0x20
