"""Import on first use of the packages of the extra `catenary[sensors]`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from catenary.errors import ConfigurationError


def require(module: str, package: str, *, extra: bool = True) -> Any:
    """Return a module of an optional package.

    Args:
        module: name of the module.
        package: name of the package for pip.
        extra: True if the extra installs it.

    Raises:
        ConfigurationError: The package is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        what = "catenary[sensors]" if extra else package
        raise ConfigurationError(
            f"this sensor needs {package}, which is not installed", hint=f"pip install '{what}'"
        ) from error
