"""Carrier: another master that exchanges the process images in our place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.procedure.al_status_poll import Answer
from catenary.procedure.exchange import Procedure


class CycleClock(Protocol):
    """What a cycle knows of distributed clocks: `core.Clock`, or another master's."""

    def figures(self) -> dict[str, float]:
        """Times in ns: see `core.Clock`."""

    def differences(self) -> list[tuple[float, int, int, int]]:
        """Per follower: mean, last, largest magnitude [ns], reads."""

    def keep_within(self, bound_ns: int) -> None:
        """The bound of differences and phase from now on."""

    def reset_figures(self) -> None:
        """Forgets the largest magnitudes."""

    @property
    def changes(self) -> int:
        """How often the clocks came together or apart."""


class Carrier(Protocol):
    """What a loop needs of it once it is configured. Its procedures wait, and ask for no frames."""

    @property
    def image(self) -> object:
        """A capsule "catenary.image", of this configuration."""

    @property
    def clock(self) -> CycleClock | None:
        """What it knows of the clocks; None: there are none in this configuration."""

    def bring_to_op(self, positions: Sequence[int]) -> Procedure[None]:
        """Until these devices are in OP, cycles flowing meanwhile. StateError, IdentityError."""

    def survey(self) -> Procedure[list[Answer]]:
        """Who answers, and from which state."""

    def listen(self) -> Procedure[None]:
        """Takes what devices and cables have to say, and tells it as events: once."""
