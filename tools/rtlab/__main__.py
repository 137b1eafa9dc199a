"""`make rtlab`: benchmarks on Debian's PREEMPT_RT kernel, in a machine that counts instructions.

    python -m tools.rtlab [TABLE ...]     from the repository's root, with the interpreter of .venv
    python -m tools.rtlab --compare A B   largest difference of medians between two runs

The same software gives the same figures, independent of the load of this machine. The lab compares
software and shows schedules. It does not measure the latency of hardware
(docs/explanation/benchmarks.md, "rtlab").
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from catenary.errors import CatenaryError
from tools.rtlab import compare, gpio, igh, image, kernel, machine, record, tables
from tools.rtlab.archive import Entry
from tools.rtlab.errors import LabError

REPOSITORY = Path(__file__).resolve().parents[2]
WORK = REPOSITORY / "build" / "rtlab"


def main(arguments: Sequence[str]) -> int:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # runs every `finally`
    try:
        asked = parse(arguments)
        if asked.compare:
            print(compare.compare(*asked.compare))
        else:
            run(asked)
    except (LabError, CatenaryError) as error:
        return fail(" ".join(str(error).split()))
    except OSError as error:
        return fail(in_one_line(error))
    except KeyboardInterrupt:
        return fail("interrupted; nothing is left running", 130)
    return 0


def fail(why: str, status: int = 1) -> int:
    print(f"rtlab: {why}", file=sys.stderr)
    return status


def in_one_line(error: OSError) -> str:
    where = f" ({error.filename})" if error.filename else ""
    if error.errno == errno.ENOSPC:
        return f"the disk is full{where}: the lab needs about 1.5 GB in {WORK} and {cache()}"
    return f"{error.strerror or error}{where}"


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    known = "\n".join(f"  {name:12}{table.help}" for name, table in tables.TABLES.items())
    others = ", ".join(name for name, table in tables.TABLES.items() if not table.of_all)
    parser = argparse.ArgumentParser(
        prog="python -m tools.rtlab",
        description=f"tables:\n{known}\n  all         all except {others}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("tables", nargs="*", default=["all"], metavar="TABLE")
    parser.add_argument("--out", type=Path, default=WORK / "results", help="folder of the results")
    parser.add_argument(
        "--options", default="", metavar="'...'", help="more options of the command"
    )
    parser.add_argument(
        "--compare", nargs=2, type=Path, metavar=("A", "B"), help="compare the medians of two runs"
    )
    parser.add_argument(
        "--igh", type=Path, metavar="FOLDER", help="a build of the IgH master, for its table"
    )
    parser.add_argument(
        "--gpio", type=Path, metavar="FOLDER", help="modules of a GPIO simulator, for its table"
    )
    parser.add_argument("--minutes", type=float, help="time limit of a table (default: its own)")
    return parser.parse_args(arguments)


def cache() -> Path:
    top = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(top, "catenary", "rtlab")


def run(arguments: argparse.Namespace) -> None:
    chosen = tables.choose(arguments.tables)
    machine.program()  # fails before anything is downloaded
    for folder in (cache(), WORK, arguments.out):
        folder.mkdir(parents=True, exist_ok=True)
    system = kernel.provide(cache())
    built = additions(arguments, system, chosen)
    if not chosen:
        return
    root = image.provide(system, REPOSITORY, WORK, built)
    for name, table in chosen.items():
        table = replace(table, command=f"{table.command} {arguments.options}".rstrip())
        found = run_table(name, table, system, root, arguments.minutes)
        file = arguments.out / f"rtlab-{name}.json"
        file.write_text(json.dumps(found, indent=1) + "\n")
        print(f"wrote {file}", flush=True)


def additions(
    arguments: argparse.Namespace, system: kernel.Kernel, chosen: dict[str, tables.Table]
) -> list[Entry]:
    """Return the files that some tables need in the guest, or skip a table with a message."""
    entries = []
    for name, provide in (("igh", igh.provide), ("gpio", gpio.provide)):
        if name not in chosen:
            continue
        try:
            entries += provide(getattr(arguments, name), system)
        except igh.NotThere as reason:
            print(f"rtlab: {name}: skipped: {reason}", flush=True)
            del chosen[name]
    return entries


def run_table(
    name: str, table: tables.Table, system: kernel.Kernel, root: Path, minutes: float | None
) -> dict[str, object]:
    """Run a table in a guest, and return the record.

    Raises:
        LabError: The guest failed.
    """
    print(f"rtlab: {name}: {table.shown}", flush=True)
    command = [*program(table), *table.arguments]
    job = {
        "folder": str(REPOSITORY),
        "name": name,
        "arguments": command,
        "real_time_us": table.real_time_us,
    }
    deadline = (minutes or table.minutes) * 60
    with machine.started(system, root, job, WORK, deadline) as guest:
        for text in guest.lines():
            print(text, flush=True)
        answer = guest.answer()
    return record.make(answer, table, system, REPOSITORY, guest.seconds)


def program(table: tables.Table) -> list[str]:
    if table.program:
        return [sys.executable, table.program]
    return [sys.executable, "-m", "benchmarks"]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
