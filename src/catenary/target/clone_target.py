"""`catenary.clone`: a clone of a segment by its name."""

from __future__ import annotations

from pathlib import Path

from catenary.bus.clone import OBJECTS_TIMEOUT, CloneOptions, clone_segment
from catenary.bus.clone_device import Progress, silent
from catenary.line.values import Line
from catenary.link import LinkSource
from catenary.target.main_device import MainDevice


def clone(
    target: str | LinkSource,
    folder: str | Path,
    *,
    pre_op: bool = False,
    serials: bool = True,
    fresh: bool = False,
    objects_timeout: float = OBJECTS_TIMEOUT,
    progress: Progress = silent,
) -> Line:
    """Read everything that the devices of a segment allow, and write it to a folder.

        line = cat.clone("eth0", "line/", pre_op=True)
        print(line.complete, [device.name for device in line.devices])

    No state is changed unless `pre_op`. Devices in SAFE-OP, OP and BOOT are not written to, so that
    only their registers are read. `ClonedDevice.missing` has the reason for each missing part.

    Args:
        target: Name of a segment, or a link source.
        folder: Folder of the clone. It is made if it does not exist. Finished devices of an
            interrupted clone whose identity and position fit are kept.
        pre_op: Bring devices in INIT to PRE-OP to read their objects, then back to INIT.
        serials: False leaves serial numbers out.
        fresh: Read all devices again, and replace complete ones even if parts are missing now.
        objects_timeout: Longest time for the objects of one device [s].
        progress: Function to call with (text, done, total).

    Returns:
        The clone, which `catenary.line.read_line` also returns for the folder.

    Raises:
        LinkError: The link cannot be used, or another master is live on it.
        NoDeviceError: No device answers.
        SegmentError: The number of devices changed while they were read, or the ring is cut.
        ConfigurationError: The target is invalid, or an IgH kernel master.
        CloneError: The folder contains other files than a clone.
        ValueError: `objects_timeout` is not positive.
    """
    if not 0 < objects_timeout < float("inf"):
        raise ValueError(f"objects_timeout = {objects_timeout} must be positive [s]")
    options = CloneOptions(pre_op, serials, fresh, objects_timeout)
    with MainDevice(target) as main:
        return clone_segment(main, folder, options, progress)
