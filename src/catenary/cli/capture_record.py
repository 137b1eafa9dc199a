"""`catenary capture record`: keep the last minutes of the EtherCAT frames of an interface."""

from __future__ import annotations

import argparse
import json
import math
import shutil
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import positive_minutes, positive_number, positive_seconds
from catenary.cli.failure import UsageError, report
from catenary.cli.parsers import Commands, add_command, add_json
from catenary.cli.record import stopped_by_signals
from catenary.errors import CatenaryError, LinkError

if TYPE_CHECKING:
    from catenary.capture.file_ring import FileRing
    from catenary.link.passive import PassiveSocket

MINUTES = 10.0
MEGABYTES = 256
MAXIMUM_MEGABYTES = 1_000_000
CHECK = 0.2  # [s] longest wait between checks for signals
FLUSH = 1.0  # [s] a killed recorder loses at most the frames of this time
LAST_BATCHES = 64  # bound of the frames that arrived before the end
UNREADABLE = 2
EXAMPLE = """\
catenary capture record eth0
catenary capture record eth0 --minutes 30 --size 1000 -o /var/log/line.pcapng
cat line-*.pcapng | catenary capture show -"""


def add_to(group: Commands) -> None:
    parser = add_command(
        group,
        "record",
        help="keep the last minutes of the frames of an interface",
        description="Records the EtherCAT frames of an interface while any master uses it. Never "
        "sends a frame. Writes a ring of pcapng files, and deletes the oldest file. Ends on Ctrl-C "
        "or SIGTERM. Exit status 1 if frames were dropped, none arrived, or the interface was "
        "removed; 2 if the interface cannot be read or the files cannot be written.",
        example=EXAMPLE,
    )
    parser.add_argument("interface", metavar="NIC", help="network interface, such as eth0")
    parser.add_argument(
        "--minutes",
        metavar="N",
        type=positive_minutes,
        default=MINUTES,
        help=f"keep the last N minutes (default: {MINUTES:g})",
    )
    parser.add_argument(
        "--size",
        metavar="MB",
        type=positive_number,
        default=MEGABYTES,
        help=f"maximum size of all files [MB] (default: {MEGABYTES})",
    )
    parser.add_argument(
        "-o",
        dest="file",
        metavar="FILE",
        type=Path,
        help="name of the files, which get numbers (default: NIC.pcapng: NIC-000001.pcapng ...)",
    )
    parser.add_argument("--seconds", metavar="N", type=positive_seconds, help="end after N seconds")
    parser.add_argument("--force", action="store_true", help="replace an earlier recording")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Record until a signal arrives. Return 0, 1 or 2; see the help."""
    from catenary.capture.file_ring import FileRing
    from catenary.link.passive import PassiveSocket

    path = arguments.file or Path(f"{arguments.interface}.pcapng")
    check_space(path, arguments.size * 1_000_000)
    try:
        with (
            stopped_by_signals() as stop,
            PassiveSocket(arguments.interface) as link,
            FileRing(
                path,
                interface=link.name,
                duration_ns=round(arguments.minutes * 60e9),
                size=arguments.size * 1_000_000,
                force=arguments.force,
            ) as ring,
        ):
            if not arguments.json:
                print(f"recording {link.name} to {ring.files[0]} ...; press Ctrl-C to stop")
                sys.stdout.flush()
            lost = record(link, ring, stop, arguments.seconds)
    except (CatenaryError, OSError) as error:
        if isinstance(error, OSError) and error.filename is None:  # such as a full disk
            error.filename = str(path)
        report(error)
        return UNREADABLE
    return show_result(ring, lost, as_json=arguments.json)


def check_space(path: Path, size: int) -> None:
    """Raise UsageError if the path is a folder, or its folder is missing or too full.

    Args:
        path: Path of the files.
        size: Maximum size of all files [bytes].
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder, not a file", hint="-o FOLDER/NAME.pcapng")
    if not path.parent.is_dir():
        raise UsageError(f"the folder {path.parent} does not exist", hint=f"mkdir {path.parent}")
    if size > MAXIMUM_MEGABYTES * 1_000_000:
        raise UsageError(f"--size is limited to {MAXIMUM_MEGABYTES} MB")
    free = shutil.disk_usage(path.parent).free
    if size > free:
        raise UsageError(
            f"the files may need {size // 1_000_000} MB, but {path.parent} has {free // 1_000_000} "
            "MB free",
            hint="choose a smaller --size, or another disk (-o FILE)",
        )


def record(
    link: PassiveSocket, ring: FileRing, stop: threading.Event, seconds: float | None
) -> LinkError | None:
    """Write all frames until `stop` is set or the time has passed.

    Return the error if the interface was removed. The files are complete in this case, too.

    Args:
        link: Source of the frames.
        ring: Files to write.
        stop: Event that ends the recording.
        seconds: Longest time [s]; None: without limit.
    """
    now = time.monotonic()
    end, flush = math.inf if seconds is None else now + seconds, now + FLUSH
    while not stop.is_set() and now < end:
        try:
            if link.wait(min(CHECK, end - now)):
                ring.write(link.receive())
            now = time.monotonic()
            if now >= flush:
                flush = now + FLUSH
                ring.flush(link.dropped)
                link.require_interface()
        except LinkError as error:
            ring.flush(link.dropped)
            return error
    for _ in range(LAST_BATCHES):
        if not link.wait(0):
            break
        ring.write(link.receive())
    ring.flush(link.dropped)
    return None


def show_result(ring: FileRing, lost: LinkError | None, *, as_json: bool) -> int:
    """Print the files and the counts. Return the exit status.

    Args:
        ring: Written files.
        lost: Error that ended the recording; None if it was ended as requested.
        as_json: True to print JSON.
    """
    dropped = ring.dropped
    files = [str(path) for path in ring.files]
    if as_json:
        print(json.dumps({"files": files, "frames": ring.packets, "dropped": dropped}, indent=2))
    else:
        first, last = files[0], files[-1]
        names = first if first == last else f"{first} to {last}"
        print(f"{names}: {ring.packets} frames recorded, {dropped} dropped by the kernel")
    if lost is not None:
        report(lost)
        return 1
    if not ring.packets:
        print("catenary: no EtherCAT frame", file=sys.stderr)
        print("  hint: check that the master uses this interface", file=sys.stderr)
    return 1 if dropped or not ring.packets else 0
