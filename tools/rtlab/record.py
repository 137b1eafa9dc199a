"""Record of a run: the result and all its conditions."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from tools.rtlab import machine
from tools.rtlab.kernel import Kernel
from tools.rtlab.tables import Table

NOTE = (
    "time counts instructions: this compares software and shows schedules; "
    "it does not measure the latency of hardware"
)


def make(
    answer: Mapping[str, object], table: Table, kernel: Kernel, repository: Path, seconds: float
) -> dict[str, object]:
    return {
        "note": NOTE,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": table.shown,
        "ns_per_instruction": 2**machine.SHIFT,
        "machine": "one processor, counted instructions, no caches",
        "kernel": answer["kernel"],
        "kernel_package": kernel.package,
        "qemu": machine.version(),
        "python": platform.python_version(),
        "commit": commit(repository),
        "guest_seconds": answer["seconds"],
        "host_seconds": round(seconds, 1),
        "result": answer["result"],
    }


def commit(repository: Path) -> str:
    """Return the commit, with "+" for uncommitted changes; empty without git."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--abbrev=12"],
            cwd=repository,
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError:
        return ""
    return done.stdout.strip()
