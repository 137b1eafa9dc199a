"""Links and loops after a fork: the child gets copies, and must let go of them.

The child closes its copies of sockets, so that the kernel releases an interface with its owner.
It sends nothing and waits for no thread: the threads of the parent are not in the child. A fork()
by a C library runs no such hook: owners also compare process numbers.

Signals wait until the child has let go. Else SIGTERM in its first moments would be lost: Python
drops what its handlers have noted before the fork ends, and `multiprocessing.Pool.terminate` would
wait for that child for ever.
"""

from __future__ import annotations

import os
import weakref
from typing import Protocol

from catenary.link._fork_signals import hold, release


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
# Registered last, so that a child is ended only after it has let go
os.register_at_fork(before=hold, after_in_parent=release, after_in_child=release)
