"""Import on first use of the modules of the extra `catenary[log]`."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from catenary.errors import RecordingError


def require(module: str) -> ModuleType:
    """Return a module of the extra. Raises RecordingError if its package is not installed."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise RecordingError(
            f"recordings need {package}, which is not installed",
            hint="pip install 'catenary[log]'",
        ) from error
