"""Job and Round: the input and the result of one peer in one round.

A peer is one of the compared programs, such as `catenary-inline`.

Both are passed in files between the benchmark's process and the worker process of a round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

Nanoseconds = npt.NDArray[np.int64]

PHASES = (
    "period",
    "lateness",
    "receive",
    "process",
    "send",
    "post_processing",
    "output_delay",
    "input_age",
)
"""Phases that each peer measures in every cycle, in this order.

For a cycle start d, a wake-up w and the time s at which the last cyclic send has returned:
period = w - w of the previous cycle; lateness = w - d; receive = w → inputs usable;
process = the body; send = its end → s; post_processing = s → start of the next wait;
output_delay = s - d; input_age = s of the frame that returned the inputs → start of the body.
In Catenary's native thread: send = w → s, receive = last frame received → inputs usable.
"""


class Body(StrEnum):
    SINE = "sine"  # one sine for all drives, written as target positions
    PD = "pd"  # a PD law for every drive, from position and velocity to torque


@dataclass(frozen=True, slots=True)
class Job:
    peer: str
    module: str  # has `run(job) -> Round`
    interface: str
    drives: tuple[int, ...]  # positions on the segment
    body: Body
    period_ns: int
    warm_up: int  # cycles before the measured ones
    cycles: int
    cpu: int | None  # processor of the loop; None for any
    priority: int | None  # SCHED_FIFO priority; None to leave it unchanged
    counts_per_turn: float
    rated_torque: float  # [N·m] of every drive
    spin: bool = False  # True to run a busy Python thread next to the loop
    storm: bool = False  # True if this thread also creates and collects garbage
    amplitude: float = 3.0  # [rad] of the sine
    stiffness: float = 0.5  # [N·m/rad] of the PD law
    damping: float = 0.02  # [N·m/(rad/s)] of the PD law
    second: str = ""  # second interface, for a ring
    busy_wait: float = 0.0  # [s] before each cycle start, in Catenary's loops and `c-busy`

    @property
    def interfaces(self) -> tuple[str, ...]:
        return (self.interface, self.second) if self.second else (self.interface,)

    @property
    def log(self) -> int:
        """Length of the log: all cycles of the round and a reserve."""
        return self.warm_up + self.cycles + 100

    @property
    def counts_per_rad(self) -> float:
        return self.counts_per_turn / math.tau

    @property
    def counts_per_torque(self) -> float:
        """Counts of 0x6071 (thousandths of the rated torque) per torque [1/(N·m)]."""
        return 1000.0 / self.rated_torque


@dataclass(frozen=True, slots=True)
class Round:
    """Result of one peer in one round."""

    samples: Nanoseconds  # (cycles, phases) [ns]; -1 if the phase did not occur in a cycle
    lost: int
    cpu_per_cycle_ns: float  # CPU time of the process (all threads, user and system) / cycles
    scheduling: str = ""
    uncommitted: int = 0  # cycles sent without fresh set-points because Python was late (threaded)
    answers: int = 0  # answers of all devices to SDO requests during the measured cycles


class _Summary(msgspec.Struct):
    lost: int
    cpu_per_cycle_ns: float
    scheduling: str
    uncommitted: int = 0
    answers: int = 0


def write_job(job: Job, path: Path) -> None:
    path.write_bytes(msgspec.json.encode(job))


def read_job(path: Path) -> Job:
    return msgspec.json.decode(path.read_bytes(), type=Job)


def write_round(result: Round, path: Path) -> None:
    summary = _Summary(
        result.lost, result.cpu_per_cycle_ns, result.scheduling, result.uncommitted, result.answers
    )
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
            summary.cpu_per_cycle_ns,
            summary.scheduling,
            summary.uncommitted,
            summary.answers,
        )
