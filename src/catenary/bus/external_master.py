"""Interface to an external master, which exchanges the process images for a loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.procedure.al_status_poll import Answer
from catenary.procedure.exchange import Procedure


class CycleClock(Protocol):
    """Interface to the distributed clocks of a cycle; `core.Clock` implements it."""

    def figures(self) -> dict[str, float]:
        """Return the clock figures [ns], with the keys of `core.Clock.figures`."""

    def differences(self) -> list[tuple[float, int, int, int]]:
        """Return the time differences of each follower.

        The values are mean, last, largest magnitude [ns] and number of reads.
        """

    def keep_within(self, bound_ns: int) -> None:
        """Set the bound for the differences and the phase [ns]."""

    def reset_figures(self) -> None:
        """Set the largest magnitudes to zero."""

    @property
    def changes(self) -> int:
        """Number of changes between locked and unlocked."""


class Carrier(Protocol):
    """Interface of a configured external master to a loop.

    Its procedures wait, but request no frames.
    """

    @property
    def image(self) -> object:
        """Capsule "catenary.image" of this configuration."""

    @property
    def clock(self) -> CycleClock | None:
        """Distributed clocks of the configuration; None if it does not use them."""

    def bring_to_op(self, positions: Sequence[int]) -> Procedure[None]:
        """Wait until these devices are in OP. Cycles must run during the wait.

        Raises:
            StateError: A device does not reach OP.
            IdentityError: A device is not the planned one.
        """

    def survey(self) -> Procedure[list[Answer]]:
        """Return the answers of all devices, with their states."""

    def listen(self) -> Procedure[None]:
        """Fetch the pending reports of devices and cables, and put them as events."""
