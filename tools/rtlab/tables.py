"""Tables of the lab: commands of `python -m benchmarks`, each in a separate guest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tools.rtlab import gpio, igh
from tools.rtlab.errors import LabError

RESULT = "FILE"  # placeholder for the path of the result


@dataclass(frozen=True, slots=True)
class Table:
    command: str  # command of `python -m benchmarks`; it supports --json
    minutes: float  # limit of the host's time
    help: str
    of_all: bool = True  # True if "all" runs it
    # Limit of real-time tasks, [us] per second; -1 for none. With a limit, a table that overloads
    # the processor ends, and each context switch takes 0.4 us longer.
    real_time_us: int = -1
    program: str = ""  # of the guest, instead of the benchmarks

    @property
    def shown(self) -> str:
        """The command as readable text."""
        return f"{self.program or 'python -m benchmarks'} {self.command}".rstrip()

    @property
    def arguments(self) -> list[str]:
        return [*self.command.split(), "--json", RESULT]


TABLES: Mapping[str, Table] = {
    "quick": Table(
        "loop --seconds 2 --rounds 1 --peers c",
        10,
        "two seconds of the loop beside C: shows that the lab works",
        of_all=False,
    ),
    "loop": Table(
        "loop --seconds 5 --rounds 1 --peers c,c-ring,pysoem",
        90,
        "the loop beside C and PySOEM, three drives at 1 kHz",
    ),
    "pyigh": Table(
        "table pyigh --seconds 60 --rounds 8",
        90,
        "in-controller delay: C, PySOEM and ours, three drives at 1 kHz",
    ),
    "pyigh-busy": Table(
        "table pyigh --seconds 5 --rounds 1 --busy-wait 0.00005",
        30,
        "the same with a busy-wait of 50 us before each cycle start",
    ),
    "tasks": Table(
        "table tasks --seconds 4",
        60,
        "three spinning tasks beside their analysis",
    ),
    "tocabi": Table(
        "table tocabi --seconds 1 --rounds 1 --peers law --rates 4000,5000,6250",
        45,
        "33 axes on two networks by laws, 4 to 6.25 kHz",
        real_time_us=950_000,  # the kernel's own
    ),
    "tocabi-60": Table(
        "table tocabi --seconds 60 --rounds 1 --peers law --rates 4000",
        90,
        "33 axes on two networks by laws at 4 kHz for 60 s: none skipped, none lost",
        of_all=False,
        real_time_us=950_000,
    ),
    "tocabi-8k": Table(
        "table tocabi --seconds 5 --rounds 1 --peers law --rates 8000 --axes 3,3",
        45,
        "6 axes on two networks by laws at 8 kHz for 5 s",
        of_all=False,
        real_time_us=950_000,
    ),
    "humanoid": Table(
        "table humanoid_tasks --seconds 2 --rates 1000,2000,4000",
        120,
        "33 axes on two networks of one loop, beside stand-ins of a humanoid's tasks",
        of_all=False,
        real_time_us=950_000,
    ),
    "cobot": Table(
        "table cobot --realtime --short --stretch 5",
        60,
        "six tasks of a cobot beside their analysis",
    ),
    "rteml": Table("table rteml", 60, "intervals of frames in a capture at 5 kHz"),
    "rdda": Table("table rdda", 60, "a gripper with two drives at 2 kHz, idle and under load"),
    "skew": Table("table skew", 30, "two digital outputs at both ends of the line"),
    "interrupt": Table("table interrupt", 60, "reaction of a waiting task to an event"),
    "law": Table("law", 20, "what one call of a compiled law takes"),
    "igh": Table(
        "",
        60,
        "loops over the IgH kernel master at 1 and 4 kHz; IGH=path: a build of it",
        program=f"{igh.FOLDER}/{igh.TABLE}",
    ),
    "gpio": Table(
        "",
        15,
        "reaction to an edge of the kernel's GPIO simulator; GPIO=path: its modules",
        program=f"{gpio.FOLDER}/{gpio.TABLE}",
    ),
}


def choose(names: Sequence[str]) -> dict[str, Table]:
    """Return the chosen tables. A name may be a list with commas, or "all".

    Raises:
        LabError: A table does not exist.
    """
    chosen: dict[str, Table] = {}
    for name in ",".join(names).split(","):
        if name == "all":
            chosen.update({each: table for each, table in TABLES.items() if table.of_all})
        elif name in TABLES:
            chosen[name] = TABLES[name]
        else:
            raise LabError(f"unknown table {name!r}; known tables: {', '.join(TABLES)}, all")
    return chosen
