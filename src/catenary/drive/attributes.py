"""Errors for unknown attributes, so that a misspelt name cannot fail silently."""

from __future__ import annotations

from difflib import get_close_matches


def unknown_attribute(owner: object, name: str, label: str = "") -> AttributeError:
    """Return the error for an attribute that does not exist, with the nearest public name.

    Args:
        owner: object without the attribute.
        name: name of the attribute.
        label: name of the object in the message; empty for the name of its class.
    """
    kind = type(owner)
    known = [each for each in dir(kind) if not each.startswith("_")]
    near = get_close_matches(name, known, n=1)
    guess = f"; did you mean {near[0]!r}?" if near else ""
    return AttributeError(
        f"{label or kind.__name__} has no attribute {name!r}{guess}", name=name, obj=owner
    )


def check_writable(owner: object, name: str) -> None:
    """Raise AttributeError unless an attribute is private or assignable.

    Args:
        owner: object with the attribute.
        name: name of the attribute.
    """
    if name.startswith("_"):
        return
    found = getattr(type(owner), name, None)
    if isinstance(found, property):
        if found.fset is None:
            raise AttributeError(f"{type(owner).__name__}.{name} is read-only", name=name)
        return
    if hasattr(type(found), "__set__"):
        return
    if callable(found):
        raise AttributeError(
            f"{type(owner).__name__}.{name} is a method: call it, {name}(...)", name=name
        )
    raise unknown_attribute(owner, name)
