"""Fork hooks: a forked child closes its copies of links and loops.

The child closes its copies of sockets, so that the kernel releases an interface when the parent
ends. It does not send, and it does not wait for threads, because it has no copy of them. A fork()
in a C library does not run these hooks; owners therefore also compare process IDs.

Signals are blocked until the child has closed its copies. Otherwise an early SIGTERM would be lost,
because Python discards signals that it has recorded before the fork returns.
`multiprocessing.Pool.terminate` would then wait for this child forever.
"""

from __future__ import annotations

import os
import weakref
from typing import Protocol

from catenary.link._fork_signals import hold, release


class Inherited(Protocol):
    """Owner of a resource that a forked child must not use."""

    def forget(self) -> None:
        """Close the copies in the child and refuse further use. Must not raise."""
        ...


# A fork hook cannot be removed, so all owners share one hook.
_OWNERS: weakref.WeakSet[Inherited] = weakref.WeakSet()


def forget_in_child(owner: Inherited) -> None:
    """Call `owner.forget()` in every child that this process forks while the owner exists."""
    _OWNERS.add(owner)


def _forget_all() -> None:
    for owner in list(_OWNERS):
        owner.forget()
    _OWNERS.clear()


os.register_at_fork(after_in_child=_forget_all)
# Registered last: signals reach the child only after it has closed its copies
os.register_at_fork(before=hold, after_in_parent=release, after_in_child=release)
