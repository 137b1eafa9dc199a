"""Homing of the virtual servo (mode 6), checked by its statusword."""

from __future__ import annotations

import math
import struct

import pytest

from catenary.virtual import Servo
from tests.virtual.test_servo import CSP, STATION, TURN, Drive

HM = 6
START = 0x1F
PROGRESS = 0x3400  # bits 10, 12, 13


class Homing(Drive):
    """A drive in mode 6 with external hard stops."""

    def __init__(self, method: int, offset: int = 0) -> None:
        super().__init__(Servo(coulomb_friction=0.0))
        for index, data in (
            (0x6098, struct.pack("<b", method)),
            (0x607C, struct.pack("<i", offset)),
        ):
            self.main.download(STATION, index, 0, data)
        self.servo.move_to(0.25)
        self.enable(HM)

    def run(self, cycles: int, stop: float | None = None) -> int:
        """Return bits 10, 12 and 13. `stop`: angle beyond which a spring acts."""
        for _ in range(cycles):
            status = self.cycle().status
            if stop is not None:
                over = self.servo.position_rad - stop
                load = -10 * over - 0.05 * self.servo.velocity_rad_s
                self.servo.apply_load(load if over * stop > 0 else 0.0)
        return status & PROGRESS


def test_the_present_position_becomes_home() -> None:
    drive = Homing(37)
    assert drive.run(3) == 0x0400  # not started
    drive.word = START
    assert drive.run(5) == 0x1400
    assert drive.cycle().position == 0
    assert drive.servo.position_rad == pytest.approx(0.25, abs=1e-3)


def test_zero_is_home_plus_offset() -> None:
    drive = Homing(37, offset=1000)
    drive.word = START
    drive.run(5)
    assert drive.cycle().position == -1000


def test_csp_continues_from_the_new_zero() -> None:
    drive = Homing(37)
    drive.word = START
    drive.run(5)
    drive.word, drive.mode, drive.position = 0x0F, CSP, 0
    drive.run(5)
    drive.position = TURN // 8
    for _ in range(50):
        drive.position += TURN // 1000
        drive.cycle()
    inputs = drive.cycle(200)
    assert inputs.mode == CSP
    turned = drive.servo.position_rad - 0.25
    assert inputs.position == pytest.approx(turned * TURN / (2 * math.pi), abs=2)


@pytest.mark.parametrize(("method", "stop"), [(-3, 0.6), (-4, -0.1)])
def test_homing_against_a_hard_stop(method: int, stop: float) -> None:
    drive = Homing(method)
    drive.word = START
    assert drive.run(100, stop) == 0  # still searching
    assert drive.run(1500, stop) == 0x1400
    assert drive.servo.position_rad == pytest.approx(stop, abs=0.08)
    assert abs(drive.cycle().position) < TURN * 0.08 / (2 * math.pi)
    assert abs(drive.servo.torque_nm) < 0.3 * 2.0  # the threshold limits the torque


def test_clearing_bit_4_ends_the_search() -> None:
    drive = Homing(-3)
    drive.word = START
    drive.run(100)
    assert drive.servo.velocity_rad_s == pytest.approx(1.0, abs=0.1)
    drive.word = 0x0F
    assert drive.run(300) == 0x0400
    assert drive.servo.velocity_rad_s == pytest.approx(0.0, abs=0.01)
    before = drive.cycle().position
    assert before == pytest.approx(drive.servo.position_rad * TURN / (2 * math.pi), abs=2)


def test_unknown_method_is_a_homing_error() -> None:
    drive = Homing(5)
    drive.word = START
    assert drive.run(5) == 0x2400
