"""Timelines made of events, for tests of comparisons."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.capture import (
    Device,
    Event,
    FileCounts,
    FmmuWrite,
    Master,
    MasterSummary,
    SdoTransfer,
    StateReached,
    StateRefused,
    StateRequest,
    Step,
    SyncManagerWrite,
    SyncUnitWrite,
    Timeline,
)
from catenary.capture.contents import Content
from catenary.wire.al import AlState
from catenary.wire.fmmu import Fmmu

INIT, PRE_OP, SAFE_OP, OP = AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP
IN_PRE_OP, TO_SAFE_OP, IN_SAFE_OP = Step(PRE_OP, PRE_OP), Step(PRE_OP, SAFE_OP), Step(SAFE_OP)
TO_OP = Step(SAFE_OP, OP)
MILLISECOND = 1_000_000
Steps = Sequence[tuple[Step, Content]]


def reached(state: AlState) -> tuple[Step, Content]:
    before = {PRE_OP: INIT, SAFE_OP: PRE_OP, OP: SAFE_OP}[state]
    return Step(before, state), StateReached(state, 12 * MILLISECOND)


def refused(state: AlState, code: int) -> list[tuple[Step, Content]]:
    before = {PRE_OP: INIT, SAFE_OP: PRE_OP, OP: SAFE_OP}[state]
    step = Step(before, state)
    return [
        (step, StateRequest(state)),
        (step, StateRefused(before, state, code, before)),
    ]


def sdo(index: int, subindex: int, data: bytes, **options: int) -> tuple[Step, Content]:
    return IN_PRE_OP, SdoTransfer(True, index, subindex, data, **options)  # type: ignore[arg-type]


def sdo_read(index: int, subindex: int, data: bytes) -> tuple[Step, Content]:
    return IN_PRE_OP, SdoTransfer(False, index, subindex, data)


def sync_manager(number: int, length: int, control: int) -> tuple[Step, Content]:
    return TO_SAFE_OP, SyncManagerWrite(number, 0x1800, length, control, True)


def fmmu(number: int, logical: int, length: int, physical: int) -> tuple[Step, Content]:
    block = Fmmu(logical, length, 0, 7, physical, 0, writes=True)
    return TO_SAFE_OP, FmmuWrite(number, block)


def sync(
    assign_activate: int, cycle_ns: int = MILLISECOND, start_ns: int = 0
) -> tuple[Step, Content]:
    return TO_SAFE_OP, SyncUnitWrite(assign_activate, cycle_ns, 0, start_ns)


def device(
    number: int, *, serial: int | None = None, product: int = 5, station: int = 0x1001
) -> Device:
    return Device(number, number, station + number, 2, product, 1, serial, f"D{product}")


def to_op(*steps: tuple[Step, Content]) -> list[tuple[Step, Content]]:
    """Return the events of a bring-up. SDOs are written in PRE-OP."""
    in_pre_op = [each for each in steps if each[0] == IN_PRE_OP]
    later = [each for each in steps if each[0] == TO_SAFE_OP]
    last = [each for each in steps if each[0] not in (IN_PRE_OP, TO_SAFE_OP)]
    start = [reached(PRE_OP), *in_pre_op, *later, reached(SAFE_OP)]
    return [*start, *last, *([] if any(s == TO_OP for s, _ in last) else [reached(OP)])]


def timeline(*devices: tuple[Device, Steps]) -> Timeline:
    """Return a timeline of one master, with one event per millisecond."""
    events = [
        Event((number + 1) * MILLISECOND, number + 1, 0, each.number, step, content)
        for each, steps in devices
        for number, (step, content) in enumerate(steps)
    ]
    events.sort(key=lambda event: event.time_ns)
    summary = MasterSummary(
        Master(0, bytes(6), "TwinCAT"), tuple(each for each, _ in devices), (), {}, None
    )
    return Timeline(tuple(events), (summary,), FileCounts())
