"""Services of the bridge: enable, stop, home and reset, as std_srvs/Trigger."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from catenary.errors import CatenaryError
from catenary.ros2.backend import ServiceCallback
from catenary.ros2.requests import Requests
from catenary.ros2.source import Source
from catenary.share import Reader, RequestStatus
from catenary.share.jog import State

ANSWER = 0.2  # [s] for the core of the loop to take a request
LEASE = 0.5  # [s]


class Services:
    """Callbacks of the services.

    Args:
        source: attachment to the share.
        requests: connection to the program of the loop.
        stop: ends the motion of the bridge for a reason.
        axes: returns the names of the commanded axes.
    """

    def __init__(
        self,
        source: Source,
        requests: Requests,
        stop: Callable[[str], None],
        axes: Callable[[], Sequence[str]],
    ) -> None:
        self._source, self._requests = source, requests
        self._stop_motion, self._axes = stop, axes

    @property
    def calls(self) -> Mapping[str, ServiceCallback]:
        """Callbacks by name of the service."""
        return {
            "enable": self._guarded(self.enable),
            "stop": self._guarded(self.stop),
            "home": self._guarded(self.home),
            "reset": self._guarded(self.reset),
        }

    def enable(self) -> str:
        """Request operation enabled of the commanded axes. Return the result as text."""
        return self._request("enable")

    def reset(self) -> str:
        """Reset the faults of the commanded axes."""
        return self._request("reset")

    def stop(self) -> str:
        """Stop all axes of the share with a quick stop."""
        self._stop_motion("stopped by the service")
        self._reader().stop()
        return "all axes make a quick stop; enable them again"

    def home(self) -> str:
        """Start the homing of the commanded axes."""
        self._stop_motion("homing was requested")
        axes = list(self._axes())
        self._requests.call(lambda client: client.home(axes))
        return f"homing of {', '.join(axes)} has started"

    def _request(self, state: State) -> str:
        self._stop_motion(f"{state} was requested")
        with self._reader().lease(self._axes(), for_=LEASE) as lease:
            request = lease.request(state)
            deadline = time.monotonic() + ANSWER
            while RequestStatus.PENDING in request.status and time.monotonic() < deadline:
                time.sleep(0.002)
        refused = [each for each in request.status if each is not RequestStatus.TAKEN]
        if refused:
            raise CatenaryError(f"{state}: {refused[0].text}")
        return f"{state} is requested for {', '.join(self._axes())}"

    def _reader(self) -> Reader:
        reader = self._source.reader
        if reader is None:
            raise CatenaryError(f"the share {self._source.name!r}: {self._source.reason}")
        return reader

    def _guarded(self, call: Callable[[], str]) -> ServiceCallback:
        def answer(_: bool | None) -> tuple[bool, str]:
            try:
                return True, call()
            except (CatenaryError, ValueError, RuntimeError) as error:
                return False, str(getattr(error, "message", error))

        return answer
