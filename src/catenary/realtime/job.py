"""Job: one release of a task."""

from __future__ import annotations

from catenary.realtime._task import Releases


class Job:
    """The current job of a task. The next job reuses the object: copy the values you keep."""

    __slots__ = ("_origin_ns", "_releases")

    def __init__(self, releases: Releases, origin_ns: int) -> None:
        self._releases = releases
        self._origin_ns = origin_ns

    @property
    def number(self) -> int:
        """Number of the job, from 0. Skipped releases are not counted, but leave gaps in `time`."""
        return self._releases.number

    @property
    def time(self) -> float:
        """Time of the release since the first release of all tasks [s]."""
        return (self._releases.release_ns - self._origin_ns) * 1e-9

    @property
    def release_ns(self) -> int:
        """Time of the release on the task's clock [ns]."""
        return self._releases.release_ns

    @property
    def jitter(self) -> float:
        """Time from the release to the start of the job [s]."""
        return (self._releases.start_ns - self._releases.release_ns) * 1e-9

    def __repr__(self) -> str:
        return f"Job(number={self.number}, time={self.time:.6f})"
