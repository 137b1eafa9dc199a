"""Motors and option codes of the axes of a described device, from the values of its objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from catenary.virtual.coe.object_facts import EntryFacts, Place
from catenary.virtual.devices.application import Application
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.servo_quirks import NO_QUIRKS, ServoQuirks

ABORT_CONNECTION_OPTION, QUICK_STOP_OPTION = 0x6007, 0x605A
POSITION_ACTUAL, RATED_TORQUE = 0x6064, 0x6076
ENCODER_RESOLUTION, VELOCITY_RESOLUTION = 0x608F, 0x6090
COUNTS_MAX = 1 << 31


def motor_of(facts: Mapping[Place, EntryFacts], offset: int, motor: Motor) -> Motor:
    """Return the motor of an axis, with what its objects tell instead of the preset.

    0x608F gives the counts per turn, 0x6090 those of the velocity, and 0x6076 the rated torque.
    Inertia and friction are unknown. They are scaled with the rated torque.

    Args:
        facts: Entries of the device, by index and subindex.
        offset: Offset of the objects of the axis.
        motor: Motor with the presets.
    """
    counts = _ratio(facts, ENCODER_RESOLUTION + offset)
    if counts:
        motor = replace(motor, counts_per_turn=counts)
    velocity = _ratio(facts, VELOCITY_RESOLUTION + offset)
    if velocity:
        motor = replace(motor, velocity_counts_per_turn=velocity)
    torque = _number(facts, (RATED_TORQUE + offset, 0)) / 1000
    if torque <= 0:
        return motor
    scale = torque / motor.rated_torque
    return replace(
        motor,
        rated_torque=torque,
        inertia=motor.inertia * scale,
        viscous_friction=motor.viscous_friction * scale,
        coulomb_friction=motor.coulomb_friction * scale,
    )


def apply_option_quirks(
    application: Application, offsets: Sequence[int], quirks: ServoQuirks
) -> None:
    """Set the option codes that a quirk determines, instead of those of the file.

    Args:
        application: Application of the device, with its dictionary.
        offsets: Offset of the objects of each axis.
        quirks: Differences of the axes from the profile.
    """
    for offset in offsets:
        place = QUICK_STOP_OPTION + offset
        if quirks.quick_stop_option == "absent":
            application.dictionary.objects.pop(place, None)
        elif quirks.quick_stop_option != NO_QUIRKS.quick_stop_option:
            _set(application, place, quirks.quick_stop_option)
        if quirks.abort_connection_option != NO_QUIRKS.abort_connection_option:
            _set(application, ABORT_CONNECTION_OPTION + offset, quirks.abort_connection_option)


def _set(application: Application, index: int, value: int) -> None:
    entry = application.dictionary.known_entry(index, 0)
    if entry is not None and entry.slot >= 0:
        application.put_slot(entry.slot, value)


def start_position(facts: Mapping[Place, EntryFacts], offset: int) -> int:
    """Return the recorded position of an axis [counts]; 0 if it is unknown.

    Args:
        facts: Entries of the device, by index and subindex.
        offset: Offset of the objects of the axis.
    """
    return _number(facts, (POSITION_ACTUAL + offset, 0), signed=True)


def _ratio(facts: Mapping[Place, EntryFacts], index: int) -> int:
    """Return subindex 1 divided by subindex 2, as a whole number; 0 if it is unknown."""
    turns = _number(facts, (index, 2)) or 1
    found = round(_number(facts, (index, 1)) / turns)
    return found if 0 < found < COUNTS_MAX else 0


def _number(facts: Mapping[Place, EntryFacts], place: Place, *, signed: bool = False) -> int:
    entry = facts.get(place)
    value = entry.value if entry is not None else None
    return int.from_bytes(value[:8], "little", signed=signed) if value else 0
