"""Fault reset of SERCOS drives while a loop runs: the procedure command S-0-0099."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from catenary.drive.axis import Axis
from catenary.procedure.sercos_fault import RESET_CLASS_1

if TYPE_CHECKING:
    from catenary.bus import Pending, SubDevice


class SercosResets:
    """Owner of the reset commands that have not ended. An axis has at most one.

    The control word S-0-0134 has no bit for a reset. The state of the axis shows the result: a
    drive that refuses the command remains in fault.
    """

    def __init__(self) -> None:
        self._pending: dict[str, Pending[None]] = {}

    def request(self, axes: Iterable[tuple[SubDevice, Axis]]) -> None:
        """Start to reset axes in fault. CiA 402 axes are ignored.

        Args:
            axes: Device and axis of each.
        """
        for sub, axis in axes:
            before = self._pending.get(axis.name)
            if axis.sercos is None or (before is not None and not before.done):
                continue
            self._pending[axis.name] = sub.soe.request_command(RESET_CLASS_1, drive=axis.slot)
