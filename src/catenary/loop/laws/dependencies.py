"""What a law's machine code depends on beside its own file. Numba's cache looks at that file alone:
a gain in another one, or a function of a library that has changed, would run as it was before."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np

CONSTANTS = (bool, int, float, complex, str, bytes, tuple)


def dependencies(function: Callable[..., Any]) -> tuple[str, ...]:
    """The values of the globals that a law and the functions it calls name, and the stamps of the
    files these functions and modules are in: equal only where all of it is."""
    found: set[str] = set()
    waiting, seen = [function], {id(function)}
    while waiting:
        for name, value in _named(waiting.pop()):
            inner = getattr(value, "py_func", value)  # Numba's own functions
            if isinstance(value, ModuleType):
                found.update(_stamps(value))
            elif isinstance(value, CONSTANTS):
                found.add(f"{name} = {value!r}")
            elif isinstance(value, np.ndarray):
                found.add(f"{name} = {value.dtype} {value.shape} {value.tobytes().hex()}")
            elif isinstance(getattr(inner, "__code__", None), CodeType) and id(inner) not in seen:
                seen.add(id(inner))
                waiting.append(inner)
                found.add(_stamp(Path(inner.__code__.co_filename)))
    return tuple(sorted(found))


def _named(function: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """What the names in a function's code stand for: globals, and what is asked of modules."""
    code: CodeType = function.__code__
    names = set(_names(code))
    modules: list[ModuleType] = []
    for name in names:
        value = function.__globals__.get(name)
        yield name, value
        if isinstance(value, ModuleType):
            modules.append(value)
    for module in modules:  # grows: a module's modules
        for name in names:
            value = getattr(module, name, None)
            if isinstance(value, ModuleType) and value not in modules:
                modules.append(value)
            yield f"{module.__name__}.{name}", value


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _stamps(module: ModuleType) -> Iterator[str]:
    """Of its file; of a package, of all files in its folder."""
    for folder in getattr(module, "__path__", ()):
        yield from map(_stamp, Path(folder).glob("*.py"))
    if getattr(module, "__file__", None):
        yield _stamp(Path(str(module.__file__)))


def _stamp(path: Path) -> str:
    try:
        status = path.stat()
    except OSError:
        return f"{path}: not there"  # typed at a prompt, or in a zip
    return f"{path}: {status.st_mtime_ns} {status.st_size}"
