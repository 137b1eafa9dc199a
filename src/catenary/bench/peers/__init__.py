"""The peers of `catenary bench loop`: one file each, `run(job) -> Round`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from catenary.bench.job import Job, Round

Peer = Callable[[Job], Round]

MODULES = {
    "catenary-inline": "with_catenary",
    "catenary-threaded": "with_catenary",
    "catenary-inline-sdo": "with_catenary",
    "catenary-threaded-sdo": "with_catenary",
    "catenary-inline-shared": "with_catenary_share",
    "catenary-threaded-shared": "with_catenary_share",
    "catenary-inline-readers": "with_catenary_share",
    "catenary-threaded-readers": "with_catenary_share",
    "catenary-inline-bystanders": "with_catenary_share",
    "catenary-threaded-bystanders": "with_catenary_share",
    "catenary-law": "with_catenary_law",
    "catenary-law-storm": "with_catenary_law",
    "c": "with_c",
    "c-ring": "with_c",
    "c-busy": "with_c",
    "pysoem": "with_pysoem",
}


def load(name: str) -> Peer:
    """Return the peer called `name`. Imports only its module."""
    peer: Peer = import_module(f"{__name__}.{MODULES[name]}").run
    return peer
