"""A bridge of a loop in virtual time: the test runs the cycles and the steps of the bridge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import catenary as cat
from catenary.ros2.bridge import Bridge
from catenary.ros2.config import Config
from catenary.virtual import Segment
from catenary.virtual.devices import Coupler, Servo
from tests.ros2.memory_backend import MemoryBackend
from tests.share.names import own_name

STEPS = 4000  # of 2 ms: a bound for tests that wait


@dataclass
class Rig:
    """A loop of two axes in virtual time, its share, and a bridge."""

    name: str
    loop: cat.Loop
    arm: cat.Drives
    share: cat.Share
    backend: MemoryBackend
    bridge: Bridge

    def step(self, cycles: int = 2) -> None:
        """Run cycles of the loop, then one step of the bridge with everything due."""
        for _ in range(cycles):
            next(self.loop)
            self.share.apply(self.arm)
        self.spin()

    def spin(self) -> None:
        self.backend.spin_once(0.0)
        make_due(self.bridge)
        self.bridge.step()

    def until(self, condition: Callable[[], bool]) -> bool:
        """Step until a condition holds. Return False if it does not."""
        for _ in range(STEPS):
            if condition():
                return True
            self.step()
        return False

    def sent(self, topic: str) -> list[Any]:
        return self.backend.publishers[topic].messages

    @property
    def last_report(self) -> str:
        return self.bridge.reports.texts[-1] if self.bridge.reports.texts else ""


def make_due(bridge: Bridge) -> None:
    """Let the rates pass, which count real time."""
    bridge._send_at = 0.0
    for topic in bridge._publishing._topics:
        topic.next_time = 0.0


@contextmanager
def rig(
    config: Config | None = None, *, mode: str = "csp", services: bool = True, **options: Any
) -> Iterator[Rig]:
    segment = Segment([Coupler(), Servo(), Servo()])
    with (
        own_name("ros2") as name,
        cat.MainDevice(segment) as main,
        cat.Share(name, jog=True) as share,
    ):
        main.scan()
        given = {"counts_per_turn": 2**20, "velocity_limit": 2.0, **options}
        arm = cat.Drives(main.subs.drives, mode=mode, **given)
        with cat.Loop(arm, period=1e-3, sink=share) as loop:
            for _ in range(50):
                next(loop)
            backend = MemoryBackend(services=services)
            with Bridge(name, backend, config or Config()) as bridge:
                yield Rig(name, loop, arm, share, backend, bridge)
