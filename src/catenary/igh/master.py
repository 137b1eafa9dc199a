"""Master: a kernel master by its number."""

from __future__ import annotations

import os

from catenary.bus.master import MasterOwner
from catenary.igh._ecrt import KernelTime
from catenary.igh.kernel_master import KernelMaster
from catenary.igh.library import Library
from catenary.igh.reservation import Reservation


class Master:
    """A kernel master, not yet reserved: what `MainDevice("igh:0")` opens.

    `library`: path of libethercat; None: found. `virtual_time`: time passes only where it is
    waited for, so that a library that simulates its devices runs faster than life.
    """

    def __init__(
        self,
        index: int = 0,
        *,
        library: str | os.PathLike[str] | None = None,
        virtual_time: bool = False,
    ) -> None:
        if index < 0:
            raise ValueError(f"master {index}: they are counted from 0")
        self.index = index
        self._library = library
        self._virtual_time = virtual_time

    def open_link(self) -> Reservation:
        """Reserves the master. LinkError says what is in the way, and how to mend it."""
        return Reservation(Library(self._library), self.index, KernelTime(self._virtual_time))

    def make_master(self, main: MasterOwner) -> KernelMaster:
        """Return what brings the devices of a MainDevice up and down."""
        return KernelMaster(main)
