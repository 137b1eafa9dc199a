"""Docstrings of compiled modules: those of `help()` are those of the stubs.

`help()` and the documentation show the .pyx; editors show the .pyi. A docstring that both have is
the same. Compiled classes with a public name have all docstrings of the stub. Module docstrings
differ: the .pyx explains how it works.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import pytest

SOURCE = Path(__file__).resolve().parent.parent / "src"
PUBLIC = {"catenary.core._iteration.Cycle"}


class Stub(NamedTuple):
    """A class or function of a stub."""

    name: str
    docstring: str | None
    compiled: Any


def stubs() -> Iterator[Stub]:
    for path in sorted(SOURCE.rglob("*.pyi")):
        module = import_module(".".join(path.relative_to(SOURCE).with_suffix("").parts))
        yield from definitions(module.__name__, module, ast.parse(path.read_text()))


def definitions(prefix: str, owner: Any, node: ast.Module | ast.ClassDef) -> Iterator[Stub]:
    for each in node.body:
        if not isinstance(each, ast.ClassDef | ast.FunctionDef):
            continue
        compiled = inspect.getattr_static(owner, each.name, None)
        if compiled is None or each.name == "__init__":
            continue  # a type for type checkers only; a constructor is described by its class
        name = f"{prefix}.{each.name}"
        yield Stub(name, ast.get_docstring(each), compiled)
        if isinstance(each, ast.ClassDef):
            yield from definitions(name, compiled, each)


def compiled_docstring(compiled: Any) -> str | None:
    own = vars(compiled).get("__doc__") if isinstance(compiled, type) else compiled.__doc__
    return inspect.cleandoc(own) if own else None


@pytest.mark.parametrize("stub", list(stubs()), ids=lambda stub: stub.name)
def test_the_docstrings_are_the_same(stub: Stub) -> None:
    compiled = compiled_docstring(stub.compiled)
    public = any(f"{stub.name}.".startswith(f"{name}.") for name in PUBLIC)
    if public or (stub.docstring and compiled):
        assert compiled == stub.docstring


def test_the_list_of_public_classes_is_complete() -> None:
    import catenary

    found = {getattr(catenary, name) for name in catenary.__all__}
    modules = [each for each in found if inspect.ismodule(each)]
    found |= {getattr(m, name) for m in modules for name in getattr(m, "__all__", ())}
    compiled = {
        f"{each.__module__}.{each.__qualname__}"
        for each in found
        if isinstance(each, type) and each.__module__.rsplit(".", 1)[-1].startswith("_")
    }
    assert compiled == PUBLIC
