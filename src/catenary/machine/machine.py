"""Machine, which opens the devices of a machine file and makes its drives and process data."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self

from catenary.bus import SubDevice
from catenary.bus.master import MasterSource
from catenary.drive import Copies, Drives
from catenary.drive.process_data import ProcessData
from catenary.esi.eni import is_eni
from catenary.link import LinkSource
from catenary.loop import CaptureOptions, ClockOptions, Loop, Scheduling, StopPolicy
from catenary.loop.devices import LoopRequest
from catenary.loop.laws.law import Laws
from catenary.machine.by_name import ByName
from catenary.machine.eni.machine import EniMachine
from catenary.machine.found import MachineParts
from catenary.machine.toml_machine import TomlMachine
from catenary.machine.variables import Variables
from catenary.plan.cycle import ExecutionMode
from catenary.plan.sink import Sink
from catenary.plan.trigger import Trigger
from catenary.target import MainDevice, segment_of, source_of

if TYPE_CHECKING:
    from catenary.virtual import Segment


class MachineDescription(Protocol):
    """Machine that a file describes: `TomlMachine` or `EniMachine`."""

    @property
    def name(self) -> str: ...

    def source(self) -> LinkSource: ...

    def find(self, main: MainDevice, *, passive: bool) -> MachineParts: ...

    def loop_options(self, parts: MachineParts) -> dict[str, Any]: ...


class Machine:
    """Owner of the MainDevice, drives and I/O of a machine file (docs/reference/machine_file.md).

        with cat.Machine("machine.toml") as machine:
            arm = machine.drives["arm"]
            with machine.loop() as loop:
                loop.wait(arm.move_to(0.0, velocity=0.5))

    The `with` statement opens the link and compares the identities of the devices with the file.
    This does not change any device, except with the IgH master. It then brings the devices to
    PRE-OP. At the end, it brings them to INIT. `subs`, `drives`, `process_data`, `requests` and
    `loop` raise RuntimeError while the machine is not open.

    A file with the ending ".xml" is an ENI (docs/how_to/eni.md). Its devices and their process data
    have the names of the file, and `variables` has its process image.

    Args:
        path: the machine file, or an ENI.
        target: "eth0", "virtual:line.toml", "virtual:line/" (a clone) or a `Segment`; None for the
            `target` of the file. An ENI has none.
        force: open the link even if another master is active on the interface.
        without: mailbox protocols of an ENI whose commands are left out, such as "EoE".

    Raises:
        MachineFileError: The file cannot be read, or it is not valid. The error names line and key.
            A command of an ENI cannot be run.
        ValueError: `without` is given for a machine file, or has an unknown protocol.
        ConfigurationError: `target` is not a valid name.
        TypeError: `target` is neither a name nor a link source.
    """

    def __init__(
        self,
        path: str | Path,
        target: str | LinkSource | None = None,
        *,
        force: bool = False,
        without: Sequence[str] = (),
    ) -> None:
        self._described = _read(path, [without] if isinstance(without, str) else without)
        source = self._described.source() if target is None else source_of(target)
        self._segment = segment_of(source)
        self._main = MainDevice(source, force=force)
        self._has_own_master = isinstance(source, MasterSource)
        self._found = MachineParts()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def open(self) -> Self:
        """Open the link, check the identities, and bring the devices to PRE-OP; return self.

        After an error, the machine is closed again.

        Raises:
            IdentityError: A device has another identity, or two devices have the same alias.
            SegmentError: A required device is missing.
            MachineFileError: A table requests an object or axis that its device does not have.
            CatenaryError: The link cannot be opened, or a device did not reach PRE-OP.
        """
        self._main.open()
        try:
            self._found = self._described.find(self._main, passive=not self._has_own_master)
            self._name_devices()
        except BaseException:
            self._main.close()
            raise
        return self

    def close(self) -> None:
        """Bring the devices to INIT, if possible, and close the link."""
        self._main.close()

    @property
    def main(self) -> MainDevice:
        """MainDevice of the segment."""
        return self._main

    @property
    def segment(self) -> Segment:
        """Virtual segment of the target. `segment["j2"]` is the device that the file names so.

        Raises:
            RuntimeError: The target is not a virtual segment.
        """
        if self._segment is None:
            raise RuntimeError(
                "the target of this machine is not virtual; open it with "
                'cat.Machine(..., target="virtual:FILE.toml")'
            )
        return self._segment

    @property
    def subs(self) -> ByName[SubDevice]:
        """Devices by their names in the file."""
        return self._opened.subs

    @property
    def drives(self) -> ByName[Drives]:
        """Drives of the tables [drives.NAME], by name."""
        return self._opened.drives

    @property
    def process_data(self) -> ByName[ProcessData]:
        """Process data of the tables [process_data.NAME], by name."""
        return self._opened.process_data

    @property
    def copies(self) -> Copies | None:
        """Copies of [[copy]] and [[fsoe]] whose devices are present; None if there are none."""
        return self._opened.copies

    @property
    def variables(self) -> Variables:
        """Variables in the process image of an ENI, by their full names; empty for other files."""
        return self._opened.variables

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about an ENI, commands that are not run, and differences from the plan."""
        return self._opened.notes

    @property
    def requests(self) -> tuple[LoopRequest, ...]:
        """Requests for a loop, for example for `machine.main.plan(*machine.requests)`."""
        return self._opened.requests

    def loop(
        self,
        *,
        period: float | None = None,
        execution: ExecutionMode | None = None,
        enable: bool | None = None,
        watchdog: float | None = None,
        cpu: int | None = None,
        priority: int | None = None,
        log: int | None = None,
        log_axes: bool | None = None,
        laws: Laws = (),
        sink: Sink | Sequence[Sink] | None = None,
        stop: StopPolicy | None = None,
        scheduling: Scheduling | None = None,
        clocks: ClockOptions | None = None,
        trigger: Trigger | None = None,
        capture: CaptureOptions | str | os.PathLike[str] | None = None,
        diagnosis: float | None = None,
    ) -> Loop:
        """Return a loop with all drives and process data of the machine.

        The options are those of `Loop`. An option of None has the value in the file, or else the
        default of `Loop`.

        Raises:
            MachineFileError: The machine has neither drives nor process data with present devices.
            KeyError: The device of `clocks.reference` is absent.
            RuntimeError: The machine is not open.
            ValueError: An option is not valid.
        """
        options = self._described.loop_options(self._opened)
        given = {
            "period": period,
            "execution": execution,
            "enable": enable,
            "watchdog": watchdog,
            "cpu": cpu,
            "priority": priority,
            "log": log,
            "log_axes": log_axes,
            "stop": stop,
            "scheduling": scheduling,
            "clocks": clocks,
            "capture": capture,
            "diagnosis": diagnosis,
        }
        options |= {name: value for name, value in given.items() if value is not None}
        return Loop(*self.requests, laws=laws, sink=sink, trigger=trigger, **options)

    @property
    def _opened(self) -> MachineParts:
        if not self._main.is_open:
            raise RuntimeError("the machine is not open; use it in a `with` statement")
        return self._found

    def _name_devices(self) -> None:
        """Give the devices the names of the file, for messages and for `segment["j2"]`."""
        for name, sub in self._found.subs.items():
            sub.give_name(name)
        if self._segment is not None:
            stations = {n: sub.description.station_address for n, sub in self._found.subs.items()}
            self._segment.name_devices(stations)

    def __repr__(self) -> str:
        return f"<Machine {self._described.name} on {self._main!r}>"


def _read(path: str | Path, without: Sequence[str]) -> MachineDescription:
    """Return the description in a machine file or an ENI."""
    if is_eni(path):
        return EniMachine(path, without)
    if without:
        raise ValueError(f"without={without!r}: only for an ENI (.xml)")
    return TomlMachine(path)
