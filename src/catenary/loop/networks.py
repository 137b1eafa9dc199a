"""Several networks in one loop: one schedule, and an engine and a native thread for each network.

All networks use the cycle starts of the first. A failed network does not delay the others. Its own
thread continues to send, and its cycles are bad.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from threading import Lock

from catenary.core import (
    CYCLE_LAW_FAILED,
    CYCLE_NONE,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
    Cycle,
)
from catenary.errors import CatenaryError, LoopError
from catenary.link import Link
from catenary.loop.devices import LoopRequest, by_network
from catenary.loop.laws.law import Laws, laws_of_networks
from catenary.loop.network import TROUBLE, Network, Settings
from catenary.loop.options import ClockOptions
from catenary.loop.publishing import one_sink_each
from catenary.loop.session import STOP_SLICE_NS, Session
from catenary.loop.signals import SignalGuard
from catenary.plan.sink import Sink
from catenary.wire.al import AlState

NETWORK_TROUBLE = CYCLE_WORKING_COUNTER | CYCLE_STOPPED | CYCLE_NONE
VIRTUAL = "virtual time"


class NetworksCycle(Cycle):
    """One cycle of several networks. Its number and time are those of the first."""

    def __init__(self, sessions: Sequence[Session], quorum: int) -> None:
        super().__init__(sessions[0].engine)
        self._networks = tuple(Cycle(session.engine) for session in sessions)
        self.alive = (True,) * len(sessions)  # True if the network's devices are in OP
        self._quorum = quorum

    @property
    def networks(self) -> tuple[Cycle, ...]:
        """The cycle of each network."""
        return self._networks

    @property
    def ok(self) -> bool:
        """True if the number of good networks reached the quorum.

        A network with devices out of OP is not good, even if it answers.
        """
        good = [n.ok and alive for n, alive in zip(self.networks, self.alive, strict=True)]
        return sum(good) >= self._quorum

    @property
    def lost(self) -> int:
        """Largest number of consecutive bad cycles of any network."""
        return max(network.lost for network in self.networks)

    @property
    def late(self) -> bool:
        """True if cycles of any network were skipped, or ran without new targets."""
        return any(network.late for network in self.networks)

    @property
    def limited(self) -> bool:
        """True if any network limited a set-point."""
        return any(network.limited for network in self.networks)

    @property
    def refused(self) -> bool:
        """True if any network refused a set-point."""
        return any(network.refused for network in self.networks)


class NetworksIteration:
    """Iterator that steps all networks once per `next` and yields their common NetworksCycle."""

    def __init__(self, networks: Sequence[Network], quorum: int) -> None:
        self._sessions = [network.session for network in networks]
        self._quorum = quorum
        self._dead: set[int] = set()  # identities of the failed networks that have not recovered
        self._cycle: NetworksCycle | None = None
        self.commit_lock: Lock | None = None  # see core.Iteration

    def __iter__(self) -> NetworksIteration:
        return self

    def __next__(self) -> NetworksCycle:
        for one in self._sessions:
            one.service.step_without_thread()
        if self._cycle is None:
            return self._first()
        self._commit_if_free()
        self._judge(self._cycle, [one.engine.next() for one in self._sessions])
        return self._cycle

    def _first(self) -> NetworksCycle:
        """Run and check the first cycle, from which `time` and `number` count."""
        flags = [one.engine.run(1) for one in self._sessions]
        self._cycle = NetworksCycle(self._sessions, self._quorum)
        for one in self._sessions:
            one.engine.zero_ns = self._sessions[0].engine.zero_ns
        self._judge(self._cycle, flags)
        return self._cycle

    def hold(self, led: Session) -> None:
        """Run and check one cycle without targets of the application: networks without a law hold.

        Args:
            led: Network that runs the law whose end the caller waits for.
        """
        for one in self._sessions:
            one.service.step_without_thread()
        if self._cycle is None:
            self._first()
            return
        self._judge(self._cycle, [_held_cycle(one, led) for one in self._sessions])

    def _commit_if_free(self) -> None:
        """Write the targets of moving axes and commit, unless another thread writes targets."""
        lock = self.commit_lock
        if lock is not None and not lock.acquire(blocking=False):
            for one in self._sessions:
                one.engine.keep_targets()
            return
        try:
            self.step_movers()
            for one in self._sessions:
                one.engine.commit_targets()
        finally:
            if lock is not None:
                lock.release()

    def step_movers(self) -> None:
        """Write the targets of moving axes."""
        if self._cycle is None:
            return
        for one, its in zip(self._sessions, self._cycle.networks, strict=True):
            for mover in list(one.views.movers):
                mover.step(its.time)

    def _judge(self, cycle: NetworksCycle, flags: Sequence[int]) -> None:
        """Update `cycle.alive`, and check the networks.

        Raise an error if too few networks are alive, if a live one has a fault, or if a law has
        failed. If a dead network or a law ends the loop, the axes of the others are stopped first.
        """
        alive = [self._lives(one, mine) for one, mine in zip(self._sessions, flags, strict=True)]
        cycle.alive = tuple(alive)
        for one, mine, lives in zip(self._sessions, flags, alive, strict=True):
            failed_law = mine & CYCLE_LAW_FAILED
            if not lives and sum(alive) >= self._quorum:
                if not failed_law:
                    continue
                mine = failed_law  # the quorum excuses everything else
            if mine & TROUBLE or one.engine.al_status != AlState.OP:
                if failed_law or not lives:
                    self._stop_others(one)
                one.judge(mine)

    def _lives(self, one: Session, flags: int) -> bool:
        """Update the set of failed networks. Return True if this network is alive.

        A failed network is alive again when its devices are in OP. Until then, the loop may
        continue although watchdogs have stopped these devices.
        """
        if flags & NETWORK_TROUBLE:
            self._dead.add(id(one))
        elif one.engine.al_status == AlState.OP:
            self._dead.discard(id(one))
        return id(one) not in self._dead

    def _stop_others(self, dead: Session) -> None:
        for one in self._sessions:
            if one is not dead:
                one.stop_axes_at_once()


def make_networks(
    requests: Sequence[LoopRequest],
    settings: Settings,
    cpu: int | Sequence[int] | None,
    sink: Sink | Sequence[Sink] | None,
    laws: Laws,
) -> tuple[Network, ...]:
    """Return one network for each MainDevice of the requests.

    Args:
        requests: Process-data requests.
        settings: Options that all networks share.
        cpu: CPU of the native thread, or one for each network; None: see `cpus_for`.
        sink: Receiver of every cycle, or one for each network.
        laws: Laws to compile on entry: see `laws_of_networks`.

    Raises:
        ValueError: An option is impossible for this number of networks, or see `by_network`.
        TypeError: See `by_network` and `laws_of_networks`.
        LawError: A law has an argument with an unknown name.
    """
    groups = by_network(requests)
    count = len(groups)
    if count > 1:
        refuse_for_several(settings)
        settings = replace(settings, clocks=clocks_of_several(settings.clocks))
    networks = tuple(
        Network(main, mine, settings, cpu=one, sink=its, laws=own)
        for (main, mine), one, its, own in zip(
            groups,
            cpus_for(count, cpu),
            one_sink_each(sink, count),
            laws_of_networks(laws, count),
            strict=True,
        )
    )
    for number, network in enumerate(networks):
        network.number, network.count = number, count
    return networks


def chosen_network(networks: Sequence[Network], what: str, number: int | None) -> Network:
    """Return the network with a number.

    Args:
        networks: Networks of the loop.
        what: Text for the error: "a law", "a stream".
        number: Number of the network; None: the only one.

    Raises:
        ValueError: There is no such network, or there are several and `number` is None.
    """
    last = len(networks) - 1
    if number is None and last > 0:
        raise ValueError(
            f"{what} works on one of the {len(networks)} networks of this loop: give network=0 to "
            f"network={last}"
        )
    if number is not None and not 0 <= number <= last:
        raise ValueError(f"network={number}: the loop has the networks 0 to {last}")
    return networks[number or 0]


def refuse_for_several(settings: Settings) -> None:
    """Raise ValueError for options that only one network can have."""
    if settings.execution != "threaded":
        raise ValueError(
            'several networks need execution="threaded": an iterating thread can keep the cycle '
            "starts of only one network"
        )
    if settings.trigger is not None:
        raise ValueError(
            "trigger= works on one network: the networks of one loop have common cycle starts; "
            "use a loop for each network, in its own process"
        )


def share_time(sessions: Sequence[Session]) -> None:
    """In virtual time, let this thread run the cycles of all networks in turn.

    Raises:
        ValueError: The networks have different clocks.
    """
    virtual = [one.engine.scheduling == VIRTUAL for one in sessions]
    if not any(virtual):
        return
    if not all(virtual) or not _have_one_clock([one.main.link for one in sessions]):
        raise ValueError(
            "the networks of one loop need the same clock: write clock = VirtualClock(), and then "
            "Segment(..., clock=clock) for each segment"
        )
    for one in sessions:
        one.share_time([other for other in sessions if other is not one])


def leave_all(sessions: Sequence[Session], guard: SignalGuard) -> list[Exception]:
    """End the background thread and stop every network; return the problems.

    A problem in one network does not prevent the others from being stopped.

    Args:
        sessions: Sessions of the loop.
        guard: Signal handlers; a second signal shortens the waits.
    """
    problems: list[Exception] = []
    try:
        for session in sessions[:1]:  # one thread iterates all
            session.end_background()
    except LoopError as problem:
        problems.append(problem)
    if len(sessions) > 1:
        brake(sessions, guard)
    for session in sessions:
        problems += session.leave(guard)
    return problems


def brake(sessions: Sequence[Session], guard: SignalGuard) -> None:
    """Set all outputs to their safe values, and stop all axes of all networks together.

    Wait for standstill, at most until the deadline.

    Args:
        sessions: Sessions of the loop.
        guard: Signal handlers; a second signal ends the wait.
    """
    for one in sessions:
        one.make_outputs_safe()
    moving = [one for one in sessions if one.is_open and one.plan.cycle.axes]
    for one in moving:
        one.stop_axes_at_once()
    deadline = max((one.plan.cycle.stop_deadline_ns for one in moving), default=0)
    for _ in range(deadline // STOP_SLICE_NS + 1):
        if guard.hurry or not moving:
            return
        moving = [one for one in moving if not _stands(one)]


def clocks_of_several(options: ClockOptions) -> ClockOptions:
    """Return the checked options: the clocks of several networks follow the MainDevice.

    Raises:
        ValueError: `lead` is "reference", or there is an external clock.
    """
    if options.lead == "reference":
        raise ValueError(
            'several networks need lead="main": every reference clock would require its own cycle '
            "starts, but the networks share one schedule"
        )
    if options.external is not None:
        raise ValueError("external= works on one network: make a separate Loop for each network")
    return replace(options, lead="main")


def cpus_for(count: int, cpu: int | Sequence[int] | None) -> list[int | None]:
    """Return the CPU of each network's thread.

    Args:
        count: Number of networks.
        cpu: Requested CPU, for all threads, or one CPU for each network. None: any CPU of the
            process; for several networks the last CPUs, if there are more CPUs than networks.

    Raises:
        ValueError: The number of CPUs is not the number of networks, or `cpu` is a sequence for one
            network.
    """
    if count == 1 and cpu is not None and not isinstance(cpu, int):
        raise ValueError(f"cpu={cpu}: give one number; one network has one thread")
    if isinstance(cpu, int):
        return [cpu] * count
    if cpu is not None:
        if len(cpu) != count:
            raise ValueError(f"cpu: {len(cpu)} CPUs for {count} networks; give one CPU for each")
        return list(cpu)
    allowed = sorted(os.sched_getaffinity(0))
    if count == 1 or len(allowed) <= count:
        return [None] * count
    return list(allowed[-count:])


def _have_one_clock(links: Sequence[Link]) -> bool:
    """Advance the first clock past all others. Return True if the others follow."""
    first, *others = links
    later = max(link.now() for link in links) + 1000
    first.wait_until(later, False)
    for link in others:
        link.wait_until(0, False)  # updates its clock
    return all(link.now() >= later for link in others)


def _held_cycle(one: Session, led: Session) -> int:
    """Run one cycle without targets of the application; only follow the led network.

    Returns:
        Flags of the cycle. A law can fail in a cycle that is not seen here.
    """
    if one is led:
        return one.engine.run_law(0, 0)
    flags = one.engine.run(1)
    return flags | CYCLE_LAW_FAILED if one.laws.has_failed else flags


def _stands(session: Session) -> bool:
    try:
        return session.engine.run_until_stopped(STOP_SLICE_NS)
    except (CatenaryError, OSError):
        return True  # the link failed, so that no further action is possible
