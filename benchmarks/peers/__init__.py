"""The peers of `python -m benchmarks loop`: one file each, `run(job) -> Round`."""

from __future__ import annotations

from collections.abc import Iterable

from catenary.bench import loop

MODULES = {
    **loop.MODULES,
    "catenary-inline-sdo": "benchmarks.peers.with_catenary_sdo",
    "catenary-threaded-sdo": "benchmarks.peers.with_catenary_sdo",
    "catenary-inline-shared": "benchmarks.peers.with_catenary_share",
    "catenary-threaded-shared": "benchmarks.peers.with_catenary_share",
    "catenary-inline-readers": "benchmarks.peers.with_catenary_share",
    "catenary-threaded-readers": "benchmarks.peers.with_catenary_share",
    "catenary-inline-bystanders": "benchmarks.peers.with_catenary_share",
    "catenary-threaded-bystanders": "benchmarks.peers.with_catenary_share",
    "catenary-inline-viewers": "benchmarks.peers.with_catenary_dashboard",
    "catenary-threaded-viewers": "benchmarks.peers.with_catenary_dashboard",
    "catenary-inline-others": "benchmarks.peers.with_catenary_dashboard",
    "catenary-threaded-others": "benchmarks.peers.with_catenary_dashboard",
    "catenary-inline-idle": "benchmarks.peers.with_catenary_requests",
    "catenary-threaded-idle": "benchmarks.peers.with_catenary_requests",
    "catenary-inline-requests": "benchmarks.peers.with_catenary_requests",
    "catenary-threaded-requests": "benchmarks.peers.with_catenary_requests",
    loop.STORM: loop.MODULES[loop.LAW],
    "c": "benchmarks.peers.with_c",
    "c-ring": "benchmarks.peers.with_c",
    "c-busy": "benchmarks.peers.with_c",
    "pysoem": "benchmarks.peers.with_pysoem",
}


def modules_of(names: Iterable[str]) -> dict[str, str]:
    """Return the module of each of these peers."""
    return {name: MODULES[name] for name in names}
