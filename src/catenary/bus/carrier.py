"""Carrier: another master that exchanges the process images in our place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.procedure.exchange import Procedure
from catenary.procedure.survey import Answer


class Carrier(Protocol):
    """What a loop needs of it once it is configured. Its procedures wait, and ask for no frames."""

    @property
    def image(self) -> object:
        """A capsule "catenary.image", of this configuration."""

    def bring_to_op(self, positions: Sequence[int]) -> Procedure[None]:
        """Until these devices are in OP, cycles flowing meanwhile. StateError, IdentityError."""

    def survey(self) -> Procedure[list[Answer]]:
        """Who answers, and from which state."""

    def listen(self) -> Procedure[None]:
        """Takes what devices and cables have to say, and tells it as events: once."""
