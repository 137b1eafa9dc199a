"""Checks of a law's source for operations that the real-time thread does not allow."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

from catenary.errors import LawError


def check_source(function: Callable[..., Any]) -> None:
    """Check the source of a law. A function without source (typed at a prompt) is not checked.

    Raises:
        LawError: The law calls `print`, uses object mode, or has a `raise` or `assert` outside of a
            `try` block with a handler. The message names the first such line.
    """
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, SyntaxError):
        return
    for node, why, hint in forbidden(tree, handled=False):
        line = first + node.lineno - 1
        raise LawError(f"law {function.__name__}, {place(function, line)}: {why}", hint=hint)


def place(function: Callable[..., Any], line: int) -> str:
    """Return a line of a function's source as text: `file:line`."""
    return f"{inspect.getsourcefile(function) or '?'}:{line}"


def forbidden(tree: ast.AST, *, handled: bool) -> Iterator[tuple[ast.stmt | ast.expr, str, str]]:
    """Yield each forbidden node with the problem and a hint, in the order of the source."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Raise | ast.Assert) and not handled:
            word = "raise" if isinstance(node, ast.Raise) else "assert"
            yield (
                node,
                f"`{word}` without a handler",
                "return True to end the law, or write an error code to memory",
            )
        elif isinstance(node, ast.Call) and called(node) == "print":
            yield node, "`print` needs the GIL", "write to memory and print it from Python"
        elif isinstance(node, ast.With) and any(map(is_object_mode, node.items)):
            yield node, "object mode needs the GIL", "do that part in Python, outside the law"
        elif isinstance(node, ast.Try):
            inner = ast.Module(body=node.body, type_ignores=[])
            yield from forbidden(inner, handled=handled or bool(node.handlers))
            rest = [*node.handlers, *node.orelse, *node.finalbody]
            for part in rest:
                yield from forbidden(
                    ast.Module(body=[part], type_ignores=[]),  # type: ignore[list-item]
                    handled=handled,
                )
            continue
        yield from forbidden(node, handled=handled)


def called(node: ast.Call) -> str:
    """Return the name of the called function; empty if it has none."""
    return node.func.id if isinstance(node.func, ast.Name) else ""


def is_object_mode(item: ast.withitem) -> bool:
    """Return True if a `with` statement enters Numba's object mode."""
    expression = item.context_expr
    function = expression.func if isinstance(expression, ast.Call) else expression
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name in ("objmode", "objmode_context")
