"""`catenary dashboard`: serve the operator's page of a running loop, or of a target."""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import number
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_uid
from catenary.cli.share_target import PREFIX

if TYPE_CHECKING:
    from catenary.dashboard.security import Access

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "brave-browser", "microsoft-edge")
INTERFACES = Path("/sys/class/net")

DESCRIPTION = """\
Serves a page for browsers that shows the machine of a running loop and moves its axes
(Loop(..., sink=cat.Share(NAME, jog=True))). SHARE is the name of the share; without it, the only
existing share is used. With a TARGET or a machine file, starts a program that operates all devices
with conservative limits, and ends it with the server. Drives stay disabled until an operator
enables them. The page is not an emergency stop (ISO 13850). Needs catenary[dashboard].
docs/how_to/dashboard.md describes roles and remote access."""

EXAMPLE = """\
catenary dashboard arm
catenary dashboard virtual
catenary dashboard machine.toml
catenary dashboard arm --host 0.0.0.0 --cert cert.pem --key key.pem"""


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "dashboard",
        help="serve the operator's page for browsers",
        description=" ".join(DESCRIPTION.splitlines()),
        example=EXAMPLE,
    )
    parser.add_argument(
        "source",
        metavar="SHARE",
        nargs="?",
        help="name of a share (default: the only one), or a target: eth0, virtual, machine.toml",
    )
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on (default: this machine only)"
    )
    parser.add_argument(
        "--port", type=port, default=8710, help="TCP port (default: 8710; 0: any free one)"
    )
    parser.add_argument("--cert", type=Path, metavar="FILE", help="TLS certificate (PEM)")
    parser.add_argument(
        "--key", type=Path, metavar="FILE", help="private key of the certificate (PEM)"
    )
    parser.add_argument("--viewer-only", action="store_true", help="offer no operator role")
    parser.add_argument(
        "--new-links", action="store_true", help="make new links; previous links become invalid"
    )
    add_panels(parser)
    parser.add_argument(
        "--window", action="store_true", help="open the page in a window of Chromium"
    )
    add_uid(parser)
    parser.set_defaults(run=run)


def add_panels(parser: argparse.ArgumentParser) -> None:
    """Add the options of the 3D view and of the recordings."""
    parser.add_argument(
        "--model", type=Path, metavar="FILE", help="MJCF or URDF file for the 3D view"
    )
    parser.add_argument(
        "--joint",
        action="append",
        type=joint,
        default=[],
        metavar="AXIS=JOINT",
        help="joint of the model for an axis (default: of the same name, or in order)",
    )
    parser.add_argument(
        "--also",
        action="append",
        default=[],
        metavar="SHARE",
        help="share of a further network, for the 3D view; STOP stops its axes, too",
    )
    parser.add_argument(
        "--base",
        metavar="SHARE",
        help="share with the fields position and quaternion of the robot's base, for the 3D view",
    )
    parser.add_argument(
        "--recordings", type=Path, metavar="FOLDER", help="folder of MCAP files for the page"
    )


def port(text: str) -> int:
    value = number(text)
    if not 0 <= value <= 0xFFFF:
        raise argparse.ArgumentTypeError(f"port {text} is outside 0 to 65535")
    return value


def joint(text: str) -> tuple[str, str]:
    axis, mark, name = text.rpartition("=")
    if not (axis and mark and name):
        raise argparse.ArgumentTypeError(f"{text!r}: must be AXIS=JOINT")
    return axis, name


def run(arguments: argparse.Namespace) -> int:
    from catenary.dashboard.options import Panels
    from catenary.dashboard.server import Options, require_packages, run_server
    from catenary.operate import OperateProcess

    require_packages()
    check_paths(arguments)
    source = arguments.source or only_share(arguments.uid)
    further = [share_name("--also", each) for each in arguments.also]
    base = None if arguments.base is None else share_name("--base", arguments.base)
    check_distinct([source.removeprefix(PREFIX), *further], base)
    options = Options(
        host=arguments.host,
        port=arguments.port,
        cert=arguments.cert,
        key=arguments.key,
        viewer_only=arguments.viewer_only,
        new_links=arguments.new_links,
        uid=arguments.uid,
        panels=Panels(
            arguments.model,
            dict(arguments.joint),
            arguments.recordings,
            tuple(further),
            base,
        ),
    )
    announce = Announcer(window=arguments.window)
    with interrupted_by_sigterm():
        if not is_target(source):
            share = share_name("SHARE", source)
            for each in (share, *further, *filter(None, [base])):
                note_missing(each, arguments.uid)
            run_server(share, options, announce)
        else:
            share = f"dashboard-{os.getpid()}"
            with OperateProcess(source, share, show) as program:
                program.wait_until_ready()
                run_server(share, options, announce, program.problem)
    return 0


def check_paths(arguments: argparse.Namespace) -> None:
    """Raise UsageError for a file or folder of an option that does not exist."""
    if arguments.model is not None and not arguments.model.is_file():
        raise UsageError(f"--model: there is no file {arguments.model}")
    if arguments.base is not None and arguments.model is None:
        raise UsageError("--base needs --model: only the 3D view shows the base")
    if arguments.recordings is not None and not arguments.recordings.is_dir():
        raise UsageError(f"--recordings: there is no folder {arguments.recordings}")
    source = arguments.source or ""
    if source.endswith(".toml") and ":" not in source and not Path(source).is_file():
        raise UsageError(
            f"there is no file {source}", hint=f"create it: catenary init TARGET -o {source}"
        )


def share_name(option: str, text: str) -> str:
    """Return the name of a share without its prefix. Raises UsageError if it is invalid.

    Args:
        option: name of the option, for the error.
        text: NAME or share:NAME.
    """
    from catenary.share.folder import STATE, file_name

    name = text.removeprefix(PREFIX)
    try:
        file_name(STATE, name)
    except ValueError as error:
        raise UsageError(f"{option}: {error}") from error
    return name


def check_distinct(names: Sequence[str], base: str | None) -> None:
    """Raise UsageError if a share of axes is named twice, or is also that of the base."""
    if base in names:
        raise UsageError(
            f"--base {base}: this share has axes",
            hint="name the share with the fields position and quaternion of the robot's base",
        )
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(
            f"--also {twice}: the page already has this share",
            hint="name each network once: catenary dashboard UPPER --also LOWER",
        )


def note_missing(share: str, uid: int | None) -> None:
    """Print a note if a share does not exist, because its name may be misspelled."""
    from catenary.dashboard.source import existing_shares

    names = existing_shares(uid)
    if share not in names:
        existing = ", ".join(map(repr, names)) or "none"
        show(f"note: there is no share {share!r} yet; existing shares: {existing}")


class Announcer:
    """Printer of the links, which also opens the window.

    Args:
        window: True to open the page as a window.
    """

    def __init__(self, *, window: bool) -> None:
        self._browser = find_browser() if window else None

    def __call__(self, access: Access) -> None:
        """Print the links of a server, and open the window."""
        from catenary.dashboard.server import announcement, key_folder, link_file

        print(announcement(access, draw=sys.stdout.isatty()), flush=True)
        if self._browser is not None:
            import subprocess  # only --window needs it

            page = link_file(access, key_folder()).as_uri()
            subprocess.Popen([self._browser, f"--app={page}"], start_new_session=True)


def find_browser() -> str:
    """Return a browser based on Chromium. Raises UsageError if there is none."""
    for name in BROWSERS:
        if (path := shutil.which(name)) is not None:
            return path
    raise UsageError("--window needs Chromium", hint="install it, or open the printed link")


def is_target(source: str) -> bool:
    """Return True if a name is a target and not the name of a share."""
    from catenary.dashboard.source import existing_shares

    if source.startswith(PREFIX) or source in existing_shares():
        return False
    looks_like_one = source.endswith(".toml") or any(mark in source for mark in ":,")
    known = source in ("virtual", "virtual-realtime") or (INTERFACES / source).exists()
    return looks_like_one or known


def only_share(uid: int | None) -> str:
    """Return the name of the only share. Raises UsageError if there are none or several."""
    from catenary.dashboard.source import existing_shares

    names = existing_shares(uid)
    if len(names) == 1:
        return names[0]
    found = f"there are several: {', '.join(names)}" if names else "there is none"
    raise UsageError(
        f"SHARE is missing, and {found}",
        hint="catenary dashboard NAME, or catenary dashboard virtual to try the page",
    )


def show(text: str) -> None:
    """Print a report of the program that operates a target."""
    print(text, file=sys.stderr, flush=True)


@contextmanager
def interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM end the block like Ctrl-C, so that the program of a target ends in order."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except KeyboardInterrupt:
        return
    finally:
        signal.signal(signal.SIGTERM, before)
