"""Links and loops after a fork: the child inherits copies and must close them.

The child closes its copies of sockets, so that the kernel releases an interface when its owner
ends. It does not send, and does not wait for threads: the child has no threads of the parent. A
fork() by a C library does not run these hooks, so owners also compare process numbers.

Signals are blocked until the child has closed its copies. Otherwise an early SIGTERM would be lost,
because Python drops signals that its handlers have recorded before the fork ends.
`multiprocessing.Pool.terminate` would then wait for that child for ever.
"""

from __future__ import annotations

import os
import weakref
from typing import Protocol

from catenary.link._fork_signals import hold, release


class Inherited(Protocol):
    """An owner of something that a forked child must not use."""

    def forget(self) -> None:
        """Close the copies of the child and refuse further use. Must not raise."""
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
# Registered last: signals reach the child only after it has closed its copies
os.register_at_fork(before=hold, after_in_parent=release, after_in_child=release)
