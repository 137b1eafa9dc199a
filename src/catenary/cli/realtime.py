"""`catenary realtime analyse FILE.toml`: analyse the response times of fixed-priority tasks."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from catenary.cli.failure import FAILED
from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.realtime import Verdict

EXAMPLE = """\
cat > tasks.toml <<END
[[task]]
name = "control"
period = 0.001      # [s]
execution = 0.0002
priority = 90       # greater is higher
[[task]]
name = "log"
period = 0.1
execution = 0.03
priority = 10
END
catenary realtime analyse tasks.toml"""


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "realtime",
        help="analyse tasks with deadlines",
        description="Analyses tasks with fixed priorities.",
        example="catenary realtime analyse tasks.toml",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    parser = add_command(
        group,
        "analyse",
        help="check whether all deadlines are met",
        description="Analyses the response times of tasks with fixed priorities. Each [[task]] has "
        "name, period and execution, and may have deadline, blocking, jitter (seconds), priority "
        "and cpu. Without priorities, a task with a shorter deadline has a higher priority. Exit "
        "status 1 if a task can miss its deadline.",
        example=EXAMPLE,
    )
    parser.add_argument("file", metavar="FILE.toml", help="file with the tasks")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.realtime import analyse, read_demands

    verdict = analyse(read_demands(arguments.file))
    print(as_json(verdict) if arguments.json else verdict)
    return 0 if verdict.schedulable else FAILED


def as_json(verdict: Verdict) -> str:
    """Return the verdict as JSON, with times in seconds.

    The response is null if it is unbounded. The hyperperiod is null if it is too long to compute.
    """
    import json
    from math import isfinite

    return json.dumps(
        {
            "schedulable": verdict.schedulable,
            "utilisation": verdict.utilisation,
            "hyperperiod": verdict.hyperperiod if isfinite(verdict.hyperperiod) else None,
            "tasks": [
                {
                    "name": task.name,
                    "priority": task.priority,
                    "period": task.period,
                    "execution": task.execution,
                    "deadline": task.deadline,
                    "response": task.response,
                    "response_ms": None if task.response is None else task.response * 1e3,
                    "in_time": task.in_time,
                }
                for task in verdict.responses
            ],
        },
        indent=2,
    )
