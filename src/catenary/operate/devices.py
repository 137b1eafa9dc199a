"""Requests for all devices of a segment, with conservative limits."""

from __future__ import annotations

from collections.abc import Iterable

from catenary.bus import SubDevice
from catenary.drive import Drives
from catenary.drive.process_data import ProcessData
from catenary.errors import CatenaryError
from catenary.loop.devices import LoopRequest
from catenary.types import UDINT
from catenary.wire.cia402 import SLOT_OFFSET

ENCODER = (0x608F, 1), (0x608F, 2)  # encoder counts, motor turns
DEFAULT_COUNTS = 2.0**20  # per turn
VELOCITY_LIMIT = 1.0  # [rad/s]
ACCELERATION_LIMIT = 2.0  # [rad/s²]


def make_requests(subs: Iterable[SubDevice]) -> tuple[list[LoopRequest], list[str]]:
    """Return the requests for all devices with process data, and notes about the assumptions.

    Each drive has a request of its own and is optional, so that the loop continues without a lost
    device.
    """
    requests: list[LoopRequest] = []
    notes: list[str] = []
    for sub in subs:
        try:
            if sub.slots:
                requests.append(make_drives(sub, notes))
            elif has_process_data(sub):
                requests.append(ProcessData(sub, required=False))
        except (CatenaryError, ValueError) as error:
            notes.append(f"device {sub.position} ({sub.name}) is not used: {error}")
    return requests, notes


def make_drives(sub: SubDevice, notes: list[str]) -> Drives:
    """Return the request for all axes of a drive. Append the assumed values to the notes."""
    counts = [counts_per_turn(sub, slot) for slot in sub.slots]
    for slot, value in zip(sub.slots, counts, strict=True):
        found = f"{value:g} counts per turn" if value else f"{DEFAULT_COUNTS:g} counts (assumed)"
        notes.append(
            f"device {sub.position} ({sub.name}), axis {slot}: {found}, at most "
            f"{VELOCITY_LIMIT:g} rad/s and {ACCELERATION_LIMIT:g} rad/s² of the motor"
        )
    return Drives(
        [sub],
        counts_per_turn=[value or DEFAULT_COUNTS for value in counts],
        velocity_limit=VELOCITY_LIMIT,
        acceleration_limit=ACCELERATION_LIMIT,
        deceleration_limit=ACCELERATION_LIMIT,
        required=False,
    )


def counts_per_turn(sub: SubDevice, slot: int) -> float | None:
    """Return the encoder counts per turn that a drive reports; None if it reports none."""
    try:
        counts, turns = (
            sub.sdo.read(index + SLOT_OFFSET * slot, subindex, type=UDINT)
            for index, subindex in ENCODER
        )
    except CatenaryError:  # the object is optional
        return None
    return counts / turns if counts and turns else None


def has_process_data(sub: SubDevice) -> bool:
    """Return True if a device has PDOs."""
    return bool(sub.description.pdos)
