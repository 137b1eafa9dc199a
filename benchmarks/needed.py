"""Packages that benchmarks need and Catenary does without: asked for before the work begins."""

from __future__ import annotations

from importlib.util import find_spec

from catenary.errors import CatenaryError

EXTRAS = {"pysoem": "peers", "numba": "law"}


class PackageError(CatenaryError):
    """A package is not installed here."""


def need(package: str, *, instead: str = "") -> None:
    """PackageError: it is not installed; `instead` says what goes without it."""
    if find_spec(package) is None:
        raise PackageError(
            f"the benchmark needs {package}, which is not installed",
            hint=f"pip install 'catenary[{EXTRAS[package]}]'; in a clone: make build{instead}",
        )
