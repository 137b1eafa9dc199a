"""Scripted SERCOS drive for the bench of rig.py: S-0-0134 in, S-0-0135 out."""

from __future__ import annotations

from dataclasses import dataclass, field

from catenary.plan.cycle import AxisPlan
from tests.core.rig import ScriptedDrive, axis

CSP = 8
ON, ENABLE, RESTART, SYNCHRONISATION = 0x8000, 0x4000, 0x2000, 0x0400
NOT_READY, READY, POWERED, OPERATING, REACTION, FAULT = range(6)
STATUS = (0x0000, 0x4000, 0x8000, 0xC000, 0xE000, 0x2000)
RUN = ON | ENABLE | RESTART


@dataclass
class ScriptedSercosDrive(ScriptedDrive):
    """A drive that obeys at once. A stop lasts `ramp`, a fault reaction `reaction` frames."""

    state: int = POWERED
    ramp: int = 5
    reaction: int = 5
    ignores_drive_off: bool = False
    shows_bit_3: bool = True
    sent: list[int] = field(default_factory=list)
    left: int = 0  # frames until the end of the ramp

    def exchange(self, outputs: bytes) -> bytes:
        self.sent.append(int.from_bytes(outputs[0:2], "little"))
        self.target_velocity = int.from_bytes(outputs[3:7], "little", signed=True)
        self.target_position = int.from_bytes(outputs[7:11], "little", signed=True)
        self.target_torque = int.from_bytes(outputs[11:13], "little", signed=True)
        self.step(self.sent[-1])
        if self.follows_now and self.moves:
            self.position = self.target_position
        return self.inputs()

    @property
    def torque_on(self) -> bool:
        return self.state in (OPERATING, REACTION)

    @property
    def follows_now(self) -> bool:
        return self.state == OPERATING and self.left == 0

    def step(self, word: int) -> None:
        if self.torque_on and not word & ENABLE:
            self.state = FAULT if self.state == REACTION else POWERED
            self.left = 0
        elif self.state == POWERED and word & RUN == RUN:
            self.state, self.left = OPERATING, 0
        elif self.state == OPERATING and word & ON:
            self.left = 0  # drive on during the ramp: it follows at once
        elif self.state == OPERATING and not self.ignores_drive_off:
            self.count_down(self.ramp, POWERED)
        elif self.state == REACTION:
            self.count_down(self.reaction, FAULT)

    def count_down(self, frames: int, end: int) -> None:
        self.left = (self.left or frames + 1) - 1
        if self.left == 0:
            self.state = end

    def fail(self) -> None:
        self.state, self.left = (REACTION if self.state == OPERATING else FAULT), 0

    def inputs(self) -> bytes:
        status = STATUS[self.state]
        if self.follows_now and self.shows_bit_3:
            status |= 0x0008
        return status.to_bytes(2, "little") + super().inputs()[2:]  # the others as in CiA 402


def sercos_axis(k: int = 0, **more: object) -> AxisPlan:
    """Return axis k of the bench as a SERCOS axis."""
    return axis(k, profile="sercos", mode_target=None, mode_actual=None, **more)
