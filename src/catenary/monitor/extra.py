"""Import on first use of the packages of the extras `catenary[top]` and `catenary[foxglove]`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from catenary.errors import ConfigurationError


def require(module: str, extra: str) -> Any:
    """Return a module of an optional package.

    Args:
        module: name of the module.
        extra: extra of Catenary that installs it.

    Raises:
        ConfigurationError: The package is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise ConfigurationError(
            f"this command needs {module.partition('.')[0]}, which is not installed",
            hint=f"pip install 'catenary[{extra}]'",
        ) from error
