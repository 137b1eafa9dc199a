"""Faults to inject into a segment, in Python or as `[[fault]]` tables.

    Segment(devices, faults=[lose_frames(3, at=2.0), power_cycle(2, at=1.5, for_=0.8)])
    segment.inject(cut(between=(4, 5)))          # without `at`: immediately

Every fault has a start time `at` [s] on the clock of the segment; docs/how_to/faults.md defines its
zero. Without `at`, the fault starts immediately. `for_` is its duration [s]. Without `for_`, most
faults do not end by themselves. Faults of frames then affect `n` frames (default: 1), and `swap`
and `exchange` end immediately. In TOML, the field `kind` names the fault, and `for_` and `with_`
are written `for` and `with`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, TypeAlias

import msgspec

from catenary.virtual.devices.device import Device
from catenary.virtual.wiring import Neighbour

STATES: Mapping[str, int] = {"INIT": 1, "PRE-OP": 2, "BOOT": 3, "SAFE-OP": 4, "OP": 8}


def _check(name: str, value: float | None, low: float, *, above: bool = False) -> None:
    if value is None:
        return
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{name} must be a finite number, not {value!r}")
    if value < low or (above and value == low):
        raise ValueError(f"{name} must be {'above' if above else 'at least'} {low:g}, not {value}")


class _Fault(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"
):
    at: float | None = None

    def __post_init__(self) -> None:
        _check("at", self.at, 0.0)

    @property
    def kind(self) -> str:
        """Name of the fault, as in a `[[fault]]` table."""
        return str(self.__struct_config__.tag)


class _Lasting(_Fault, frozen=True, kw_only=True):
    for_: float | None = msgspec.field(default=None, name="for")

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("for", self.for_, 0.0, above=True)


class _OfFrames(_Lasting, frozen=True, kw_only=True):
    """Fault that affects the first frame from `at` on, and every `every`-th frame after it.

    It ends after `n` affected frames. Without `n` and `for_`, it affects one frame. With only
    `for_`, it affects all these frames within that time.
    """

    every: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("n", getattr(self, "n", None), 1)
        _check("every", self.every, 1)

    @property
    def frames(self) -> int | None:
        """Maximum number of affected frames; None: unlimited."""
        n: int | None = getattr(self, "n", None)
        return 1 if n is None and self.for_ is None else n


class LoseFrames(_OfFrames, tag="lose_frames", frozen=True):
    """Loss of frames on the way "out" (before the first device) or "back" (after the last)."""

    n: int | None = None
    way: Literal["out", "back"] = msgspec.field(default="out")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.way not in ("out", "back"):
            raise ValueError(f'way must be "out" or "back", not {self.way!r}')


class Corrupt(_OfFrames, tag="corrupt", frozen=True):
    """Bit errors on the cable between two neighbours.

    The controllers behind the cable count the error and ignore the frame. The MainDevice's
    interface drops the frame.
    """

    n: int | None = None
    between: tuple[Neighbour, Neighbour] = ("main", 0)


class Garble(_OfFrames, tag="garble", frozen=True):
    """Corruption of returning frames that leaves the frame check sequence valid.

    The fault inverts the byte at `offset`, or one random bit if `offset` is None.
    """

    n: int | None = None
    offset: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("offset", self.offset, 0)


class Delay(_OfFrames, tag="delay", frozen=True):
    """Delay of returning frames by `by` [s]."""

    n: int | None = None
    by: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("by", self.by, 0.0, above=True)


class Duplicate(_OfFrames, tag="duplicate", frozen=True):
    """Duplication of returning frames."""

    n: int | None = None


class Cut(_Lasting, tag="cut", frozen=True):
    """Break of the cable between two neighbours ("main": the MainDevice), repaired after `for_`."""

    between: tuple[Neighbour, Neighbour]


class Join(_Fault, tag="join", frozen=True):
    """Repair of the cable between two neighbours."""

    between: tuple[Neighbour, Neighbour]


class _OfDevice(_Fault, frozen=True, kw_only=True):
    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("device", "other"):
            _check(name, getattr(self, name, None), 0)


class _LastingOfDevice(_Lasting, frozen=True, kw_only=True):
    def __post_init__(self) -> None:
        super().__post_init__()
        _check("device", getattr(self, "device", None), 0)


class Unplug(_LastingOfDevice, tag="unplug", frozen=True):
    """Disconnection of a device's uplink cable. The device keeps its power."""

    device: int


class Replug(_OfDevice, tag="replug", frozen=True):
    """Reconnection of a device's uplink cable."""

    device: int


class PowerCycle(_LastingOfDevice, tag="power_cycle", frozen=True):
    """Loss of a device's power for `for_`. Without a ring, the devices behind it are lost, too.

    The device returns in INIT, without a station address and with default object values.
    """

    device: int


class Swap(_LastingOfDevice, tag="swap", frozen=True):
    """Removal of a device and its replacement by `with_`, immediately or after `for_`."""

    device: int
    with_: Device = msgspec.field(name="with")


class Exchange(_LastingOfDevice, tag="exchange", frozen=True):
    """Exchange of the positions of two devices. Both lose power: for `for_`, or only briefly."""

    device: int
    other: int


class MailboxSilent(_LastingOfDevice, tag="mailbox_silent", frozen=True):
    """Stopped mailbox of a device: SM0 stays full and SM1 stays empty."""

    device: int


class LateMailbox(_LastingOfDevice, tag="late_mailbox", frozen=True):
    """Delay of a device's mailbox answers by `by` [s]."""

    device: int
    by: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("by", self.by, 0.0, above=True)


class RefuseState(_LastingOfDevice, tag="refuse_state", frozen=True):
    """Refusal of a state with an AL status code, `times` times or always."""

    device: int
    state: int | str
    code: int
    times: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        number_of_state(self.state)
        _check("code", self.code, 1)
        _check("times", self.times, 1)


class LeaveState(_OfDevice, tag="leave_state", frozen=True):
    """Unrequested change of a device to a lower state, with an AL status code."""

    device: int
    state: int | str = "SAFE-OP"
    code: int = 0x001A

    def __post_init__(self) -> None:
        super().__post_init__()
        number_of_state(self.state)
        _check("code", self.code, 1)


class WrongWorkingCounter(_LastingOfDevice, tag="wrong_working_counter", frozen=True):
    """Failure of a device to process logical datagrams or to increment their working counters."""

    device: int


class Freeze(_LastingOfDevice, tag="freeze", frozen=True):
    """Stopped model of a device. Its controller continues to answer with old inputs."""

    device: int


class DriveFault(_LastingOfDevice, tag="drive_fault", frozen=True):
    """Fault of a servo axis with the error code `code` (0x603F). Its cause ends after `for_`."""

    device: int
    code: int = 0x2310
    axis: int = 0


class SafeTorqueOff(_LastingOfDevice, tag="safe_torque_off", frozen=True):
    """Safe torque off of a servo axis."""

    device: int
    axis: int = 0


class Drift(_LastingOfDevice, tag="drift", frozen=True):
    """Frequency error `ppm` of a device's crystal [ppm]. Positive: the clock runs fast."""

    device: int
    ppm: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("ppm", self.ppm, -500)
        _check("ppm", -self.ppm, -500)


FrameFault: TypeAlias = LoseFrames | Corrupt | Garble | Delay | Duplicate
Fault: TypeAlias = (
    LoseFrames
    | Corrupt
    | Garble
    | Delay
    | Duplicate
    | Cut
    | Join
    | Unplug
    | Replug
    | PowerCycle
    | Swap
    | Exchange
    | MailboxSilent
    | LateMailbox
    | RefuseState
    | LeaveState
    | WrongWorkingCounter
    | Freeze
    | DriveFault
    | SafeTorqueOff
    | Drift
)


def number_of_state(state: int | str) -> int:
    """Return the AL state number: 1 INIT, 2 PRE-OP, 3 BOOT, 4 SAFE-OP, 8 OP.

    Raises:
        ValueError: The name or number is not an AL state.
    """
    number = STATES.get(state) if isinstance(state, str) else state
    if number is None or number not in STATES.values():
        raise ValueError(f"unknown state {state!r}; use one of {', '.join(STATES)}")
    return number


# Lower-case names, the same as `kind` in a `[[fault]]` table.
lose_frames = LoseFrames
corrupt = Corrupt
garble = Garble
delay = Delay
duplicate = Duplicate
cut = Cut
join = Join
unplug = Unplug
replug = Replug
power_cycle = PowerCycle
swap = Swap
exchange = Exchange
mailbox_silent = MailboxSilent
late_mailbox = LateMailbox
refuse_state = RefuseState
leave_state = LeaveState
wrong_working_counter = WrongWorkingCounter
freeze = Freeze
drive_fault = DriveFault
safe_torque_off = SafeTorqueOff
drift = Drift
