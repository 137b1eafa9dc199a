"""`catenary record SHARE FILE.mcap`: record every cycle of a running loop."""

from __future__ import annotations

import argparse
import json
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from catenary.cli.arguments import positive_seconds, share_name
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json, add_uid

if TYPE_CHECKING:
    from catenary.record import Recorder


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "record",
        help="record every cycle of a running loop",
        description="Records the targets, actual values, timing and events of every cycle from the "
        "share of a loop (Loop(..., sink=cat.Share(NAME))). PlotJuggler and Foxglove can open the "
        "MCAP file. The recording starts with the oldest stored cycle, and ends with the loop or "
        "on Ctrl-C. Needs catenary[log].",
        example="catenary record arm arm.mcap\n"
        "catenary record arm arm.mcap --seconds 60\n"
        "catenary record arm crash.mcap --stale\n"
        "catenary record --repair arm.mcap\n"
        "catenary plot arm.mcap",
    )
    parser.add_argument(
        "share", metavar="SHARE", type=share_name, nargs="?", help="name of the loop's share"
    )
    parser.add_argument("file", metavar="FILE.mcap", help="file to write")
    parser.add_argument("--seconds", metavar="N", type=positive_seconds, help="end after N seconds")
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    parser.add_argument(
        "--stale",
        action="store_true",
        help="record the last stored cycles of a share even if its process has died",
    )
    add_uid(parser)
    parser.add_argument(
        "--repair",
        action="store_true",
        help="repair a file whose recorder was killed; omit SHARE",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    if arguments.repair:
        return repair_file(arguments)
    if arguments.share is None:
        raise UsageError("SHARE is missing", hint="catenary record SHARE FILE.mcap; see --help")
    from catenary.record import Recorder

    with stopped_by_signals() as stop:
        options = {"force": arguments.force, "stale": arguments.stale}
        with Recorder(arguments.share, arguments.file, uid=arguments.uid, **options) as recorder:
            if not arguments.json:
                print(f"recording {recorder} to {arguments.file}; press Ctrl-C to stop", flush=True)
            recorder.run(seconds=arguments.seconds, stop=stop)
        print(as_json(recorder) if arguments.json else as_text(recorder))
    return 0


@contextmanager
def stopped_by_signals() -> Iterator[threading.Event]:
    """Yield an event that SIGINT and SIGTERM set, so that the recorder completes its file."""
    stop = threading.Event()
    kinds = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(kind, lambda *_: stop.set()) for kind in kinds]
    try:
        yield stop
    finally:
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)


def as_text(recorder: Recorder) -> str:
    lost = f"{recorder.lost} lost" if recorder.lost else "none lost"
    return f"{recorder.path}: {recorder.cycles} cycles, {lost}; {recorder.ended}"


def as_json(recorder: Recorder) -> str:
    return json.dumps(
        {
            "file": str(recorder.path),
            "cycles": recorder.cycles,
            "lost": recorder.lost,
            "ended": recorder.ended,
        },
        indent=2,
    )


def repair_file(arguments: argparse.Namespace) -> int:
    if arguments.share is not None:
        raise UsageError(
            "--repair takes only a file, without a share", hint="catenary record --repair FILE.mcap"
        )
    from catenary.record import repair

    done = repair(arguments.file)
    if arguments.json:
        print(json.dumps({"dropped": done.dropped, "seconds": done.seconds}, indent=2))
    elif done.repaired:
        print(f"{arguments.file}: repaired, {done.seconds:.3f} s; {done.dropped} bytes dropped")
    else:
        print(f"{arguments.file}: nothing to repair, {done.seconds:.3f} s")
    return 0
