"""Several networks in one loop: one schedule, an engine and a native thread for each.

The cycle starts of all are those of the first. A network that has failed never holds the others:
its own thread goes on asking, and its cycles are not good.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from threading import Lock

from catenary.core import CYCLE_NONE, CYCLE_STOPPED, CYCLE_WORKING_COUNTER, Cycle
from catenary.errors import CatenaryError, LoopError
from catenary.link import Link
from catenary.loop.network import TROUBLE, Network
from catenary.loop.options import ClockOptions
from catenary.loop.running import STOP_SLICE_NS, Running
from catenary.loop.signals import SignalGuard
from catenary.wire.al import State

NETWORK_TROUBLE = CYCLE_WORKING_COUNTER | CYCLE_STOPPED | CYCLE_NONE
VIRTUAL = "virtual time"


class NetworksCycle(Cycle):
    """One cycle of several networks. Number and time are those of the first."""

    def __init__(self, runnings: Sequence[Running], quorum: int) -> None:
        super().__init__(runnings[0].engine)
        self._networks = tuple(Cycle(running.engine) for running in runnings)
        self.alive = (True,) * len(runnings)  # whether each one's devices are in OP
        self._quorum = quorum

    @property
    def networks(self) -> tuple[Cycle, ...]:
        """The cycle of each network."""
        return self._networks

    @property
    def ok(self) -> bool:
        """True if as many networks as the quorum were good. A network whose devices are out of OP
        is not good, even if it answers."""
        good = [n.ok and alive for n, alive in zip(self.networks, self.alive, strict=True)]
        return sum(good) >= self._quorum

    @property
    def lost(self) -> int:
        """Cycles in a row that were not good, of the worst network."""
        return max(network.lost for network in self.networks)

    @property
    def late(self) -> bool:
        """True if cycles passed without Python, in any network."""
        return any(network.late for network in self.networks)

    @property
    def limited(self) -> bool:
        """True if a set-point was limited, in any network."""
        return any(network.limited for network in self.networks)

    @property
    def refused(self) -> bool:
        """True if a set-point was refused, in any network."""
        return any(network.refused for network in self.networks)


class NetworksIteration:
    """Iterator that steps all networks once per `next` and yields their one NetworksCycle."""

    def __init__(self, networks: Sequence[Network], quorum: int, *, faults: bool) -> None:
        self._runnings = [network.session for network in networks]
        self._quorum = quorum
        self._faults = faults
        self._dead: set[int] = set()  # by identity: those that have failed and not returned
        self._cycle: NetworksCycle | None = None
        self.commit_lock: Lock | None = None  # see core.Iteration

    def __iter__(self) -> NetworksIteration:
        return self

    def __next__(self) -> NetworksCycle:
        for one in self._runnings:
            if one.service.beside is not None:
                one.service.step()
        if self._cycle is None:
            flags = [one.engine.run(1) for one in self._runnings]
            self._cycle = NetworksCycle(self._runnings, self._quorum)
            for one in self._runnings:
                one.engine.zero_ns = self._runnings[0].engine.zero_ns
        else:
            self._commit_if_free()
            flags = [one.engine.next() for one in self._runnings]
        self._judge(self._cycle, flags)
        return self._cycle

    def _commit_if_free(self) -> None:
        """Commit, unless another thread is writing the targets."""
        lock = self.commit_lock
        if lock is not None and not lock.acquire(blocking=False):
            for one in self._runnings:
                one.engine.keep_targets()
            return
        try:
            self.step_movers()
            for one in self._runnings:
                one.engine.commit_targets()
        finally:
            if lock is not None:
                lock.release()

    def step_movers(self) -> None:
        """Write the targets of axes that move."""
        if self._cycle is None:
            return
        for one, its in zip(self._runnings, self._cycle.networks, strict=True):
            for mover in list(one.views.movers):
                mover.step(its.time)

    def _judge(self, cycle: NetworksCycle, flags: Sequence[int]) -> None:
        """Raise what ends the loop: too few networks, or trouble in one that is alive."""
        alive = [self._lives(one, mine) for one, mine in zip(self._runnings, flags, strict=True)]
        cycle.alive = tuple(alive)
        for one, mine, lives in zip(self._runnings, flags, alive, strict=True):
            if not lives and sum(alive) >= self._quorum:
                continue
            if mine & TROUBLE or one.engine.al_status != State.OP:
                if not lives:
                    self._stop_others(one)
                one.judge(mine, faults=self._faults)

    def _lives(self, one: Running, flags: int) -> bool:
        """Return whether a network carries its devices.

        A network that had failed and answers again counts once its devices are in OP: those that
        their watchdogs stopped do not stop the other networks.
        """
        if flags & NETWORK_TROUBLE:
            self._dead.add(id(one))
        elif one.engine.al_status == State.OP:
            self._dead.discard(id(one))
        return id(one) not in self._dead

    def _stop_others(self, dead: Running) -> None:
        for one in self._runnings:
            if one is not dead:
                one.stop_axes_at_once()


def share_time(runnings: Sequence[Running]) -> None:
    """In virtual time, let this thread run the cycles of all networks in turns.

    Raises:
        ValueError: the networks have different clocks.
    """
    virtual = [one.engine.scheduling == VIRTUAL for one in runnings]
    if not any(virtual):
        return
    if not all(virtual) or not _have_one_clock([one.main.link for one in runnings]):
        raise ValueError(
            "the networks of one loop need one time: give their segments the same clock, "
            "Segment(..., clock=VirtualClock())"
        )
    for one in runnings:
        one.share_time([other for other in runnings if other is not one])


def leave_all(runnings: Sequence[Running], guard: SignalGuard) -> list[Exception]:
    """Stop every network that answers, whatever happens to the others. Return the problems."""
    problems: list[Exception] = []
    try:
        for running in runnings[:1]:  # one thread iterates all
            running.end_background()
    except LoopError as problem:
        problems.append(problem)
    if len(runnings) > 1:
        brake(runnings, guard)
    for running in runnings:
        problems += running.leave(guard)
    return problems


def brake(runnings: Sequence[Running], guard: SignalGuard) -> None:
    """Stop all axes of all networks at once, in slices, until they stand or the deadline."""
    for one in runnings:
        one.make_outputs_safe()
    moving = [one for one in runnings if one.is_open and one.plan.cycle.axes]
    for one in moving:
        one.stop_axes_at_once()
    deadline = max((one.plan.cycle.stop_deadline_ns for one in moving), default=0)
    for _ in range(deadline // STOP_SLICE_NS + 1):
        if guard.hurry or not moving:
            return
        moving = [one for one in moving if not _stands(one)]


def clocks_of_several(options: ClockOptions) -> ClockOptions:
    """Return the options, checked: the clocks of several networks follow the MainDevice.

    Raises:
        ValueError: `lead="reference"`.
    """
    if options.lead == "reference":
        raise ValueError(
            'several networks need lead="main": each reference clock would have its own cycle '
            "starts, and one schedule has one"
        )
    return replace(options, lead="main")


def cpus_for(count: int, cpu: int | Sequence[int] | None) -> list[int | None]:
    """Return the CPU of each network's thread.

    None: where there are more CPUs than networks, the last ones; else unchanged.
    """
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


def _have_one_clock(links: Sequence[Link]) -> bool:
    """Return whether time that passes on the first passes on all."""
    first, *others = links
    later = max(link.now() for link in links) + 1000
    first.wait_until(later, False)
    for link in others:
        link.wait_until(0, False)  # reads its clock
    return all(link.now() >= later for link in others)


def _stands(running: Running) -> bool:
    try:
        return running.engine.run_until_stopped(STOP_SLICE_NS)
    except (CatenaryError, OSError):
        return True  # its link is gone: nothing more can be done from here
