"""Dependencies of a law's machine code outside of its own file.

Numba's cache checks only that file. It would miss a changed gain in another file, or a changed
function of a library.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np

CONSTANTS = (bool, int, float, complex, str, bytes, tuple)


def dependencies(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the dependencies of a law's machine code, as sorted texts.

    These are the globals of the law and its callees that are constants, tuples or arrays, with
    their values. In addition, they are the time stamps and sizes of the files of these callees and
    of the modules used.
    """
    found: set[str] = set()
    waiting, seen = [function], {id(function)}
    while waiting:
        for name, value in _named(waiting.pop()):
            inner = getattr(value, "py_func", value)  # the Python function of a compiled one
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
    """Yield the globals that a function uses, and the attributes it reads from modules."""
    code: CodeType = function.__code__
    names = set(_names(code))
    modules: list[ModuleType] = []
    for name in names:
        value = function.__globals__.get(name)
        yield name, value
        if isinstance(value, ModuleType):
            modules.append(value)
    for module in modules:  # the loop appends submodules to the list
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
    """Yield the stamp of a module's file, and for a package those of its Python files."""
    for folder in getattr(module, "__path__", ()):
        yield from map(_stamp, Path(folder).glob("*.py"))
    if getattr(module, "__file__", None):
        yield _stamp(Path(str(module.__file__)))


def _stamp(path: Path) -> str:
    try:
        status = path.stat()
    except OSError:
        return f"{path}: missing"  # the source was typed at a prompt, or is in a zip file
    return f"{path}: {status.st_mtime_ns} {status.st_size}"
