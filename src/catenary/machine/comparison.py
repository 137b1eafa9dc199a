"""Comparison of a machine file with the devices that a scan has found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar

from msgspec import UNSET

from catenary.machine.schema import DeviceTable, IdentityTable
from catenary.model.device import DeviceDescription, Identity

Verdict = Literal["same", "absent", "different", "missing", "unknown"]
HARMLESS: tuple[Verdict, ...] = ("same", "absent")


class FoundDevice(Protocol):
    """A device that was found: a `SubDevice`, or a device of a clone."""

    @property
    def position(self) -> int: ...

    @property
    def name(self) -> str: ...

    @property
    def alias(self) -> int: ...

    @property
    def identity(self) -> Identity: ...

    @property
    def description(self) -> DeviceDescription: ...


Found = TypeVar("Found", bound=FoundDevice)
FoundHere = TypeVar("FoundHere", bound=FoundDevice, covariant=True)


class Comparison(NamedTuple, Generic[FoundHere]):
    """Comparison of one device of the file with the device found.

    The verdicts are:

    - "same": the identities agree.
    - "different": the device found has another identity, or several devices have its alias.
    - "missing": a required device was not found.
    - "absent": an optional device was not found.
    - "unknown": the file does not contain the device found.
    """

    verdict: Verdict
    expected: DeviceTable | None = None
    found: FoundHere | None = None
    fault: str = ""  # description of the difference
    cause: str = ""  # likely cause and next step

    @property
    def name(self) -> str:
        """Name in the file; for an unknown device, the name of the product."""
        if self.expected is not None:
            return self.expected.name
        return self.found.name if self.found is not None else ""


def compare(
    expected: Sequence[DeviceTable], subs: Sequence[Found]
) -> tuple[Comparison[Found], ...]:
    """Compare the devices of a file with those of a segment.

    Args:
        expected: devices of the file.
        subs: all devices of the segment, by position.

    Returns:
        One comparison per device of the file, followed by the unknown devices.
    """
    found = [_candidates(device, subs) for device in expected]
    taken = {sub.position for subs_of_one in found for sub in subs_of_one}
    known = [
        _compare(device, mine, expected, subs, taken)
        for device, mine in zip(expected, found, strict=True)
    ]
    unknown = [
        Comparison("unknown", found=sub, fault=f"{_place(sub)} is not in the file: {sub.identity}")
        for sub in subs
        if sub.position not in taken
    ]
    return (*known, *unknown)


def address(device: DeviceTable) -> str:
    """Return the address of a device in the file, such as "alias 11" or "position 3"."""
    return f"position {device.position}" if device.alias is UNSET else f"alias {device.alias}"


def expected_identity(device: DeviceTable) -> str:
    """Return the identity of a device in the file, as text for messages."""
    return _identity_text(device.identity)


def agrees(expected: IdentityTable, found: Identity) -> bool:
    """Return True if all numbers of the identity in the file agree with a device.

    Args:
        expected: identity in the file.
        found: identity of the device.
    """
    return not differences(expected, found)


def differences(expected: IdentityTable, found: Identity) -> list[str]:
    """Return the names of the numbers that differ, such as "revision".

    Args:
        expected: identity in the file.
        found: identity of the device.
    """
    numbers: Mapping[str, object] = {
        name: getattr(expected, name) for name in expected.__struct_fields__
    }
    return [n for n, value in numbers.items() if value is not UNSET and value != getattr(found, n)]


def _candidates(device: DeviceTable, subs: Sequence[Found]) -> list[Found]:
    if device.alias is UNSET:
        return [sub for sub in subs if sub.position == device.position]
    return [sub for sub in subs if sub.alias == device.alias]


def _compare(
    device: DeviceTable,
    mine: Sequence[Found],
    expected: Sequence[DeviceTable],
    subs: Sequence[Found],
    taken: set[int],
) -> Comparison[Found]:
    if len(mine) > 1:
        positions = ", ".join(str(sub.position) for sub in mine)
        fault = f"devices at positions {positions} have the same {address(device)}"
        cause = "give each device its own alias: catenary alias TARGET POSITION VALUE"
        return Comparison("different", device, mine[0], fault, cause)
    if not mine:
        verdict: Verdict = "missing" if device.required else "absent"
        fault = f"no device has {address(device)}; expected {expected_identity(device)}"
        return Comparison(verdict, device, None, fault, _cause_of_absence(device, subs, taken))
    [sub] = mine
    if agrees(device.identity, sub.identity):
        return Comparison("same", device, sub)
    alias = "" if device.alias is UNSET else f", {address(device)}"
    fault = f"{_place(sub)}{alias}: expected {expected_identity(device)}, found {sub.identity}"
    return Comparison(
        "different", device, sub, fault, _cause_of_another(device, sub, expected, subs)
    )


def _cause_of_absence(device: DeviceTable, subs: Sequence[FoundDevice], taken: set[int]) -> str:
    free = [s for s in subs if agrees(device.identity, s.identity) and s.position not in taken]
    if device.alias is UNSET:
        return f"the segment has {len(subs)} devices; check cables and power, or the file"
    if free:
        [first, *_] = free
        now = f"alias {first.alias}" if first.alias else "no alias"
        return (
            f"{_place(first)} has this identity and {now}; if it is the right device, run "
            f"`catenary alias TARGET {first.position} {device.alias}`, then switch it off and on"
        )
    return "no unassigned device has this identity; check cables and power"


def _cause_of_another(
    device: DeviceTable,
    sub: FoundDevice,
    expected: Sequence[DeviceTable],
    subs: Sequence[FoundDevice],
) -> str:
    """Return the likely cause of a wrong identity at an address, and the next step."""
    if not any(sub.identity):
        notes = "".join(f"; {note}" for note in sub.description.notes)
        return f"its EEPROM has no identity{notes}; run `catenary sii read TARGET {sub.position}`"
    differing = differences(device.identity, sub.identity)
    if "vendor" not in differing and "product" not in differing:
        text = " and ".join(differing)
        return (
            f"the device is the same product with another {text}; if it was replaced or updated, "
            f"change {text} in the file"
        )
    if device.alias is not UNSET:
        return (
            f"alias {device.alias} was written to another device; to correct it, run "
            "`catenary alias TARGET POSITION VALUE`"
        )
    shift = _shift(expected, subs)
    if shift:
        more = "more" if shift > 0 else "fewer"
        return (
            f"the cable has {abs(shift)} {more} {_devices(shift)} before it than the file has; "
            "correct the cabling, change the positions in the file, or use aliases"
        )
    for other in expected:
        if other is not device and agrees(other.identity, sub.identity):
            return (
                f'it has the identity of "{other.name}"; check whether devices or cables are '
                "swapped"
            )
    return "check the order of the devices on the cable, or correct the file"


def _shift(expected: Sequence[DeviceTable], subs: Sequence[FoundDevice]) -> int:
    """Return the number of additional devices before the first wrong one.

    The number is negative if devices are missing, and 0 if no shift explains the order.
    """
    wrong = [
        device for device in expected if device.position is not UNSET and not _fits(device, subs, 0)
    ]
    for count in (1, 2):
        moved = wrong[count:]  # without the devices that were removed
        if len(wrong) > 1 and all(_fits(device, subs, count) for device in wrong):
            return count
        if (
            moved
            and _position(moved[-1]) >= len(subs)
            and all(_fits(d, subs, -count) for d in moved)
        ):
            return -count
    return 0


def _devices(shift: int) -> str:
    return "device" if abs(shift) == 1 else "devices"


def _fits(device: DeviceTable, subs: Sequence[FoundDevice], shift: int) -> bool:
    at = _position(device) + shift
    return 0 <= at < len(subs) and agrees(device.identity, subs[at].identity)


def _position(device: DeviceTable) -> int:
    return -1 if device.position is UNSET else device.position


def _place(sub: FoundDevice) -> str:
    return f"position {sub.position} ({sub.name})" if sub.name else f"position {sub.position}"


def _identity_text(identity: IdentityTable) -> str:
    words = [f"vendor 0x{identity.vendor:08X} product 0x{identity.product:08X}"]
    if identity.revision is not UNSET:
        words.append(f"revision 0x{identity.revision:08X}")
    if identity.serial is not UNSET:
        words.append(f"serial {identity.serial}")
    return " ".join(words)
