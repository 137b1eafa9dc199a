"""Faults in plain words: frozen values that a segment obeys, in Python and as `[[fault]]` tables.

    Segment(devices, faults=[lose_frames(3, at=2.0), power_cycle(2, at=1.5, for_=0.8)])
    segment.inject(cut(between=(4, 5)))          # no `at`: at once

Every fault has `at` [s], the segment's time (docs/faults.md says from when it counts); without it
the fault begins at once. `for_` [s] is how long it lasts; without it: to the end. In TOML `kind`
is the word, and `for_` and `with_` are written `for` and `with`.
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
        raise ValueError(f"{name} must be a number, not {value!r}")
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
        """The word for it."""
        return str(self.__struct_config__.tag)


class _Lasting(_Fault, frozen=True, kw_only=True):
    for_: float | None = msgspec.field(default=None, name="for")

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("for", self.for_, 0.0, above=True)


class _OfFrames(_Lasting, frozen=True, kw_only=True):
    """Hits the first frame from `at` on and then every `every`-th, `n` in all; without `n`: one, or
    all within `for_`."""

    every: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("n", getattr(self, "n", None), 1)
        _check("every", self.every, 1)

    @property
    def frames(self) -> int | None:
        """How many it hits at most; None: no end."""
        n: int | None = getattr(self, "n", None)
        return 1 if n is None and self.for_ is None else n


class LoseFrames(_OfFrames, tag="lose_frames", frozen=True):
    """Frames vanish: on their way "out", before the first device, or on their way "back"."""

    n: int | None = None
    way: Literal["out", "back"] = msgspec.field(default="out")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.way not in ("out", "back"):
            raise ValueError(f'way is "out" or "back", not {self.way!r}')


class Corrupt(_OfFrames, tag="corrupt", frozen=True):
    """Bits turn on the cable between two neighbours: the controllers behind count it and take
    nothing from the frame, and the MainDevice's interface drops it."""

    n: int | None = None
    between: tuple[Neighbour, Neighbour] = ("main", 0)


class Garble(_OfFrames, tag="garble", frozen=True):
    """Frames come back with wrong bytes and a check sequence that fits: the byte at `offset`
    inverted, or one bit anywhere."""

    n: int | None = None
    offset: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("offset", self.offset, 0)


class Delay(_OfFrames, tag="delay", frozen=True):
    """Frames come back `by` [s] later."""

    n: int | None = None
    by: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("by", self.by, 0.0, above=True)


class Duplicate(_OfFrames, tag="duplicate", frozen=True):
    """Frames come back twice."""

    n: int | None = None


class Cut(_Lasting, tag="cut", frozen=True):
    """No light between two neighbours ("main": the MainDevice); joined again after `for_`."""

    between: tuple[Neighbour, Neighbour]


class Join(_Fault, tag="join", frozen=True):
    """The cable between two neighbours is whole (again)."""

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
    """The cable towards the MainDevice is pulled from a device, which keeps its power."""

    device: int


class Replug(_OfDevice, tag="replug", frozen=True):
    """... and put in again."""

    device: int


class PowerCycle(_LastingOfDevice, tag="power_cycle", frozen=True):
    """A device has no power for `for_`; what is behind it is gone too, unless there is a ring.
    It comes back in INIT, without station address, with its objects' defaults."""

    device: int


class Swap(_LastingOfDevice, tag="swap", frozen=True):
    """A device is taken out, and `with_` put in its place, at once or `for_` later."""

    device: int
    with_: Device = msgspec.field(name="with")


class Exchange(_LastingOfDevice, tag="exchange", frozen=True):
    """Two devices change places, as after a repair; both are without power for `for_`."""

    device: int
    other: int


class MailboxSilent(_LastingOfDevice, tag="mailbox_silent", frozen=True):
    """A device takes no request from its mailbox: SM0 stays full, SM1 empty."""

    device: int


class LateMailbox(_LastingOfDevice, tag="late_mailbox", frozen=True):
    """A device takes `by` [s] longer for what it is asked by mailbox."""

    device: int
    by: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("by", self.by, 0.0, above=True)


class RefuseState(_LastingOfDevice, tag="refuse_state", frozen=True):
    """A device refuses a state with an AL status code, `times` times or always."""

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
    """A device falls to a lower state by itself and shows an AL status code."""

    device: int
    state: int | str = "SAFE-OP"
    code: int = 0x001A

    def __post_init__(self) -> None:
        super().__post_init__()
        number_of_state(self.state)
        _check("code", self.code, 1)


class WrongWorkingCounter(_LastingOfDevice, tag="wrong_working_counter", frozen=True):
    """A device lets process data pass it by: it neither takes nor gives nor counts."""

    device: int


class Freeze(_LastingOfDevice, tag="freeze", frozen=True):
    """A device's model stands still; its controller goes on answering with old inputs."""

    device: int


class DriveFault(_LastingOfDevice, tag="drive_fault", frozen=True):
    """A servo's axis has a fault with this error code (0x603F); its cause goes after `for_`."""

    device: int
    code: int = 0x2310
    axis: int = 0


class SafeTorqueOff(_LastingOfDevice, tag="safe_torque_off", frozen=True):
    """A servo's axis has its torque taken off by its safety input."""

    device: int
    axis: int = 0


class Drift(_LastingOfDevice, tag="drift", frozen=True):
    """A device's crystal runs `ppm` millionths fast (negative: slow)."""

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
    """1 INIT, 2 PRE-OP, 3 BOOT, 4 SAFE-OP, 8 OP."""
    number = STATES.get(state) if isinstance(state, str) else state
    if number is None or number not in STATES.values():
        raise ValueError(f"state {state!r} is none of {', '.join(STATES)}")
    return number


# The words, as scenarios use them.
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
