"""An operator for the tests of the core: the motion words of a sink, written as a client does."""

from __future__ import annotations

import math

import numpy as np

from catenary.share.command_table import MOTION, SLOT
from catenary.share.jog import JogStatus, RequestStatus
from tests.core.rig import Bench
from tests.core.sink_table import PUT, Table
from tests.link_table import capsule_of


class Operator:
    """Owns the motion words of a bench, whose engine runs again afterwards."""

    def __init__(self, b: Bench, *, jog: bool = True) -> None:
        self.bench = b
        count = len(b.drives)
        memory = np.zeros(MOTION.itemsize + count * SLOT.itemsize + 64, np.uint8)
        start = -memory.ctypes.data % 64
        self.bytes = memory[start : start + MOTION.itemsize + count * SLOT.itemsize]
        self.head = self.bytes[: MOTION.itemsize].view(MOTION)[0]
        self.slots = self.bytes[MOTION.itemsize :].view(SLOT)
        self.table = Table(
            2,
            *b.engine.sink_sizes,
            None,
            PUT(lambda *_: None),
            self.bytes.ctypes.data,
            count,
            jog,
        )
        self.attach()

    def attach(self) -> None:
        """Connect the words to the engine again."""
        self.bench.engine.stop()
        self.bench.engine.set_sink(capsule_of(self.table, b"catenary.sink"))
        self.bench.engine.start()

    @property
    def token(self) -> int:
        return int(self.head["token"])

    def press(
        self,
        velocity: float,
        distance: float = math.nan,
        acceleration: float = math.nan,
        *,
        sweep: tuple[float, float, float] = (0.0, 0.0, 0.0),
        axis: int = 0,
        token: int | None = None,
    ) -> int:
        """Start a jog. `sweep`: start and end [Hz], duration [s]."""
        slot = self.slots[axis]
        number = int(slot["press"]) + 1
        slot["begun"] = number
        slot["velocity"], slot["distance"], slot["acceleration"] = velocity, distance, acceleration
        slot["sweep_start"], slot["sweep_end"], slot["sweep_duration"] = sweep
        self.beat(axis=axis, token=token, press=number)
        slot["press"] = number
        return number

    def beat(self, *, axis: int = 0, token: int | None = None, press: int | None = None) -> None:
        slot = self.slots[axis]
        number = int(slot["press"]) if press is None else press
        echoed = self.token if token is None else token
        slot["heartbeat"] = echoed | (number & 0xFFFF) << 48

    def release(self, axis: int = 0) -> None:
        self.slots[axis]["released"] = self.slots[axis]["press"]

    def request(self, state: int, axis: int = 0) -> None:
        self.slots[axis]["request"] = ((int(self.slots[axis]["request"]) >> 8) + 1) << 8 | state

    def stop(self) -> None:
        self.head["stop"] += np.uint64(1)

    def status(self, axis: int = 0) -> JogStatus:
        answer, press = int(self.slots[axis]["answer"]), int(self.slots[axis]["press"])
        return JogStatus(answer & 0xFF) if answer >> 8 == press else JogStatus.NONE

    def taken(self, axis: int = 0) -> RequestStatus:
        taken, request = int(self.slots[axis]["taken"]), int(self.slots[axis]["request"])
        return RequestStatus(taken & 0xFF) if taken >> 8 == request >> 8 else RequestStatus(0)
