"""Several networks in one loop: one schedule, an engine and a native thread for each.

The instants of all are those of the first. A network that is dead never holds the others: its own
thread goes on asking, and its cycles are not good.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from catenary.core import (
    CYCLE_NONE,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
    Cycle,
)
from catenary.errors import CatenaryError
from catenary.link import Link
from catenary.loop.devices import DeviceWish, by_network
from catenary.loop.loop import TROUBLE, Loop
from catenary.loop.publishing import one_sink_each
from catenary.loop.running import STOP_SLICE_NS, Running, take_down
from catenary.plan.sink import Sink
from catenary.wire.al import State

NETWORK_TROUBLE = CYCLE_WORKING_COUNTER | CYCLE_STOPPED | CYCLE_NONE
VIRTUAL = "virtual time"


class NetworksCycle:
    """One cycle of several networks: what is said of all of them, and of each in `networks`."""

    def __init__(self, networks: Sequence[Cycle], quorum: int) -> None:
        self.networks = tuple(networks)
        self.alive = (True,) * len(self.networks)  # whether each one's devices are in OP
        self._quorum = quorum

    @property
    def number(self) -> int:
        """Counted from the first iteration, of the first network."""
        return self.networks[0].number

    @property
    def time(self) -> float:
        """Its instant [s], from the first iteration on."""
        return self.networks[0].time

    @property
    def ok(self) -> bool:
        """Whether as many networks as the quorum asks for were good. One whose devices are out of
        OP is not, though it answers."""
        good = [n.ok and alive for n, alive in zip(self.networks, self.alive, strict=True)]
        return sum(good) >= self._quorum

    @property
    def lost(self) -> int:
        """Cycles in a row that were not good, of the worst network."""
        return max(network.lost for network in self.networks)

    @property
    def late(self) -> bool:
        """Whether instants passed without Python, in any network."""
        return any(network.late for network in self.networks)

    @property
    def limited(self) -> bool:
        """Whether a set-point was limited, in any network."""
        return any(network.limited for network in self.networks)

    @property
    def refused(self) -> bool:
        """Whether a set-point was no number, in any network."""
        return any(network.refused for network in self.networks)

    def __repr__(self) -> str:
        return f"NetworksCycle(number={self.number}, time={self.time:.6f}, ok={self.ok})"


class NetworksLoop(Loop):
    """`Loop(upper, lower, ...)` with wishes on several MainDevices: `cycle.networks[i]` has what
    each network says, `loop.networks[i]` each one's plan, timing and log.

    `quorum`: how many networks must be good for the cycle to be; None: all. While as many are, one
    that fails does not end the loop: its axes are stopped by its drives' watchdogs or natively, and
    `cycle.networks[i].ok` tells. Threaded only. `cpu`: one for each network; None: one each of the
    last, where there are more than networks. `sink`: one for each network. Where
    wishes have `dc=`, the clocks of all follow the MainDevice (`clock="main"`).
    """

    def __init__(
        self,
        *wishes: DeviceWish,
        quorum: int | None = None,
        cpu: int | Sequence[int] | None = None,
        sink: Sink | Sequence[Sink] | None = None,
        **options: Any,
    ) -> None:
        if options.get("run", "threaded") != "threaded":
            raise ValueError(
                'several networks need run="threaded": a thread that iterates cannot keep the '
                "instants of more than one"
            )
        if options.get("laws"):
            raise ValueError("laws belong to one network: make a Loop for it")
        if options.setdefault("clock", "main") != "main":
            raise ValueError(
                'several networks need clock="main": each reference clock would have its own '
                "instants, and one schedule has one"
            )
        groups = by_network(wishes)
        count = len(groups)
        if quorum is not None and not 1 <= quorum <= count:
            raise ValueError(f"quorum={quorum}: from 1 to the number of networks, {count}")
        super().__init__(*groups[0][1], **options)
        places = zip(groups, cpus_for(count, cpu), one_sink_each(sink, count), strict=True)
        self.networks = tuple(
            Loop(*mine, **options, cpu=one, sink=its) for (_, mine), one, its in places
        )
        self._quorum = count if quorum is None else quorum
        self._all: list[Running] = []

    def __enter__(self) -> NetworksLoop:
        try:
            self._guard.install()
            self._all = []
            self._dead: set[int] = set()  # by identity: those that have died and are not back
            self._cycles: NetworksCycle | None = None
            for network in self.networks:
                network._running = network._prepared(self._abandoned())
                self._all.append(network._running)
            self._leave_at_the_latest(self._all)
            self._share_time()
            for running in self._all:
                running.open(self._all[0].engine.origin)
            if self._enable:
                for running in self._all:
                    running.enable()
            for running in self._all:
                running.begin_figures()
            return self
        except BaseException as error:
            self._tell_end(error)
            for problem in self._leave():
                error.add_note(f"on the way down: {problem}")
            raise

    def __iter__(self) -> NetworksLoop:  # type: ignore[override]
        for running in self._all:
            running.service.runner.adopt()
        return self

    def __next__(self) -> NetworksCycle:  # type: ignore[override]
        running = self._all
        if not running:
            raise RuntimeError("the loop is not open: with Loop(...) as loop:")
        for one in running:
            if one.service.beside is not None:
                one.service.step()
        if self._cycles is None:
            flags = [one.engine.run(1) for one in running]
            self._cycles = NetworksCycle([Cycle(one.engine) for one in running], self._quorum)
        else:
            for one in running:
                one.engine.commit_targets()
            flags = [one.engine.next() for one in running]
        self._judge_all(self._cycles, flags)
        return self._cycles

    def _judge_all(self, cycle: NetworksCycle, flags: Sequence[int]) -> None:
        """Raises what ends the loop: too few networks, or trouble in one that is alive."""
        alive = [self._lives(one, mine) for one, mine in zip(self._all, flags, strict=True)]
        cycle.alive = tuple(alive)
        for one, mine, lives in zip(self._all, flags, alive, strict=True):
            if not lives and sum(alive) >= self._quorum:
                continue
            if mine & TROUBLE or one.engine.al_status != State.OP:
                if not lives:
                    self._stop_others(one)
                one.judge(mine, faults=self._raise_faults)

    def _lives(self, one: Running, flags: int) -> bool:
        """Whether a network carries its devices. One that was dead and answers again is so once
        they are in OP: those that their watchdogs stopped do not stop the other networks."""
        if flags & NETWORK_TROUBLE:
            self._dead.add(id(one))
        elif one.engine.al_status == State.OP:
            self._dead.discard(id(one))
        return id(one) not in self._dead

    def _stop_others(self, dead: Running) -> None:
        for one in self._all:
            if one is not dead:
                one.stop_axes_at_once()

    def _share_time(self) -> None:
        """In virtual time this thread runs the cycles of all, in turns."""
        virtual = [one.engine.scheduling == VIRTUAL for one in self._all]
        if not any(virtual):
            return
        if not all(virtual) or not _have_one_clock([one.main.link for one in self._all]):
            raise ValueError(
                "the networks of one loop need one time: give their segments the same clock, "
                "Segment(..., clock=VirtualClock())"
            )
        for one in self._all:
            one.share_time([other for other in self._all if other is not one])

    def wait_locked(self, within: float = 1e-6, timeout: float = 5.0) -> None:
        """See `Loop.wait_locked`: one network after the other, each within the timeout. Their
        clocks follow the MainDevice: `loop.networks[i].clocks`."""
        clocked = [(one, one.clocks) for one in self._all if one.clocks is not None]
        if not clocked:
            raise RuntimeError("no distributed clocks in this loop: Drives(..., dc=True)")
        for running, clocks in clocked:
            running.refuse_powered_torque("wait_locked")

            def check(flags: int, running: Running = running) -> None:
                if flags & TROUBLE or running.engine.al_status != State.OP:
                    running.judge(flags, faults=self._raise_faults)

            clocks.wait(within, timeout, check)

    # What one network has, and several have each

    def start(self, *arguments: Any, **options: Any) -> Any:
        """Laws belong to one network."""
        raise ValueError("laws belong to one network: make a Loop for it")

    run = start

    def stream(self, capacity: int = 1000) -> Any:
        """Streams belong to one network: `loop.networks[i].stream(...)`."""
        raise ValueError("a stream belongs to one network: loop.networks[i].stream(...)")

    @property
    def _runnings(self) -> Sequence[Running]:
        return self._all

    @property
    def _opened(self) -> Running:
        if not self._all:
            raise RuntimeError("the loop is not open: with Loop(...) as loop:")
        return self._all[0]

    # Leaving

    def _tell_end(self, error: BaseException) -> None:
        for one in self._all:
            one.tell_end(error)

    def _leave(self) -> list[Exception]:
        """Every network that answers is stopped, whatever the others do."""
        problems: list[Exception] = []
        try:
            self._brake()
            opened = {id(one.main) for one in self._all}
            for one in self._all:
                problems += one.leave(self._guard)
            for network in self.networks:
                if id(network._main) not in opened:
                    problems += take_down(network._main)
        finally:
            self._guard.restore()
            if self._finalizer is not None:
                self._finalizer.detach()
        return problems

    def _brake(self) -> None:
        """All axes of all networks at once, in slices, until they stand or the deadline."""
        moving = [one for one in self._all if one.is_open and one.plan.cycle.axes]
        for one in moving:
            one.stop_axes_at_once()
        deadline = max((one.plan.cycle.stop_deadline_ns for one in moving), default=0)
        for _ in range(deadline // STOP_SLICE_NS + 1):
            if self._guard.hurry or not moving:
                return
            moving = [one for one in moving if not _stands(one)]


def _have_one_clock(links: Sequence[Link]) -> bool:
    """Whether time that passes on the first passes on all."""
    first, *others = links
    later = max(link.now() for link in links) + 1000
    first.wait_until(later, False)
    for link in others:
        link.wait_until(0, False)  # looks at its clock
    return all(link.now() >= later for link in others)


def _stands(running: Running) -> bool:
    try:
        return running.engine.run_until_stopped(STOP_SLICE_NS)
    except (CatenaryError, OSError):
        return True  # its link is gone: nothing more can be done from here


def cpus_for(count: int, cpu: int | Sequence[int] | None) -> list[int | None]:
    """The CPU of each network's thread."""
    if isinstance(cpu, int):
        return [cpu] * count
    if cpu is not None:
        if len(cpu) != count:
            raise ValueError(f"cpu: {len(cpu)} for {count} networks")
        return list(cpu)
    allowed = sorted(os.sched_getaffinity(0))
    if len(allowed) <= count:
        return [None] * count
    return list(allowed[-count:])
