"""Cell for scenarios: a virtual segment, a fault injector on its link, and a MainDevice.

Assertions check the true state of the segment: `cell.states`, `cell.servos[i].drive_state()`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import catenary as cat
from catenary.bus import SubDevices
from catenary.link import Fault, FaultInjector
from catenary.virtual import Coupler, Device, DigitalOutputs, Segment, SercosDrive, Servo

PRE_OP, SAFE_OP, OP = 2, 4, 8
TURN = 2 * math.pi
KINDS = ("cia402", "sercos", "mixed")  # of the two drives of a cell


@dataclass
class Cell:
    segment: Segment
    link: FaultInjector
    main: cat.MainDevice

    @property
    def subs(self) -> SubDevices:
        return self.main.subs

    @property
    def servos(self) -> list[Servo | SercosDrive]:
        """Drives of the segment, of any profile."""
        return [device for device in self.segment if isinstance(device, (Servo, SercosDrive))]

    @property
    def states(self) -> list[int]:
        """AL states of all devices, including the error bit."""
        return [device.state for device in self.segment]

    @property
    def drive_states(self) -> list[str]:
        return [servo.drive_state() for servo in self.servos]

    def drives(self, **options: object) -> cat.Drives:
        """Return all servos, with the default resolution of the segment."""
        given = {"counts_per_turn": 2**20, "velocity_limit": 100.0, **options}
        if any(isinstance(each, SercosDrive) for each in self.segment):
            given = {"rated_torque": 2.0, **given}
        return cat.Drives(self.subs.drives, **given)  # type: ignore[arg-type]

    def spoil(self, fault: str, cycles: int, **options: object) -> None:
        """Apply a fault to the frames of the next cycles."""
        now = self.link.seen(traffic="cyclic")
        frames = range(now, now + cycles)
        self.link.inject(Fault(kind=fault, traffic="cyclic", frames=frames, **options))  # type: ignore[arg-type]

    def let_pass(self, seconds: float) -> None:
        """Let time pass without a MainDevice."""
        self.link.wait_until(self.link.now() + round(seconds * 1e9), False)

    def assert_safe(self) -> None:
        """Check that no axis turns, no drive is powered and no device is in OP."""
        assert all(state & 0x0F < OP for state in self.states), self.states
        assert "OPERATION ENABLED" not in self.drive_states, self.drive_states
        assert all(abs(servo.velocity_rad_s) < 0.05 for servo in self.servos)


@contextmanager
def cell_of(
    *devices: Device, behind: Mapping[int, tuple[int, int]] | None = None
) -> Iterator[Cell]:
    """Yield a scanned cell, by default of a coupler, lamps and two servos.

    `behind` is that of `Segment`.
    """
    chosen = devices or (Coupler(), DigitalOutputs(), Servo(serial=1), Servo(serial=2))
    segment = Segment(chosen, behind=behind)
    link = FaultInjector(segment)
    with cat.MainDevice(link) as main:
        main.scan()
        yield Cell(segment, link, main)


@contextmanager
def cell_with(kind: str) -> Iterator[Cell]:
    """Yield a cell with two drives of a kind, one of KINDS."""
    first = Servo(serial=1) if kind == "cia402" else SercosDrive(serial=1)
    second = SercosDrive(serial=2) if kind == "sercos" else Servo(serial=2)
    with cell_of(Coupler(), DigitalOutputs(), first, second) as cell:
        yield cell
