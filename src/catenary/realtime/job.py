"""Job: one release of a task."""

from __future__ import annotations

from catenary.realtime._task import Releases


class Job:
    """The job that runs: one release of a task. The same object every time: note what you keep."""

    __slots__ = ("_origin_ns", "_releases")

    def __init__(self, releases: Releases, origin_ns: int) -> None:
        self._releases = releases
        self._origin_ns = origin_ns

    @property
    def number(self) -> int:
        """0 for the first job; releases that are skipped leave gaps in `time` alone."""
        return self._releases.number

    @property
    def time(self) -> float:
        """[s] of its release, since the first release of all tasks."""
        return (self._releases.release_ns - self._origin_ns) * 1e-9

    @property
    def release_ns(self) -> int:
        """Its release on the task's clock."""
        return self._releases.release_ns

    @property
    def jitter(self) -> float:
        """[s] from its release to its start."""
        return (self._releases.start_ns - self._releases.release_ns) * 1e-9

    def __repr__(self) -> str:
        return f"Job(number={self.number}, time={self.time:.6f})"
