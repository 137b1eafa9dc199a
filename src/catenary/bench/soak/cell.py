"""The machine that is soaked: an arm and lamps that the loop requires, and behind them a tool, a
gripper and a sensor that it does not."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import catenary as cat
from catenary.virtual import AnalogInputs, Coupler, DigitalOutputs, Segment, Servo

COUPLER, LAMPS, ARM, TOOL, GRIPPER, SENSOR = 0, 1, (2, 3), 4, 5, 6
DEVICES = 7
OPTIONAL = (TOOL, GRIPPER, SENSOR)
SERVOS = (*ARM, TOOL)
WITH_MAILBOX = (*SERVOS, SENSOR)
OUTPUTS = (LAMPS, GRIPPER)
COUNTS_PER_TURN = 2**20
PERIOD = 1e-3  # [s]
AMPLITUDE, FREQUENCY = 0.2, 1.5  # [rad], [rad/s]: of what the axes do

Array = npt.NDArray[np.float64]


def make_segment() -> Segment:
    """In virtual time."""
    arm = [Servo(name=f"arm {k}", serial=k) for k in (1, 2)]
    tool = [Servo(name="tool", serial=3), DigitalOutputs(serial=4), AnalogInputs(serial=5)]
    return Segment([Coupler(), DigitalOutputs(bits=8), *arm, *tool])


class Part:
    """Owns the motion of some drives: each swings about where it was enabled."""

    def __init__(self, drives: cat.Drives) -> None:
        self.drives = drives
        self._home: Array = np.zeros(len(drives))
        self._since: Array = np.zeros(len(drives))  # [s] that each has been enabled

    def step(self) -> None:
        """The targets of the next cycle."""
        enabled = self.drives.enabled
        self._home = np.where(self._since > 0, self._home, self.drives.actual.position)
        self._since = np.where(enabled, self._since + PERIOD, 0.0)
        swing = AMPLITUDE * (1 - np.cos(FREQUENCY * self._since))
        self.drives.target.position[:] = self._home + swing

    @property
    def idle(self) -> list[int]:
        """Axes that are there and not enabled."""
        return [int(k) for k in np.flatnonzero(self.drives.present & ~self.drives.enabled)]


class Wishes:
    """Owns what one loop exchanges."""

    def __init__(self, main: cat.MainDevice) -> None:
        subs = main.subs
        arm = cat.Drives(
            [subs[k] for k in ARM], counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0
        )
        tool = cat.Drives(
            [subs[TOOL]], counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0, required=False
        )
        self.lamps = cat.Outputs(subs[LAMPS])
        self.gripper = cat.Outputs(subs[GRIPPER], required=False)
        self.sensor = cat.Inputs(subs[SENSOR], required=False)
        self.parts = {ARM: Part(arm), (TOOL,): Part(tool)}

    @property
    def all(self) -> tuple[cat.Drives | cat.Inputs | cat.Outputs, ...]:
        drives = [part.drives for part in self.parts.values()]
        return (*drives, self.lamps, self.gripper, self.sensor)

    def step(self) -> None:
        """What the application writes in every cycle."""
        for part in self.parts.values():
            part.step()
        self.lamps.bits[:] = 1
        self.gripper.bits[:] = 1

    @property
    def present(self) -> dict[int, bool]:
        """Which devices answered in this cycle."""
        found = {LAMPS: self.lamps.present[0], GRIPPER: self.gripper.present[0]}
        found[SENSOR] = self.sensor.present[0]
        for positions, part in self.parts.items():
            found |= dict(zip(positions, map(bool, part.drives.present), strict=True))
        return found
