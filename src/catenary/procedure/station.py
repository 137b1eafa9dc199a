"""The device in a procedure, checks of its replies, and deadlines."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from catenary.errors import ResponseTimeout, SegmentError
from catenary.model.device import DeviceDescription
from catenary.model.esi_settings import NO_TIMEOUTS, Timeouts
from catenary.procedure.exchange import Procedure, Reply

T = TypeVar("T")


class Station(NamedTuple):
    """One device, as named in errors. `address` is its configured station address."""

    position: int
    address: int
    name: str = ""
    timeouts: Timeouts = NO_TIMEOUTS  # of its ESI; a longer one replaces the default

    def __str__(self) -> str:
        return f"device {self.position} ({self.name})" if self.name else f"device {self.position}"


def station_of(device: DeviceDescription) -> Station:
    """Return the station of a device, with its name for errors and the timeouts of its ESI."""
    return Station(device.position, device.station_address, device.full_name, device.timeouts)


def answered(reply: Reply, station: Station, what: str) -> bytes:
    """Return the data of a reply that must come from exactly one device.

    Args:
        reply: The reply.
        station: The device.
        what: Name of the requested data, for errors.

    Raises:
        ResponseTimeout: The frame was lost, or the device did not answer.
        SegmentError: Several devices answered.
    """
    if reply.lost:
        raise ResponseTimeout(
            f"{station}: {what}: the frame did not come back",
            hint="check the cable and the power of the first device, and other traffic on the port",
        )
    if reply.working_counter == 0:
        raise ResponseTimeout(
            f"{station}: {what}: no answer from station 0x{station.address:04X} "
            "(working counter 0)",
            hint="the device was switched off, reset or unplugged: scan again",
        )
    if reply.working_counter > 1:
        raise SegmentError(
            f"{station}: {what}: {reply.working_counter} devices answer to station "
            f"0x{station.address:04X}",
            hint="a device with an old station address was added: scan again",
        )
    return reply.data


def checked_timeout(seconds: float) -> float:
    """Return a timeout [s]. Raises ValueError unless it is 0 or more, and finite."""
    if not 0 <= seconds < float("inf"):
        raise ValueError(f"timeout must be 0 or more and finite, not {seconds} s")
    return seconds


class Deadline:
    """A deadline [s], measured with the time stamps of replies. It starts at the first reply.

    The time between two replies counts for at most a quarter of the deadline. After a program was
    halted, it therefore polls a few more times before the deadline passes.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._left_ns = seconds * 1e9
        self._seen_ns: int | None = None

    def passed(self, reply: Reply) -> bool:
        """Return True if the deadline has passed at the time of a reply."""
        return self.passed_at(reply.time_ns)

    def passed_at(self, time_ns: int) -> bool:
        """Return True if the deadline has passed at a time [ns, the link's clock]."""
        if self._seen_ns is not None:
            self._left_ns -= min(time_ns - self._seen_ns, self.seconds * 1e9 / 4)
        self._seen_ns = time_ns
        return self._left_ns < 0


def within(
    seconds: float, station: Station, procedure: Procedure[T], what: str = "its description was"
) -> Procedure[T]:
    """Run a procedure with an overall deadline.

    Args:
        seconds: The deadline [s].
        station: The device, for the error.
        procedure: The procedure to run.
        what: Subject and verb of the error message, such as "its description was".

    Raises:
        ResponseTimeout: The procedure takes longer than `seconds`.
    """
    deadline = Deadline(seconds)
    try:
        step = next(procedure)
        while True:
            replies = yield step
            if replies and deadline.passed(replies[-1]):
                break
            step = procedure.send(replies)
    except StopIteration as stop:
        result: T = stop.value
        return result
    finally:
        procedure.close()
    raise ResponseTimeout(
        f"{station}: {what} not complete within {seconds:g} s",
        hint="it answers too slowly: update its firmware, or remove it from the segment",
    )


class Pace:
    """Pause between two polls [s]. It doubles after each poll, up to a maximum."""

    def __init__(self, first: float = 100e-6, longest: float = 5e-3) -> None:
        self._next = first
        self._longest = longest

    def pause(self) -> float:
        """Return the next pause [s]."""
        pause = self._next
        self._next = min(2 * pause, self._longest)
        return pause
