"""From wishes to the one MainDevice they are about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.bus import MainDevice, SubDevice
from catenary.plan.wish import Wish


class DeviceWish(Wish, Protocol):
    """A wish that knows whom it is about."""

    @property
    def subs(self) -> Sequence[SubDevice]: ...


def main_device_of(wishes: Sequence[DeviceWish]) -> MainDevice:
    """The MainDevice that all wishes share."""
    mains = {id(sub.main): sub.main for wish in wishes for sub in wish.subs}
    if not mains:
        raise ValueError("a Loop needs a wish: Drives, Inputs or Outputs")
    if len(mains) > 1:
        raise ValueError("wishes on several MainDevices in one Loop are not possible yet")
    return next(iter(mains.values()))
