"""`catenary report TARGET`: collect evidence of a run on real hardware in one archive."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import positive_seconds, result_file
from catenary.cli.failure import FAILED, UsageError
from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.cli.report_archive import Manifest

SECONDS = 10.0
LONGEST = 120.0  # [s]
EFFECTS = (
    "the devices are reset and brought to OP with outputs of 0; no axis is enabled; Ctrl-C ends it"
)
EXAMPLE = """\
catenary report eth0
catenary report eth0 --seconds 60 --out report.zip
catenary report --show report.zip"""


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "report",
        help="collect doctor, scan, clone, timing and a capture in one archive",
        description="Runs the checks of `catenary doctor`, a scan, a clone, a loop at 1 kHz and a "
        "capture, and writes their results into a ZIP archive that you can send "
        "(docs/reference/hardware.md). The devices are reset and brought to OP with outputs of 0. "
        "No axis is enabled. Without --zero-outputs, the loop does not run if a device has outputs "
        "other than single bits and the objects of its axes. The archive contains no user names, "
        "no host name and, without --serials, no serial numbers. A part that fails is recorded "
        "with its reason. Exit status 1 if a part is incomplete.",
        example=EXAMPLE,
    )
    parser.add_argument(
        "target",
        metavar="TARGET",
        nargs="?",
        help="eth0, virtual, machine.toml ... (see catenary --help)",
    )
    parser.add_argument("--show", metavar="FILE", type=Path, help="print a summary of an archive")
    _add_options(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--out",
        metavar="FILE",
        type=result_file,
        help="name of the archive (default: catenary-report-DATE-TIME.zip)",
    )
    parser.add_argument(
        "--seconds",
        metavar="N",
        type=report_seconds,
        default=SECONDS,
        help=f"duration of the latency test and of the loop [s] (default: {SECONDS:g})",
    )
    parser.add_argument("--no-clone", action="store_true", help="do not clone the devices")
    parser.add_argument(
        "--zero-outputs", action="store_true", help="run the loop: outputs of 0 are safe here"
    )
    parser.add_argument("--serials", action="store_true", help="keep serial numbers of devices")


def report_seconds(text: str) -> float:
    value = positive_seconds(text)
    if value > LONGEST:
        raise argparse.ArgumentTypeError(f"{text} s is more than {LONGEST:g} s")
    return value


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.report_archive import as_json, read_manifest
    from catenary.cli.report_parts import collect

    if (arguments.show is None) == (arguments.target is None):
        raise UsageError("give either a TARGET or --show FILE", hint="catenary report eth0")
    if arguments.show is not None:
        manifest = read_manifest(arguments.show)
        print(as_json(manifest) if arguments.json else as_text(manifest))
        return 0
    path = arguments.out or default_path()
    print(f"note: {arguments.target}: {EFFECTS}", file=sys.stderr)
    manifest = collect(
        arguments.target,
        path,
        seconds=arguments.seconds,
        serials=arguments.serials,
        zero_outputs=arguments.zero_outputs,
        with_clone=not arguments.no_clone,
    )
    if arguments.json:
        print(as_json(manifest))
    else:
        print(f"{as_text(manifest)}\n\nwrote {path} ({path.stat().st_size // 1000} kB)")
    bad = any(part.status in ("failed", "incomplete") for part in manifest.parts)
    return FAILED if bad else 0


def default_path() -> Path:
    """Return a path in this folder. Raises UsageError if it cannot be written."""
    try:
        return result_file(f"catenary-report-{datetime.now(UTC):%Y%m%d-%H%M%S}.zip")
    except argparse.ArgumentTypeError as error:
        raise UsageError(str(error), hint="--out FILE") from error


def as_text(manifest: Manifest) -> str:
    """Return a summary of a report. The texts of a received file are escaped."""
    from catenary.cli.tables import table
    from catenary.cli.text import escaped

    rows = [("part", "status", "time", "result")]
    for part in manifest.parts:
        rows.append((part.name, part.status, f"{part.seconds:.1f} s", part.result or part.reason))
    lines = [*_facts(manifest), "", *table(rows).splitlines()]
    lines += [f"omitted: {name}, {size} bytes" for name, size in manifest.omitted.items()]
    return "\n".join(escaped(line) for line in lines)


def _facts(manifest: Manifest) -> Iterator[str]:
    time = ", in virtual time" if manifest.virtual_time else ""
    yield f"report of {manifest.target}{time}, {manifest.date}"
    for name in ("processor", "cpus", "kernel", "distribution"):
        yield f"{name}: {manifest.machine.get(name)}"
    cards = manifest.machine.get("network_cards")
    for card in cards if isinstance(cards, list) else []:
        if isinstance(card, dict):
            yield f"network card: {_card(card)}"
    yield ", ".join(f"{name} {version}" for name, version in manifest.versions.items())


def _card(card: Mapping[str, object]) -> str:
    if "error" in card:
        return f"{card.get('name')}: {card['error']}"
    speed = card.get("speed_mbit")
    text = f"{card.get('name')}, driver {card.get('driver') or 'unknown'}"
    return text if speed is None else f"{text}, {speed} Mbit/s"
