"""How a session exchanges its frames."""

from __future__ import annotations

from typing import Protocol

from catenary.bus import CycleClock, Pending
from catenary.core import Engine
from catenary.errors import CatenaryError
from catenary.loop.device_watch import Attendance


class Exchange(Protocol):
    """Frames of our own (`FrameExchange`), or another master's (`CarriedExchange`)."""

    @property
    def watch(self) -> Attendance:
        """The watch over lost and returning devices; after `attend`."""

    def make_engine(self) -> Engine:
        """Return the engine of the session's plan."""

    def cycle_clock(self) -> CycleClock:
        """Return what the cycle knows of the distributed clocks of the plan."""

    def attend(self) -> None:
        """Make the watches that run while the loop is open."""

    def bring_to_op(self) -> list[Pending[None]]:
        """Bring the devices from SAFE-OP to OP while cycles flow; return the watches that run."""

    def silence_error(self) -> CatenaryError:
        """Return the error for cycles without answers, after asking the devices."""

    def raise_astray(self) -> None:
        """Raise StateError if a required device is out of OP."""

    def error_code(self, axis: int) -> int | None:
        """Return object 0x603F of an axis; None if the drive does not answer."""
