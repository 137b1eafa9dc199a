"""Links and loops after a fork: the child gets copies, and must let go of them.

The child closes its copies of sockets, so that the kernel releases an interface with its owner.
It sends nothing and waits for no thread: the threads of the parent are not in the child. A fork()
by a C library runs no such hook: owners also compare process numbers.
"""

from __future__ import annotations

import os
import weakref
from typing import Protocol


class Inherited(Protocol):
    """An owner of something that a forked child must not use."""

    def forget(self) -> None:
        """Called in the child: close its copies and refuse further use. Must not raise."""
        ...


# A fork hook cannot be removed, so one hook serves all owners.
_OWNERS: weakref.WeakSet[Inherited] = weakref.WeakSet()


def forget_in_child(owner: Inherited) -> None:
    """Call `owner.forget()` in every child that this process forks while the owner lives."""
    _OWNERS.add(owner)


def _forget_all() -> None:
    for owner in list(_OWNERS):
        owner.forget()
    _OWNERS.clear()


os.register_at_fork(after_in_child=_forget_all)
