"""Random incidents of a soak test."""

from __future__ import annotations

import math
from collections.abc import Callable
from random import Random
from typing import Literal, NamedTuple, TypeAlias

from benchmarks.soak.cell import (
    ARM,
    DEVICES,
    OPTIONAL,
    SENSOR,
    SERVOS,
    TOOL,
    WITH_MAILBOX,
    make_servo,
)
from benchmarks.soak.effects import fits
from benchmarks.soak.setting import Setting
from catenary.virtual import Fault
from catenary.virtual import faults as f
from catenary.virtual.wiring import Neighbour

OFTEN = 0.75  # probability that a fault hits an optional device
SHORTEST, LONGEST = 1e-3, 0.8  # [s] duration of a fault
PYTHON_LATE = "python_late"  # not a fault of the segment: the application is late


class Incident(NamedTuple):
    """Faults that occur together, and the delay of the application [s]."""

    faults: tuple[Fault, ...]
    late: float = 0.0

    @property
    def kinds(self) -> tuple[str, ...]:
        return tuple(fault.kind for fault in self.faults) + ((PYTHON_LATE,) if self.late else ())

    def __str__(self) -> str:
        late = [f"{PYTHON_LATE} for {self.late:.4f} s"] if self.late else []
        return ", ".join([*map(told, self.faults), *late])


class Moment(NamedTuple):
    """Source of one fault: the random numbers, its start [s], and the setting."""

    random: Random
    at: float
    setting: Setting

    def lasting(self) -> float:
        """Return a duration [s]; all orders of magnitude are equally likely."""
        return math.exp(self.random.uniform(math.log(SHORTEST), math.log(LONGEST)))

    def device(self) -> int:
        """Return a device, mostly an optional one, so that the loop does not end too often."""
        return self.random.choice(OPTIONAL if self.random.random() < OFTEN else range(DEVICES))

    def with_mailbox(self) -> int:
        required = [d for d in WITH_MAILBOX if d not in OPTIONAL]
        return self.random.choice((TOOL, SENSOR) if self.random.random() < OFTEN else required)

    def servo(self) -> int:
        return TOOL if self.random.random() < OFTEN else self.random.choice(ARM)

    def between(self) -> tuple[Neighbour, Neighbour]:
        """Return the ends of a cable. In a ring it may be any, because one cut does no harm."""
        below = self.random.randrange(DEVICES + 1) if self.setting.is_ring else self.device()
        if below == DEVICES:
            return (DEVICES - 1, "main")
        return ("main" if below == 0 else below - 1, below)

    def serial(self) -> int:
        return self.random.randrange(100, 1 << 31)


Drawn: TypeAlias = tuple[Fault, ...]


def _lose(m: Moment) -> Drawn:
    ways: tuple[Literal["out", "back"], ...] = ("out", "back")
    n = m.random.choice((None, 1, 2, 5))
    every = m.random.choice((1, 1, 2, 7))
    return (f.LoseFrames(n=n, every=every, way=m.random.choice(ways), at=m.at, for_=m.lasting()),)


def _corrupt(m: Moment) -> Drawn:
    every = m.random.choice((1, 2, 7))
    return (f.Corrupt(between=m.between(), every=every, at=m.at, for_=m.lasting()),)


def _garble(m: Moment) -> Drawn:
    return (f.Garble(every=m.random.choice((1, 2, 7)), at=m.at, for_=m.lasting()),)


def _delay(m: Moment) -> Drawn:
    by = math.exp(m.random.uniform(math.log(1e-4), math.log(5e-3)))
    return (f.Delay(by=by, every=m.random.choice((1, 2, 7)), at=m.at, for_=m.lasting()),)


def _duplicate(m: Moment) -> Drawn:
    return (f.Duplicate(every=m.random.choice((1, 2, 7)), at=m.at, for_=m.lasting()),)


def _cut(m: Moment) -> Drawn:
    between = m.between()
    if m.random.random() < 0.5:
        return (f.Cut(between=between, at=m.at, for_=m.lasting()),)
    return (f.Cut(between=between, at=m.at), f.Join(between=between, at=m.at + m.lasting()))


def _unplug(m: Moment) -> Drawn:
    device = m.device()
    if m.random.random() < 0.5:
        return (f.Unplug(device=device, at=m.at, for_=m.lasting()),)
    return (f.Unplug(device=device, at=m.at), f.Replug(device=device, at=m.at + m.lasting()))


def _power_cycle(m: Moment) -> Drawn:
    return (f.PowerCycle(device=m.device(), at=m.at, for_=m.lasting()),)


def _swap(m: Moment) -> Drawn:
    device = m.servo()
    new = make_servo("spare", m.serial(), m.random, m.setting)
    return (f.Swap(device=device, with_=new, at=m.at, for_=m.lasting()),)


def _exchange(m: Moment) -> Drawn:
    one, other = m.random.sample(SERVOS, 2)
    return (f.Exchange(device=one, other=other, at=m.at, for_=m.lasting()),)


def _mailbox_silent(m: Moment) -> Drawn:
    device = m.with_mailbox()
    return (f.MailboxSilent(device=device, at=m.at, for_=m.lasting()), *_falls(m, device))


def _late_mailbox(m: Moment) -> Drawn:
    device = m.with_mailbox()
    by = m.random.uniform(0.001, 0.2)
    return (f.LateMailbox(device=device, by=by, at=m.at, for_=m.lasting()), *_falls(m, device))


def _refuse_state(m: Moment) -> Drawn:
    device = m.with_mailbox()
    fault = f.RefuseState(
        device=device,
        state=m.random.choice(("PRE-OP", "SAFE-OP", "OP")),
        code=m.random.choice((0x0011, 0x001E, 0x0024, 0x8000)),
        times=m.random.choice((None, 1, 2)),
        at=m.at,
        for_=m.lasting(),
    )
    return (fault, *_falls(m, device))


def _falls(m: Moment, device: int) -> Drawn:
    """Return a fault after which the device needs its mailbox and state changes, or none."""
    if m.random.random() < 0.4:
        return ()
    return (f.LeaveState(device=device, state="PRE-OP", code=0x001A, at=m.at + 1e-3),)


def _leave_state(m: Moment) -> Drawn:
    state = m.random.choice(("SAFE-OP", "PRE-OP", "INIT"))
    code = m.random.choice((0x001A, 0x001B, 0x002C, 0x8000))
    return (f.LeaveState(device=m.with_mailbox(), state=state, code=code, at=m.at),)


def _wrong_working_counter(m: Moment) -> Drawn:
    return (f.WrongWorkingCounter(device=m.device(), at=m.at, for_=m.lasting()),)


def _freeze(m: Moment) -> Drawn:
    return (f.Freeze(device=m.servo(), at=m.at, for_=m.lasting()),)


def _drive_fault(m: Moment) -> Drawn:
    code = m.random.choice((0x2310, 0x3210, 0x8611))
    return (f.DriveFault(device=m.servo(), code=code, at=m.at, for_=m.lasting()),)


def _safe_torque_off(m: Moment) -> Drawn:
    return (f.SafeTorqueOff(device=m.servo(), at=m.at, for_=m.lasting()),)


def _drift(m: Moment) -> Drawn:
    ppm = m.random.uniform(-100, 100)
    return (f.Drift(device=m.random.choice(SERVOS), ppm=ppm, at=m.at, for_=m.lasting()),)


KINDS: tuple[Callable[[Moment], Drawn], ...] = (
    _lose,
    _corrupt,
    _garble,
    _delay,
    _duplicate,
    _cut,
    _unplug,
    _power_cycle,
    _swap,
    _exchange,
    _mailbox_silent,
    _late_mailbox,
    _refuse_state,
    _leave_state,
    _wrong_working_counter,
    _freeze,
    _drive_fault,
    _safe_torque_off,
    _drift,
)


def draw(random: Random, now: float, setting: Setting) -> Incident:
    """Draw one fault, sometimes two or three at once, or an application that is late."""
    if random.random() < 0.04:
        return Incident((), math.exp(random.uniform(math.log(2e-3), math.log(0.3))))
    faults: list[Fault] = []
    for _ in range(random.choice((1, 1, 1, 1, 1, 2, 2, 3))):
        moment = Moment(random, now + random.uniform(0.001, 0.02), setting)
        drawn = random.choice(KINDS)(moment)
        if fits(drawn, faults, ring=setting.is_ring):
            faults += drawn
    return Incident(tuple(faults))


def told(fault: Fault) -> str:
    """Return a fault as one line, which is the same in every run."""
    fields = {name: getattr(fault, name) for name in fault.__struct_fields__}
    if isinstance(fault, f.Swap):
        fields["with_"] = fault.with_.serial
    given = [
        f"{name}={value:.4f}" if isinstance(value, float) else f"{name}={value!r}"
        for name, value in fields.items()
        if value is not None
    ]
    return f"{fault.kind}({', '.join(given)})"
