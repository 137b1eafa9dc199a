"""What one round of a benchmark is asked to do, and what it answers: values that travel between the
process that leads the benchmark and the worker that runs one peer once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

Nanoseconds = npt.NDArray[np.int64]

PHASES = ("period", "lateness", "receive", "process", "send", "tail")
"""What is measured of every cycle, in this order. Woken at instant w, planned for d:
period = w - w of the cycle before; lateness = w - d; receive = w → inputs usable;
process = the user's body; send = its end → the cyclic send returned; tail = → the next wait."""


class Body(StrEnum):
    SINE = "sine"  # one sine for all drives, written as target positions
    PD = "pd"  # a PD law on every drive: position and velocity in, torque out


@dataclass(frozen=True, slots=True)
class Job:
    peer: str
    interface: str
    drives: tuple[int, ...]  # positions on the segment
    body: Body
    period_ns: int
    warm_up: int  # cycles that run first and are not measured
    cycles: int
    cpu: int | None  # of the loop; None: left to the system
    priority: int | None  # SCHED_FIFO; None: left to the system
    counts_per_turn: float
    rated_torque: float  # of every drive [N·m]
    spin: bool = False  # a Python thread spins beside the loop
    storm: bool = False  # and makes garbage that is collected again and again
    amplitude: float = 3.0  # of the sine [rad]
    stiffness: float = 0.5  # PD [N·m/rad]
    damping: float = 0.02  # PD [N·m/(rad/s)]
    second: str = ""  # interface of a ring's other end
    busy_wait: float = 0.0  # [s] of our loops before each cycle start

    @property
    def interfaces(self) -> tuple[str, ...]:
        return (self.interface, self.second) if self.second else (self.interface,)

    @property
    def log(self) -> int:
        """Cycles that a loop is to remember: those of the round, and what follows them."""
        return self.warm_up + self.cycles + 100

    @property
    def counts_per_rad(self) -> float:
        return self.counts_per_turn / math.tau

    @property
    def counts_per_torque(self) -> float:
        """0x6071 counts thousandths of the rated torque [1/(N·m)]."""
        return 1000.0 / self.rated_torque


@dataclass(frozen=True, slots=True)
class Round:
    """What one peer measured in one round."""

    samples: Nanoseconds  # (cycles, phases) [ns]; -1: did not occur in that cycle
    lost: int
    cpu_ns: int  # processor time of the whole process over the measured cycles
    scheduling: str = ""
    late: int = 0  # cycles in which Python was late and the bus went on; threaded only
    answers: int = 0  # to SDOs, from all devices, over the measured cycles


class _Summary(msgspec.Struct):
    lost: int
    cpu_ns: int
    scheduling: str
    late: int = 0
    answers: int = 0


def write_job(job: Job, path: Path) -> None:
    path.write_bytes(msgspec.json.encode(job))


def read_job(path: Path) -> Job:
    return msgspec.json.decode(path.read_bytes(), type=Job)


def write_round(result: Round, path: Path) -> None:
    summary = _Summary(result.lost, result.cpu_ns, result.scheduling, result.late, result.answers)
    np.savez(
        path,
        samples=result.samples,
        summary=np.frombuffer(msgspec.json.encode(summary), np.uint8),
    )


def read_round(path: Path) -> Round:
    with np.load(path) as file:
        summary = msgspec.json.decode(file["summary"].tobytes(), type=_Summary)
        return Round(
            file["samples"],
            summary.lost,
            summary.cpu_ns,
            summary.scheduling,
            summary.late,
            summary.answers,
        )
