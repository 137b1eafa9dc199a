"""Clone of a segment: everything that can be read from its devices, in a folder.

    registers of all devices ─► for each device: SII, objects ─► line/ (one folder per device)

Devices in SAFE-OP, OP and BOOT are not written to: only their registers are read. Addresses and
states that are changed for the reading are restored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from catenary.bus.clone_device import DeviceClone, Progress, Source, silent
from catenary.bus.main_device import MainDevice
from catenary.bus.ring import check_direction
from catenary.errors import CatenaryError, CloneError, ConfigurationError, SegmentError
from catenary.line.reader import kept_device
from catenary.line.values import ClonedDevice, Line
from catenary.line.writer import finish, is_complete, prepare, write_device
from catenary.link import RingLink
from catenary.link.ring_state import Shape
from catenary.model.topology import Topology, make_topology, open_ports
from catenary.procedure.clone_addresses import give_address, return_address, unambiguous
from catenary.procedure.clone_registers import Present, read_present
from catenary.procedure.stations import count

OBJECTS_TIMEOUT = 600.0  # [s] per device


@dataclass(frozen=True, slots=True)
class CloneOptions:
    """Options of `clone_segment`."""

    pre_op: bool = False  # raise devices in INIT to PRE-OP, and bring them back
    serials: bool = True  # False leaves serial numbers out
    fresh: bool = False  # read devices again that the folder has
    objects_timeout: float = OBJECTS_TIMEOUT  # [s] for the object dictionary of each device


def clone_segment(
    main: MainDevice,
    folder: str | Path,
    options: CloneOptions = CloneOptions(),
    progress: Progress = silent,
) -> Line:
    """Read all devices of a segment, and write the clone folder.

    The clone of each device is written when it is complete. A device that cannot be read completely
    does not affect the others; `ClonedDevice.missing` has the reasons.

    Args:
        main: MainDevice of the segment, without a loop.
        folder: Folder of the clone. Finished devices of an interrupted clone are kept.
        options: What is read.
        progress: Function to call with (text, done, total).

    Raises:
        NoDeviceError: No device answers.
        SegmentError: The number of devices changed while they were read.
        ConfigurationError: The MainDevice has no frames of its own (IgH).
        CloneError: The folder contains other files than a clone.
        OSError: A file cannot be written.
    """
    return _read(main, Path(folder), options, progress)


def read_segment(
    main: MainDevice, options: CloneOptions = CloneOptions(), progress: Progress = silent
) -> Line:
    """Read all devices of a segment as `clone_segment` does, without a folder.

    Args:
        main: MainDevice of the segment, without a loop.
        options: What is read.
        progress: Function to call with (text, done, total).

    Raises:
        NoDeviceError: No device answers.
        SegmentError: The number of devices changed while they were read.
        ConfigurationError: The MainDevice has no frames of its own (IgH).
    """
    return _read(main, None, options, progress)


def _read(main: MainDevice, folder: Path | None, options: CloneOptions, progress: Progress) -> Line:
    main.require_no_loop()
    if main.carrier is not None:
        raise ConfigurationError(
            "the IgH kernel master does not give access to the registers of the devices",
            hint="stop it with `ethercatctl stop`, and clone the network interface: eth0",
        )
    main.runner.flush()
    device_count = main.converse(count()).devices
    ring = _require_closed(main)  # the first answers show the shape of a ring
    present = main.converse(read_present(device_count))
    where = None if folder is None else prepare(folder)
    topology = make_topology([open_ports(each.dl_status) for each in present], ring=ring)
    notes = list(topology.contradictions)
    keeps = where is not None and not (options.fresh or is_complete(where))
    with _addressed(main, present, notes) as addresses:
        devices = [
            _device(
                *(main, where, _source(each, address, topology), options, progress, notes),
                keeps=keeps,
            )
            for each, address in zip(present, addresses, strict=True)
        ]
        _require_unchanged(main, present)
    line = Line(tuple(devices), options.serials, tuple(notes))
    if where is not None:
        finish(line, where)
    return line


def _require_closed(main: MainDevice) -> bool:
    """Return True for a ring. Raise SegmentError if it is cut: positions then have two origins."""
    link = main.link
    if not isinstance(link, RingLink):
        return False
    check_direction(link.state)
    if link.state.shape in (Shape.CUT, Shape.SECOND_ONLY):
        raise SegmentError(
            "the ring is cut: a clone reads the devices in the order of the whole ring",
            hint="close the ring, or clone from one of its two interfaces",
        )
    return True


def _source(present: Present, address: int | None, topology: Topology) -> Source:
    place = topology.places[present.rank]
    return Source(present, address, place.parent, place.parent_port)


@contextmanager
def _addressed(
    main: MainDevice, devices: Sequence[Present], notes: list[str]
) -> Iterator[tuple[int | None, ...]]:
    """Yield an address per device, None for one that is not written to. Restore them at the end."""
    addresses = unambiguous(devices)
    changed: list[tuple[Present, int]] = []
    try:
        for device, address in zip(devices, addresses, strict=True):
            if address is not None and address != device.station_address:
                changed.append((device, address))  # before the write: Ctrl-C may follow it
                main.converse(give_address(device, address))
        yield addresses
    except BaseException as error:
        for note in _return_addresses(main, changed):
            error.add_note(note)
        raise
    notes += _return_addresses(main, changed)


def _return_addresses(main: MainDevice, changed: Sequence[tuple[Present, int]]) -> Iterator[str]:
    """Write back the station addresses. Yield the reasons for those that cannot be restored."""
    for device, address in changed:
        try:
            main.converse(return_address(device, address))
        except CatenaryError as error:
            text = f"device {device.rank} may keep the station address 0x{address:04X}"
            yield f"{text}: {error.message}"


def _device(
    main: MainDevice,
    folder: Path | None,
    source: Source,
    options: CloneOptions,
    progress: Progress,
    notes: list[str],
    *,
    keeps: bool,
) -> ClonedDevice:
    """Read and write one device, or keep its folder of an interrupted clone (`keeps`).

    A finished device is not replaced by the same device with missing parts.
    """
    reading = DeviceClone(
        main,
        source,
        pre_op=options.pre_op,
        serials=options.serials,
        objects_timeout=options.objects_timeout,
        progress=progress,
    )
    if folder is None:
        return reading.read()
    earlier = None if options.fresh else _earlier(folder, source.present.rank)
    if earlier is not None and keeps:
        identity = reading.identity()
        if identity is not None and reading.fits(earlier, identity):
            return earlier
    device = reading.read()
    if earlier is not None and reading.surpassed(device, earlier):
        name = f"device {device.position} ({earlier.name})"
        notes.append(f"{name}: kept from an earlier clone: {_why(device)}")
        device = replace(earlier, parent=source.parent, parent_port=source.parent_port)
    write_device(device, folder)
    return device


def _why(device: ClonedDevice) -> str:
    return "; ".join(dict.fromkeys(device.missing.values()))


def _earlier(folder: Path, position: int) -> ClonedDevice | None:
    """Return a finished device of an earlier clone; None if it cannot be read."""
    try:
        return kept_device(folder, position)
    except CloneError:  # half written, or edited: read it again
        return None


def _require_unchanged(main: MainDevice, before: Sequence[Present]) -> None:
    """Count the devices again, because a hot-plugged device changes all positions behind it.

    Raises:
        SegmentError: The number has changed.
    """
    now = main.converse(count()).devices
    if now != len(before):
        raise SegmentError(
            f"{len(before)} devices were found, and {now} after the reading",
            hint="check the cables, then clone again: finished devices are kept",
        )
