"""`python -m benchmarks loop`: the loop compared with C programs and PySOEM."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.needed import need
from benchmarks.peers import MODULES, modules_of
from benchmarks.ratios import ratios
from catenary.bench.loop import LAW, OURS, STORM, own_names, run_setting, show
from catenary.bench.setting import Setting

BUSY = "c-busy"  # C with a busy-wait
NEEDS = {"pysoem": "pysoem", LAW: "numba", STORM: "numba"}  # packages


def measure(setting: Setting, peers: Sequence[str], file: Path | None) -> None:
    """Print the timing of every peer, and write it to `file` as JSON.

    Args:
        setting: What to measure.
        peers: Names of peers in addition to ours.
        file: File for the figures.

    Raises:
        ValueError: A peer is unknown, or the busy-wait is not less than the period.
    """
    names = peer_names(peers)
    check_busy_peer(setting.busy_wait, names)
    runs = run_setting(setting, modules_of(names))
    show(setting, runs, ratios(runs), file)


def peer_names(peers: Sequence[str]) -> list[str]:
    """Return our peers and the chosen ones.

    Raises:
        ValueError: A peer is unknown.
        PackageError: A chosen peer needs a package that is not installed.
    """
    for name in peers:
        if name not in MODULES:
            known = ", ".join(name for name in MODULES if name not in (*OURS, LAW))
            raise ValueError(f"unknown peer {name!r}; known: {known}")
        if name in NEEDS:
            need(NEEDS[name], instead=f"; or omit {name}: --peers c")
    ours = own_names()
    return [*ours, *(name for name in peers if name not in ours)]


def check_busy_peer(busy_wait: float, names: Sequence[str]) -> None:
    """Raise ValueError if `c-busy` was chosen without a busy-wait."""
    if BUSY in names and not busy_wait:
        raise ValueError(f"{BUSY} needs a busy-wait: add --busy-wait 0.00005")
