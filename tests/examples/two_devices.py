"""Both sides of examples/teleoperation in lockstep and virtual time, with links to tamper with."""

from __future__ import annotations

import importlib.util
import secrets
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from catenary import teleoperation
from catenary.teleoperation import LinkState, NetworkModel, Peer, Transport, VirtualNetwork

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "teleoperation"
KEY = secrets.token_bytes(32)
PERIOD_NS = 1_000_000
Change = Callable[[bytes], list[bytes]]


def load(name: str) -> Any:
    """Return a module of the example."""
    unique = f"teleoperation_example_{name}"
    if str(FOLDER) not in sys.path:
        sys.path.append(str(FOLDER))  # for the imports between its modules
    if unique not in sys.modules:
        spec = importlib.util.spec_from_file_location(unique, FOLDER / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        sys.modules[unique] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[unique])
    return sys.modules[unique]


class Clock:
    """Time of both sides."""

    now_ns = 0


class Tampered:
    """Transport whose received packets pass through `change`."""

    def __init__(self, transport: Transport, change: Change) -> None:
        self.transport, self.change = transport, change
        self.waiting: deque[bytes] = deque()

    @property
    def now_ns(self) -> int:
        return self.transport.now_ns

    def send(self, data: bytes) -> bool:
        return self.transport.send(data)

    def receive(self) -> bytes | None:
        data = self.transport.receive()
        if data is not None:
            self.waiting.extend(self.change(data))
        return self.waiting.popleft() if self.waiting else None

    def close(self) -> None:
        self.transport.close()


class Side:
    """One device, its peer, and its newest cycle."""

    def __init__(self, role: str, transport: Transport, controller: Any, **options: Any) -> None:
        self.device = load("device")
        self.peer = Peer(transport, **{"key": KEY, "axes": 4, "max_delay": 0.05} | options)
        self.stack = ExitStack()
        self.segment, self.hand = self.stack.enter_context(self.device.virtual_device(role))
        self.cycles = self.device.cycles(self.segment, self.hand, controller, self.peer)
        self.stack.enter_context(closing(self.cycles))
        self.now: Any = None

    def step(self) -> None:
        self.now = next(self.cycles)

    @property
    def connected(self) -> bool:
        return self.peer.state is LinkState.CONNECTED


class Pair:
    """Leader and follower in lockstep."""

    def __init__(self, leader: Side, follower: Side, clock: Clock, controller: Any) -> None:
        self.leader, self.follower, self.clock = leader, follower, clock
        self.controller = controller

    def run(self, until: float, *, alone: bool = False) -> None:
        """Advance to a time [s]; with `alone`, only the leader."""
        while self.leader.now is None or self.leader.now.time < until:
            self.clock.now_ns += PERIOD_NS
            self.leader.step()
            if not alone:
                self.follower.step()


def unchanged(data: bytes) -> list[bytes]:
    return [data]


@contextmanager
def devices(
    model: NetworkModel | None = None,
    *,
    change: Change = unchanged,
    leader: dict[str, Any] | None = None,
    follower: dict[str, Any] | None = None,
) -> Iterator[Pair]:
    """Yield both devices. `change` tampers with the packets that the leader receives."""
    network, clock = VirtualNetwork(model or NetworkModel(delay=0.01)), Clock()
    controller = load("device").controller(0.05)
    near = Side("leader", Tampered(network.side(0, clock), change), controller, **leader or {})
    far = Side("follower", network.side(1, clock), controller, **follower or {})
    with near.stack, far.stack:
        yield Pair(near, far, clock, controller)


__all__ = ["FOLDER", "KEY", "Pair", "devices", "load", "teleoperation"]
