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
import signal
import threading
import weakref
from typing import Protocol

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


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


_before = threading.local()  # the forking thread's `mask` of signals


def _hold_signals() -> None:
    _before.mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING) if _OWNERS else None


def _release_signals() -> None:
    if _before.mask is not None:
        signal.pthread_sigmask(signal.SIG_SETMASK, _before.mask)


def _forget_all() -> None:
    for owner in list(_OWNERS):
        owner.forget()
    _OWNERS.clear()
    _release_signals()


os.register_at_fork(
    before=_hold_signals, after_in_parent=_release_signals, after_in_child=_forget_all
)
