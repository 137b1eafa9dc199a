"""Protocol for the exchange of a session's frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.bus import CycleClock, Pending
from catenary.core import Engine
from catenary.loop.cycle_errors import Evidence
from catenary.loop.watches.device import Attendance


class Exchange(Protocol):
    """Exchange of a session, with its own frames or an external master (`CarriedExchange`)."""

    @property
    def watch(self) -> Attendance:
        """Watch of lost and returning devices; available after `attend`."""

    def make_engine(self) -> Engine:
        """Return the engine of the session's plan."""

    def cycle_clock(self) -> CycleClock:
        """Return the view of the distributed clocks of the plan."""

    def attend(self) -> None:
        """Make the watches that run while the loop is open."""

    def bring_to_op(self) -> list[Pending[None]]:
        """Bring the devices from SAFE-OP to OP while the cycle runs; return the running watches."""

    def query_silence(self, suspects: Sequence[int]) -> Evidence:
        """Query all devices after cycles without answers from the suspected positions."""

    def query_states(self) -> Evidence:
        """Query all devices for their states."""

    def error_code(self, axis: int) -> int | str | None:
        """Return object 0x603F of an axis, or the diagnosis of a SERCOS drive as text.

        None if it cannot be read.
        """
