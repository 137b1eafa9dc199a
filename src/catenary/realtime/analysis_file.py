"""TOML files with tasks to analyse: `[[task]]` tables with times in seconds.

[[task]]
name = "control"
period = 0.001
execution = 0.0002
priority = 90
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from catenary.errors import ConfigurationError
from catenary.realtime.analysis import Demand


class TaskTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    name: str
    period: float
    execution: float
    deadline: float | None = None
    blocking: float = 0.0
    jitter: float = 0.0
    priority: int | None = None
    cpu: int | None = None

    def demand(self) -> Demand:
        return Demand(**msgspec.structs.asdict(self))


class TaskFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    task: list[TaskTable]


def read_demands(path: str | Path) -> list[Demand]:
    """Read the tasks of a TOML file.

    Raises:
        ConfigurationError: the file is invalid; the message names the file and the cause.
        OSError: the file cannot be read.
    """
    try:
        file = msgspec.toml.decode(Path(path).read_bytes(), type=TaskFile)
        return [table.demand() for table in file.task]
    except (msgspec.MsgspecError, ValueError, ArithmeticError, RecursionError) as error:
        raise ConfigurationError(
            f"{path}: {error}",
            hint="every [[task]] has name, period and execution, and may have deadline, blocking, "
            "jitter (seconds), priority (greater is higher) and cpu",
        ) from error
