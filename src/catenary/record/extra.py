"""Modules of the extra `catenary[log]`: imported on first use; the error names a missing one."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from catenary.errors import RecordingError


def require(module: str) -> ModuleType:
    """Import a module of a package of the extra. Raises RecordingError if it is missing."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise RecordingError(
            f"recordings need {package}, which is not installed",
            hint="pip install 'catenary[log]'",
        ) from error
