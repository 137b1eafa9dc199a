"""IDNs of the virtual SERCOS drive that have fixed or stored values, IEC 61800-7-204."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Protocol

from catenary.virtual import _segment
from catenary.virtual.soe.parameter import (
    BINARY,
    HEX,
    SIGNED,
    WHILE_CYCLIC,
    Parameter,
    text,
)

VELOCITY_DECIMALS = 4  # preferred scaling of a rotary velocity: 0.0001 rpm
VELOCITY_UNITS = 10_000  # per rpm
RATED = 1000  # torque in 0.1 % of the rated torque
LARGE_LIST_BYTES = 4096
ROTARY_PARAMETER_SCALING = 0x000A  # S-0-0076: rotary, parameter scaling (S-0-0079), motor shaft
INT32 = (1 << 31) - 1
POSITION_MODE, VELOCITY_MODE, TORQUE_MODE = 0x000B, 0x0002, 0x0001  # S-0-0032
COMMANDS = {
    99: "Reset class 1 diagnostic",
    127: "Communication phase 3 transition check",
    128: "Communication phase 4 transition check",
    264: "Backup working memory procedure command",
}


class MotorFacts(Protocol):
    """Facts of a motor; `virtual.devices.motor.Motor` has them."""

    @property
    def counts_per_turn(self) -> int: ...

    @property
    def max_velocity(self) -> float: ...

    @property
    def max_torque_ratio(self) -> float: ...

    @property
    def following_error_turns(self) -> float: ...


def cyclic_parameters(
    entry: Callable[[int], Callable[[], bytes]], put: Callable[[int, int], None]
) -> Iterator[Parameter]:
    """Yield the IDNs that a telegram may contain.

    Args:
        entry: Function that returns the reader of a slot, by the size of the value [bytes] and slot
            as one number (`size << 8 | slot`).
        put: Function that sets a slot.
    """
    for number, name, size, unit, decimals, slot, in_mdt in (
        (36, "Velocity command value", 4, "rpm", 4, _segment.SLOT_TARGET_VELOCITY, True),
        (37, "Additive velocity command value", 4, "rpm", 4, _segment.SLOT_VELOCITY_OFFSET, True),
        (40, "Velocity feedback value 1", 4, "rpm", 4, _segment.SLOT_VELOCITY, False),
        (47, "Position command value", 4, "inc", 0, _segment.SLOT_TARGET_POSITION, True),
        (51, "Position feedback value 1 (motor)", 4, "inc", 0, _segment.SLOT_POSITION, False),
        (53, "Position feedback value 2 (external)", 4, "inc", 0, _segment.SLOT_POSITION, False),
        (80, "Torque command value", 2, "%", 1, _segment.SLOT_TARGET_TORQUE, True),
        (81, "Additive torque command value", 2, "%", 1, _segment.SLOT_TORQUE_OFFSET, True),
        (84, "Torque feedback value", 2, "%", 1, _segment.SLOT_TORQUE, False),
        (189, "Following distance", 4, "inc", 0, _segment.SLOT_FOLLOWING_ERROR, False),
    ):
        limit = INT32 if size == 4 else 0x7FFF
        parameter = Parameter(
            number,
            name,
            size,
            SIGNED,
            unit,
            decimals,
            minimum=-limit - 1,
            maximum=limit,
            read=entry(size << 8 | slot),
            slot=slot,
            in_mdt=in_mdt,
            in_at=True,
        )
        if in_mdt:
            parameter.protection = 0
            parameter.written = _writer(put, slot)
        yield parameter


def _writer(put: Callable[[int, int], None], slot: int) -> Callable[[bytes], None]:
    return lambda data: put(slot, int.from_bytes(data, "little", signed=True))


def stored_parameters(motor: MotorFacts) -> Iterator[Parameter]:
    """Yield the IDNs with stored values: scaling, limits, modes, names."""
    for number, name, size, unit, value, low, high, protection in (
        (1, "Control unit cycle time (tNcyc)", 2, "us", 2000, 125, 65000, WHILE_CYCLIC),
        (2, "SERCOS cycle time (tScyc)", 2, "us", 1000, 125, 65000, WHILE_CYCLIC),
        (45, "Velocity data scaling factor", 2, "", 1, 1, 0xFFFF, WHILE_CYCLIC),
        (77, "Linear position data scaling factor", 2, "", 1, 1, 0xFFFF, WHILE_CYCLIC),
        (93, "Torque/force data scaling factor", 2, "", 1, 1, 0xFFFF, WHILE_CYCLIC),
        (79, "Rotational position resolution", 4, "", motor.counts_per_turn, 1, INT32, 7),
        (159, "Monitoring window", 4, "inc", _window(motor), 1, INT32, 0),
        (113, "Maximum motor speed", 4, "rpm", _rpm(motor), 0, INT32, 7),
        (91, "Bipolar velocity limit value", 4, "rpm", _rpm(motor), 0, INT32, 0),
        (92, "Bipolar torque limit value", 2, "%", _torque(motor), 0, 0x7FFF, 0),
    ):
        yield Parameter(
            number,
            name,
            size,
            unit=unit,
            decimals={"rpm": VELOCITY_DECIMALS, "%": 1}.get(unit, 0),
            minimum=low,
            maximum=high,
            default=value,
            protection=protection,
            content=value.to_bytes(size, "little"),
        )
    for number, name, exponent in (
        (46, "Velocity data scaling exponent", -VELOCITY_DECIMALS),
        (78, "Linear position data scaling exponent", -7),
        (94, "Torque/force data scaling exponent", -1),
    ):
        data = exponent.to_bytes(2, "little", signed=True)
        yield Parameter(number, name, 2, SIGNED, protection=WHILE_CYCLIC, content=data)
    yield from _words()
    yield from _texts()


def _words() -> Iterator[Parameter]:
    """Yield words of bits."""
    for number, name, value, protection in (
        (14, "Interface status", 0, 7),
        (12, "Class 2 diagnostic (C2D)", 0, 7),
        (13, "Class 3 diagnostic (C3D)", 0, 7),
        (32, "Primary operation mode", POSITION_MODE, WHILE_CYCLIC),
        (33, "Secondary operation mode 1", VELOCITY_MODE, WHILE_CYCLIC),
        (34, "Secondary operation mode 2", TORQUE_MODE, WHILE_CYCLIC),
        (35, "Secondary operation mode 3", 0, WHILE_CYCLIC),
        (43, "Velocity polarity parameter", 0, WHILE_CYCLIC),
        (44, "Velocity data scaling type", 0x0002, WHILE_CYCLIC),
        (55, "Position polarity parameter", 0, WHILE_CYCLIC),
        (76, "Position data scaling type", ROTARY_PARAMETER_SCALING, WHILE_CYCLIC),
        (85, "Torque polarity parameter", 0, WHILE_CYCLIC),
        (86, "Torque/force data scaling type", 0x0000, WHILE_CYCLIC),
    ):
        data = value.to_bytes(2, "little")
        yield Parameter(number, name, 2, BINARY, protection=protection, content=data)


def _texts() -> Iterator[Parameter]:
    yield text(30, "Manufacturer version", "Catenary virtual drive 1.0")
    yield text(140, "Controller type", "Catenary virtual SERCOS drive")
    yield text(141, "Motor type", "Catenary virtual motor")
    yield text(142, "Application type", "", limit=40)
    yield Parameter(0x8000 + 10, "Vendor-specific word", 2, HEX, protection=0, content=bytes(2))
    yield Parameter(
        0x8000 + 18,
        "Large list",
        4,
        is_list=True,
        limit=LARGE_LIST_BYTES,
        protection=0,
        content=b"".join(k.to_bytes(4, "little") for k in range(LARGE_LIST_BYTES // 8)),
    )


def command_parameters() -> Iterator[Parameter]:
    """Yield the procedure commands."""
    for number, name in COMMANDS.items():
        yield Parameter(number, name, 2, BINARY, is_command=True, protection=0, content=bytes(2))


def _rpm(motor: MotorFacts) -> int:
    return round(motor.max_velocity * 60 / (2 * math.pi) * VELOCITY_UNITS)


def _torque(motor: MotorFacts) -> int:
    return min(round(RATED * motor.max_torque_ratio), 0x7FFF)


def _window(motor: MotorFacts) -> int:
    return round(motor.following_error_turns * motor.counts_per_turn)
