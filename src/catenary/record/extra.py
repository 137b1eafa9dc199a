"""What `pip install 'catenary[log]'` brings: asked for when it is needed, and named when it is
missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from catenary.errors import RecordingError


def require(module: str) -> ModuleType:
    """The module, of a package that the extra brings."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise RecordingError(
            f"recordings need {package}, which is not installed",
            hint="pip install 'catenary[log]'",
        ) from error
