"""Watchdogs of devices follow the plan, for any content of the SII."""

from __future__ import annotations

from typing import Any

import pytest

import catenary as cat
from catenary.plan.request import DeviceRequest, ObjectReference
from catenary.virtual import DigitalOutputs, ServoQuirks
from tests.plan.devices import Asking

SAFE_OP = 4
TORQUE = ObjectReference(0x6071, 0, 16)


def registers(segment: cat.Segment, position: int) -> tuple[int, int]:
    """Return the control byte of SyncManager 2 and 0x0420 of a virtual device."""
    core: Any = segment[position].core
    return core.peek(position, 0x0814, 1)[0], int.from_bytes(
        core.peek(position, 0x0420, 2), "little"
    )


@pytest.mark.parametrize("trigger", [True, False])
@pytest.mark.parametrize("checks", [True, False])
@pytest.mark.parametrize(
    ("watchdog", "expected"), [(None, (0x64, 1000)), (0.02, (0x64, 200)), (0, (0x24, 0))]
)
def test_the_watchdog_trigger_follows_the_watchdog_time(
    trigger: bool, checks: bool, watchdog: float | None, expected: tuple[int, int]
) -> None:
    quirks = ServoQuirks(watchdog_trigger=trigger, checks_watchdog=checks)
    segment = cat.Segment([cat.virtual.Servo(quirks=quirks)])
    with cat.MainDevice(segment) as main:
        main.scan()
        main.configure(main.plan(watchdog=watchdog))
        assert segment[0].state == SAFE_OP
        assert registers(segment, 0) == expected


def test_a_drive_in_cst_has_10_ms() -> None:
    segment = cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])
    with cat.MainDevice(segment) as main:
        main.scan()
        main.configure(main.plan(Asking({1: DeviceRequest(outputs=(TORQUE,))})))
        assert [registers(segment, k)[1] for k in range(2)] == [1000, 100]


def test_terminals_keep_their_outputs_without_a_watchdog() -> None:
    lamps = DigitalOutputs()
    segment = cat.Segment([cat.virtual.Coupler(), lamps])
    with cat.MainDevice(segment) as main:
        outputs = cat.Outputs(main.scan()[1])
        with cat.Loop(outputs, watchdog=0) as loop:
            for cycle in loop:
                outputs.bits[:] = 1
                if cycle.number == 5:
                    break
            assert lamps.outputs == 0b1111
