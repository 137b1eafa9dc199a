"""Examination: all checks in the order of the report, from the kernel to the measured latency."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from catenary.doctor import clocks, interrupts, kernel, network, permissions, processors, ptp
from catenary.doctor.card import Card
from catenary.doctor.change import Change
from catenary.doctor.check import Check, skipped
from catenary.doctor.clock_state import read_clock_state
from catenary.doctor.ethtool import read_card
from catenary.doctor.latency import Latency, judge, measure
from catenary.doctor.machine import Machine
from catenary.doctor.ptp_state import read_ptp_state
from catenary.errors import LinkError

GROUPS: tuple[tuple[str, Sequence[Callable[[Machine], Check]]], ...] = (
    ("kernel", kernel.CHECKS),
    ("processors", processors.CHECKS),
    ("clocks", (*clocks.CHECKS, ptp.daemons)),
    ("permissions", permissions.CHECKS),
)
CARD_CHECKS = (*network.CHECKS, *interrupts.CHECKS)
CARD_PREFIX = "nic-"  # of the checks whose changes affect the card


@dataclass(frozen=True, slots=True)
class Examination:
    """Results of all checks, in titled groups. `latency` is None if it was not measured."""

    groups: tuple[tuple[str, tuple[Check, ...]], ...]
    latency: Latency | None = None

    @property
    def checks(self) -> tuple[Check, ...]:
        """Checks of all groups, in the order of the report."""
        return tuple(check for _, checks in self.groups for check in checks)

    @property
    def failed(self) -> bool:
        """True if a check has the status FAIL."""
        return any(check.status == "FAIL" for check in self.checks)

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes that `--apply` may make; none to a port with the default route."""
        in_use = any(check.id == "nic-use" and check.status == "FAIL" for check in self.checks)
        return tuple(
            change
            for check in self.checks
            for change in check.changes
            if not (in_use and check.id.startswith(CARD_PREFIX))
        )


def examine(machine: Machine, latency: Latency | None = None) -> Examination:
    """Run all checks on a machine.

    Args:
        machine: Machine to check.
        latency: Latency measured on it; None if it was not measured.
    """
    groups = [(title, tuple(check(machine) for check in checks)) for title, checks in GROUPS]
    if ptp.uses_ptp(machine):
        groups.append(("time of several machines", tuple(check(machine) for check in ptp.CHECKS)))
    card = machine.card
    if card is None:
        groups.append(("network card", (no_card(machine),)))
    else:
        checks = tuple(check(machine, card) for check in CARD_CHECKS)
        groups.append((f"network card {card.name}", checks))
    groups.append(("latency", (judge(latency, machine),)))
    return Examination(tuple(groups), latency)


def no_card(machine: Machine) -> Check:
    names = [path.rpartition("/")[2] for path in machine.matching("/sys/class/net/*")]
    cards = [name for name in names if machine.exists(f"/sys/class/net/{name}/device")]
    found = f"this machine has {', '.join(cards)}" if cards else "this machine has no card"
    return skipped("nic", f"no card was given; {found}", "catenary doctor NIC")


def watch(machine: Machine, seconds: float, *, cpu: int | None) -> tuple[Machine, Latency]:
    """Measure the wake-up latency, and count the frames that the card sends during this time.

    Args:
        machine: the machine to measure.
        seconds: duration [s].
        cpu: processor of the measuring thread; None for any.

    Returns:
        The machine with `watched` and `sent` set, and the latency.
    """
    before = machine.frames_sent()
    latency = measure(seconds, period=machine.period, priority=machine.priority, cpu=cpu)
    after = machine.frames_sent()
    sent = None if before is None or after is None else after - before
    return replace(machine, watched=seconds, sent=sent), latency


def this_machine(
    nic: str | None, *, cpu: int | None = None, period: float = 1e-3, priority: int = 80
) -> Machine:
    """Return this machine, with the settings that the checks need.

    Args:
        nic: network interface; None to check no card.
        cpu: processor of the loop; None for an isolated CPU, or the last CPU if none is isolated.
        period: period of the loop [s].
        priority: SCHED_FIFO priority of the loop's thread.

    Raises:
        LinkError: the network interface does not exist.
        ValueError: the CPU does not exist.
    """
    card = None if nic is None else known_card(nic)
    machine = Machine(
        root=Path("/"),
        card=card,
        clock=read_clock_state(),
        ptp=read_ptp_state(),
        wanted_cpu=cpu,
        period=period,
        priority=priority,
    )
    if cpu is not None and cpu not in machine.cpus:
        online = ", ".join(map(str, sorted(machine.cpus)))
        raise ValueError(f"CPU {cpu} does not exist or is offline; online CPUs: {online}")
    return machine


def known_card(nic: str) -> Card:
    names = [name for _, name in socket.if_nameindex()]
    if nic not in names:
        raise LinkError(
            f"there is no network interface {nic!r}", hint=f"use one of {', '.join(names)}"
        )
    return read_card(nic)
