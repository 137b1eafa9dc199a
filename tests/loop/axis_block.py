"""Virtual block of two axes in two slots, from a real ESI. They follow their targets at once."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from catenary.virtual import DescribedDevice, TwinOptions
from catenary.virtual.devices.application import Application
from catenary.virtual.devices.described import esi_device
from catenary.virtual.scheduler import Scheduler

FILE = "hpm_ECAT_CIA402.xml"
CSP, BOTH, CSV = "csp - axis", "csv,csp - axis", 0x319800
STATES = {0x06: 0x21, 0x07: 0x23, 0x0F: 0x1027}  # statusword by controlword
STEP_NS = 500_000


class AxisBlock(DescribedDevice):
    """Two CiA 402 axes without faults and without limits."""

    def __init__(self, folder: Path, modules: Sequence[str | int | None]) -> None:
        options = TwinOptions(modules=modules, motor=None)
        super().__init__(esi_device(folder / "esi" / FILE), options=options)
        self._axes = [number for number, module in enumerate(modules) if module]

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        self._scheduler = scheduler
        self._step()

    def _step(self) -> None:
        for axis in self._axes:
            if 0x6040 + 0x800 * axis in self.application.dictionary.objects:
                self._follow(0x800 * axis)
        self._scheduler.after(STEP_NS, self._step)

    def _follow(self, offset: int) -> None:
        control = int.from_bytes(self.read_object(0x6040 + offset), "little") & 0x0F
        status = STATES.get(control, 0x40)
        self.write_object(0x6041 + offset, 0, struct.pack("<H", status))
        if status & 0x0F == 7:
            self.write_object(0x6064 + offset, 0, self.read_object(0x607A + offset))
        if offset in self._with_mode():
            self.write_object(0x6061 + offset, 0, self.read_object(0x6060 + offset))

    def _with_mode(self) -> list[int]:
        """Return the offsets of axes with 0x6061 in a PDO."""
        mapped = {entry.index for pdo in self.esi.pdos for entry in pdo.entries}
        return [0x800 * axis for axis in self._axes if 0x6061 + 0x800 * axis in mapped]


class LateBlock(AxisBlock):
    """Block whose dictionary gets the objects of its modules only when 0xF030 is written.

    Until then, no PDO is assigned, as in the sample of Beckhoff's slave stack.
    """

    def add_objects(self, application: Application) -> None:
        super().add_objects(application)
        objects = application.dictionary.objects
        kept = [i for i in objects if i < 0x1600 or 0x1C00 <= i < 0x1C10 or i >= 0xF000]
        self._hidden = {i: each for i, each in objects.items() if i not in (*kept, 0x1C12, 0x1C13)}
        for index in self._hidden:
            del objects[index]
        for table in application.pdos._assigned.values():
            table.count = 0
        count = objects[0xF030].entries[0]
        assert count.write is not None
        write = count.write

        def show(data: bytes) -> None:
            write(data)
            objects.update(self._hidden)

        objects[0xF030].entries[0] = replace(count, write=show)
