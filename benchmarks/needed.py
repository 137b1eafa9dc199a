"""Packages that benchmarks need and Catenary does not, checked before a benchmark starts."""

from __future__ import annotations

from importlib.util import find_spec

from catenary.errors import CatenaryError

EXTRAS = {"pysoem": "peers", "numba": "law", "cyclonedds": "ros2"}


class PackageError(CatenaryError):
    """Error if a package is not installed."""


def need(package: str, *, instead: str = "") -> None:
    """Check that a package is installed.

    Args:
        package: Name of the package.
        instead: Alternative, as the end of the hint.

    Raises:
        PackageError: The package is not installed.
    """
    if find_spec(package) is None:
        raise PackageError(
            f"the benchmark needs {package}, which is not installed",
            hint=f"pip install 'catenary[{EXTRAS[package]}]'; in a clone: make build{instead}",
        )
