"""Segments in TOML files.

A file contains `[[device]]` tables in the order of the line. It can also contain `[[fault]]`
tables, and a `[plant]` table for the motors.

ring = true

[[device]]
kind = "servo"
name = "shoulder"
alias = 10
counts_per_turn = 1048576
crystal = { ppm = 40.0, jitter = 20e-9 }

[[fault]]
kind = "power_cycle"
device = 2
at = 1.5
for = 0.8
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Literal

import msgspec

from catenary.errors import CatenaryError, ConfigurationError
from catenary.virtual.device_tables import DeviceTable, located
from catenary.virtual.devices.device import Device
from catenary.virtual.faults import Fault
from catenary.virtual.joint import Joint
from catenary.virtual.plant import STEP, Plant
from catenary.virtual.segment import ClockKind, Segment
from catenary.virtual.wiring import Place


class PlantTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    model: str
    joint: tuple[Joint, ...] | None = None
    passive: tuple[str, ...] = ()
    step: float = STEP
    contacts: bool = True
    keyframe: str | None = None
    held: str | None = None

    def plant(self, path: str | Path) -> Plant:
        """Create the plant. The path of its model is relative to the folder of the file `path`."""
        return Plant(
            Path(path).parent / self.model,
            self.joint,
            passive=self.passive,
            step=self.step,
            contacts=self.contacts,
            keyframe=self.keyframe,
            held=self.held,
        )


class SegmentFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    device: tuple[DeviceTable, ...]
    plant: PlantTable | None = None
    fault: tuple[Fault, ...] = ()
    ring: bool = False
    link_loss_detection: float | Literal["enhanced", "standard"] = "enhanced"


OUT_OF_RANGE = (ArithmeticError, LookupError, ValueError, struct.error)
HINT = (
    "docs/reference/segment_file.md lists the fields of devices and plants, "
    "docs/how_to/faults.md those of faults"
)


@contextmanager
def _named(where: str) -> Iterator[None]:
    """Convert errors of constructors into a ConfigurationError that names the place in the file."""
    try:
        yield
    except OUT_OF_RANGE as error:
        raise ConfigurationError(f"{where}: {error}", hint=HINT) from error
    except CatenaryError as error:  # of an ESI, which has its own hint
        raise ConfigurationError(f"{where}: {error.message}", hint=error.hint) from error


def _device_in_fault(folder: Path, kind: type, given: Any) -> Any:
    """Create the device of `with = {kind = "servo", ...}` in a fault."""
    if kind is not Device:
        raise NotImplementedError
    try:
        return located(msgspec.convert(given, DeviceTable), folder).device()
    except (*OUT_OF_RANGE, CatenaryError) as error:
        raise ValueError(str(error)) from error  # msgspec names the place


def _read_clone(path: str | Path, *, clock: ClockKind, ring: bool) -> Segment:
    if ring:
        raise ConfigurationError(
            f"{path}: a clone cannot be a ring", hint="serve it without the second interface"
        )
    return Segment.from_clone(path, clock=clock)


def _read(path: str | Path) -> SegmentFile:
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        clone = str(path).endswith("/")
        hint = f"make a clone: catenary clone TARGET -o {path}" if clone else ""
        raise ConfigurationError(f"{path}: {error.strerror}", hint=hint) from error
    try:
        hook = partial(_device_in_fault, Path(path).parent)
        file = msgspec.toml.decode(content, type=SegmentFile, dec_hook=hook)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {error}", hint=HINT) from error
    if not file.device:
        raise ConfigurationError(f"{path}: a segment needs at least one [[device]]")
    return file


def read_segment(path: str | Path, *, clock: ClockKind = "virtual", ring: bool = False) -> Segment:
    """Read a segment and its faults from a TOML file, or the twins of a clone folder.

    Args:
        path: Path of the file, or of a folder that `catenary clone` has written.
        clock: See `Segment`.
        ring: True makes the segment a ring, regardless of the file.

    Raises:
        ConfigurationError: The file cannot be read or is invalid, or its plant cannot be simulated.
            The message names the file.
    """
    if Path(path).is_dir():
        return _read_clone(path, clock=clock, ring=ring)
    file = _read(path)
    devices = []
    for position, table in enumerate(file.device):
        with _named(f"{path}: device[{position}]"):
            devices.append(located(table, Path(path).parent).device())
    behind: dict[int, Place] = {
        position: table.behind
        for position, table in enumerate(file.device)
        if table.behind is not None
    }
    try:
        segment = Segment(
            devices,
            clock=clock,
            plant=None if file.plant is None else file.plant.plant(path),
            behind=behind,
            ring=ring or file.ring,
            link_loss_detection=file.link_loss_detection,
        )
    except OUT_OF_RANGE as error:
        raise ConfigurationError(f"{path}: {error}", hint=HINT) from error
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: plant: {error.message}", hint=error.hint) from error
    for number, fault in enumerate(file.fault):
        with _named(f"{path}: fault[{number}]"):
            segment.inject(fault)
    return segment
