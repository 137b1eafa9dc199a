"""Master: a kernel master, selected by its number."""

from __future__ import annotations

import os

from catenary.bus.master import MasterOwner
from catenary.igh._ecrt import KernelTime
from catenary.igh.kernel_master import KernelMaster
from catenary.igh.library import Library
from catenary.igh.reservation import Reservation


class Master:
    """A kernel master that is not yet reserved: the source behind `MainDevice("igh:0")`.

    Args:
        index: Number of the master, from 0.
        library: Path of libethercat; None searches for it.
        virtual_time: True if time advances only in waits. A library that simulates its devices then
            runs faster than real time.
    """

    def __init__(
        self,
        index: int = 0,
        *,
        library: str | os.PathLike[str] | None = None,
        virtual_time: bool = False,
    ) -> None:
        if index < 0:
            raise ValueError(f"master {index}: the number must be 0 or more")
        self.index = index
        self._library = library
        self._virtual_time = virtual_time

    def open_link(self) -> Reservation:
        """Reserve the master.

        Raises:
            LinkError: The master cannot be reserved. The message has the cause and the remedy.
        """
        return Reservation(Library(self._library), self.index, KernelTime(self._virtual_time))

    def make_master(self, main: MasterOwner) -> KernelMaster:
        """Return the kernel master as the `bus.Master` of a MainDevice."""
        return KernelMaster(main)
