"""Further shares of the machine on a page: other networks of the program, and a moving base."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.dashboard.source import Source
from catenary.errors import CatenaryError, ShareError
from catenary.share import Reader


class Companions:
    """Owner of the readers of the shares that a page shows and stops with its own share.

    Args:
        also: shares of further networks.
        base: share with the pose of the robot's base; None: the base does not move.
        uid: owner of the shares; None: this user or root.
    """

    def __init__(
        self, also: Sequence[str] = (), base: str | None = None, uid: int | None = None
    ) -> None:
        self._also = [Source(name, uid=uid) for name in also]
        self._base = None if base is None else Source(base, uid=uid)

    @property
    def networks(self) -> list[Reader]:
        """Readers of the further networks that exist."""
        return [each.reader for each in self._also if each.reader is not None]

    @property
    def base(self) -> Reader | None:
        """Reader of the pose of the base; None if the share does not exist."""
        return None if self._base is None else self._base.reader

    def step(self) -> None:
        """Attach to shares that have appeared, and detach from those that have ended."""
        for each in self._all():
            each.step()

    def close(self) -> None:
        """Detach from all shares."""
        for each in self._all():
            each.close()

    def stop(self) -> list[str]:
        """Stop the axes of the further networks. Return a text for each that was not reached."""
        failures = []
        for each in self._also:
            try:
                stop(each)
            except CatenaryError as error:
                failures.append(f"{each.name!r}: {error.message}")
        return failures

    def _all(self) -> list[Source]:
        return self._also if self._base is None else [*self._also, self._base]


def stop(source: Source) -> None:
    """Stop the axes of a share. Raises ShareError if the stop does not reach its loop."""
    if source.reader is None:
        raise ShareError(source.reason)
    source.reader.stop()
