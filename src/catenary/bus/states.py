"""State requests for single devices outside a loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias, TypeVar

from catenary.bus.runner import BlockingRunner
from catenary.errors import CatenaryError
from catenary.model.device import DeviceDescription
from catenary.plan.planner import make_plan
from catenary.procedure.al_state import DeviceState, read_state, request_state
from catenary.procedure.exchange import Procedure
from catenary.procedure.state_path import bring_to_safe_op, climb, restart
from catenary.procedure.station import Station, station_of
from catenary.wire.al import AlState

T = TypeVar("T")
Outcome: TypeAlias = DeviceState | CatenaryError


def request_states(
    runner: BlockingRunner,
    devices: Sequence[DeviceDescription],
    positions: Iterable[int],
    target: AlState,
) -> dict[int, Outcome]:
    """Bring devices to a state; a failed device does not affect the others.

    For SAFE-OP and OP, a device below SAFE-OP passes through INIT and is configured with its
    current mapping, by a plan for all devices. OP is requested without process data, which devices
    with outputs refuse.

    Args:
        runner: Runner of the procedures.
        devices: All devices of the segment.
        positions: Positions of the devices to change.
        target: Requested state.

    Returns:
        By position, the reached state or the error.
    """
    chosen = {position: devices[position] for position in positions}
    if target in (AlState.INIT, AlState.PRE_OP, AlState.BOOT):
        return _run(runner, {p: _climb(device, target) for p, device in chosen.items()})
    failed = _configure(runner, devices, _below_safe_op(runner, chosen))
    asked = {p: request_state(_station(d), target) for p, d in chosen.items() if p not in failed}
    return {**failed, **_run(runner, asked)}


def _below_safe_op(runner: BlockingRunner, chosen: Mapping[int, DeviceDescription]) -> list[int]:
    states = _run(runner, {p: read_state(_station(device)) for p, device in chosen.items()})
    above = (AlState.SAFE_OP, AlState.OP)
    return [p for p, now in states.items() if isinstance(now, Exception) or now.state not in above]


def _configure(
    runner: BlockingRunner, devices: Sequence[DeviceDescription], positions: Iterable[int]
) -> dict[int, CatenaryError]:
    """Bring devices through INIT to SAFE-OP. Return the errors of those that failed."""
    started = {p: restart(_station(devices[p]), devices[p]) for p in positions}
    ready, failed = _parted(_run(runner, started))
    plan = make_plan([ready.get(device.position, device) for device in devices])
    climbing = {
        p: bring_to_safe_op(_station(device), device, plan.devices[p])
        for p, device in ready.items()
    }
    return failed | _parted(_run(runner, climbing))[1]


def _run(
    runner: BlockingRunner, procedures: Mapping[int, Procedure[T]]
) -> dict[int, T | CatenaryError]:
    """Run procedures at the same time. Return an error in place of a result."""
    outcomes = runner.run_all([_attempt(each) for each in procedures.values()])
    return dict(zip(procedures, outcomes, strict=True))


def _attempt(procedure: Procedure[T]) -> Procedure[T | CatenaryError]:
    try:
        return (yield from procedure)
    except CatenaryError as error:
        return error


def _parted(
    outcomes: Mapping[int, T | CatenaryError],
) -> tuple[dict[int, T], dict[int, CatenaryError]]:
    good: dict[int, T] = {}
    bad: dict[int, CatenaryError] = {}
    for position, outcome in outcomes.items():
        if isinstance(outcome, CatenaryError):
            bad[position] = outcome
        else:
            good[position] = outcome
    return good, bad


def _climb(device: DeviceDescription, target: AlState) -> Procedure[DeviceState]:
    station = _station(device)
    yield from climb(station, device, target)
    return (yield from read_state(station))


def _station(device: DeviceDescription) -> Station:
    return station_of(device)
