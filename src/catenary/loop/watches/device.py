"""Watch of the devices of a running loop: it tracks lost, faulted and returning devices.

The watch is one endless procedure in the acyclic queue. While all devices are in OP, the watch only
reads a flag of the core. Otherwise it queries all devices, reports changes as events, and
brings optional devices back to OP. The failure of a required device ends the loop. The watch only
reports it (docs/explanation/safety.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

from catenary.bus import MainDevice, SubDevice
from catenary.bus.event_types import (
    DeviceHeld,
    DeviceLost,
    DeviceReplaced,
    DeviceReturned,
    StateLost,
)
from catenary.bus.pending import Pending
from catenary.errors import CatenaryError
from catenary.link import ring_of
from catenary.loop.cycle_errors import described
from catenary.loop.options import StopPolicy
from catenary.loop.watches.ring import RingWatch
from catenary.model.device import Identity
from catenary.model.device_matching import vacancies
from catenary.plan.planner import Plan
from catenary.plan.start_up import DevicePlan
from catenary.procedure import restore
from catenary.procedure.al_state import request_state
from catenary.procedure.al_status_poll import Answer, survey
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.pdo import write_in_safe_op
from catenary.procedure.register_commands import run_commands
from catenary.wire.al import ERROR_FLAG, STATE_MASK, AlState

Submit = Callable[[Procedure[None]], Pending[None]]

LOOK = 0.010  # [s] between two reads of the core's flag, and between two surveys
STRANGERS_MAX = 16  # largest number of additional devices that are distinguished
FAILURES_MAX = 3  # largest number of attempts to bring a device back after a return


class Attendance(Protocol):
    """Watch of the devices of a running loop."""

    @property
    def excuses(self) -> bool: ...
    def run(self) -> Procedure[None]: ...
    def requires(self, position: int) -> bool: ...
    def release(self, sub: SubDevice) -> None: ...


class Standing(Enum):
    """State of a device in the watch."""

    RUNNING = "running"
    LOST = "lost"  # does not answer
    ASTRAY = "astray"  # answers to its station address, but is out of OP
    RETURNING = "returning"  # a procedure brings it to OP, or to PRE-OP to hold it
    HELD = "held"  # waits for `release`


@dataclass(slots=True)
class Charge:
    """State of one device in the watch."""

    sub: SubDevice
    plan: DevicePlan
    required: bool
    identity: Identity  # of the expected device: the planned one, or an accepted replacement
    standing: Standing = Standing.RUNNING
    task: Pending[None] | None = None
    failures: int = 0
    unread: int = 0  # failed attempts to read the identity of the device in its place
    released: bool = False


def required_positions(plan: Plan) -> frozenset[int]:
    """Return the positions of the required devices.

    If all exchanged devices are optional, no device is required, not even a coupler before them.
    """
    units = plan.cycle.sync_units
    if units and all(unit.optional for unit in units):
        return frozenset()
    optional = {position for unit in units if unit.optional for position in unit.devices}
    return frozenset(device.position for device in plan.devices) - optional


class Watch:
    """Watch of the devices of one network, with the state of each device."""

    def __init__(
        self,
        main: MainDevice,
        plan: Plan,
        *,
        disturbed: Callable[[], bool],
        submit: Submit,
        now: Callable[[], float],
        rejoin: Callable[[int, DevicePlan], Procedure[None]] | None = None,
        cables_seen: Callable[[], None] = lambda: None,
        policy: StopPolicy = StopPolicy(),
    ) -> None:
        required = required_positions(plan)
        self._charges = [
            Charge(sub, device, device.position in required, device.identity)
            for sub, device in zip(main.subs, plan.devices, strict=True)
        ]
        self._all_required = all(charge.required for charge in self._charges)
        self._disturbed = disturbed
        self._submit = submit
        self._report = main.events.put
        self._now = now
        self._rejoin = rejoin
        self._cables_seen = cables_seen
        self._policy = policy
        ring = ring_of(main.link)
        self._ring = (
            None
            if ring is None
            else RingWatch(ring, len(self._charges), report=self._report, now=now)
        )
        self._unsettled = False  # True if a device was not running at the last survey
        self._strangers: set[tuple[int, Identity]] = set()

    def run(self) -> Procedure[None]:
        """Watch the devices until cancelled."""
        while True:
            if self._ring is not None:
                self._ring.look()
                self._cables_seen()
            if self._disturbed() or self._unsettled:
                yield from self._survey()
                self._unsettled = any(c.standing is not Standing.RUNNING for c in self._charges)
            yield after(LOOK)

    @property
    def excuses(self) -> bool:
        """True if the loop may continue although a device is out of OP.

        As of the last survey, only optional devices are lost or out of OP. The value is at most
        `LOOK` old.
        """
        return not self._all_required and all(
            charge.standing not in (Standing.ASTRAY, Standing.LOST)
            for charge in self._charges
            if charge.required
        )

    def requires(self, position: int) -> bool:
        """Return True if the loss of this device ends the loop."""
        return self._charges[position].required

    def release(self, sub: SubDevice) -> None:
        """Allow a held device to go to OP."""
        charge = self._charges[sub.position]
        charge.released, charge.failures = True, 0

    # One survey

    def _survey(self) -> Procedure[None]:
        answers = yield from survey([charge.sub.station for charge in self._charges])
        for charge, answer in zip(self._charges, answers, strict=True):
            self._judge(charge, answer)
        if any(charge.standing is Standing.LOST for charge in self._optional()):
            yield from self._find_returned()
        for charge in self._optional():
            if charge.standing is Standing.ASTRAY:
                self._start_return(charge, self._back_to_op(charge))
            elif charge.standing is Standing.HELD and charge.released:
                charge.released = False
                self._start_return(charge, self._restored(charge))

    def _optional(self) -> Iterator[Charge]:
        return (charge for charge in self._charges if not charge.required)

    def _judge(self, charge: Charge, answer: Answer) -> None:
        """Update the state of a device from one answer, and report the change.

        Args:
            charge: State of the device.
            answer: Its answer to a read of the AL status.
        """
        task = charge.task
        if charge.standing is Standing.RETURNING and task is not None:
            if not task.done:
                return
            self._conclude(charge, task)
        if answer.word is None:
            self._set_lost(charge)
        elif answer.word & (STATE_MASK | ERROR_FLAG) == AlState.OP:
            if charge.standing is Standing.LOST and not self._may_return(charge):
                self._handle_return(charge)  # it will be held, although it has never left OP
            elif charge.standing is not Standing.HELD:
                self._set_running(charge)
        elif charge.standing is Standing.RUNNING:
            charge.standing = Standing.ASTRAY
            charge.sub.state = None
            state = answer.word & STATE_MASK
            message = f"{described(answer)}, out of OP"
            self._report(
                StateLost(self._now(), charge.sub, message, int(AlState.OP), state, answer.code)
            )
        elif charge.standing is Standing.LOST:
            # Only the cable was pulled. The device kept its address, and its watchdog stopped it.
            self._handle_return(charge)

    def _set_lost(self, charge: Charge) -> None:
        if charge.standing in (Standing.RUNNING, Standing.ASTRAY, Standing.HELD):
            self._report(
                DeviceLost(
                    self._now(), charge.sub, f"{charge.sub.station} does not answer any more"
                )
            )
        charge.standing, charge.failures, charge.sub.state = Standing.LOST, 0, None

    def _set_running(self, charge: Charge) -> None:
        if charge.standing is Standing.LOST:
            self._report_returned(charge)
        charge.standing, charge.failures, charge.sub.state = Standing.RUNNING, 0, AlState.OP

    def _report_returned(self, charge: Charge) -> None:
        message = f"{charge.sub.station} answers again"
        self._report(DeviceReturned(self._now(), charge.sub, message))

    def _conclude(self, charge: Charge, task: Pending[None]) -> None:
        """Evaluate the ended procedure that was to bring a device back."""
        charge.task = None
        charge.standing = Standing.ASTRAY
        if task.error is None:
            return
        if not isinstance(task.error, CatenaryError):
            raise task.error
        charge.failures += 1
        if charge.failures >= FAILURES_MAX:
            self._hold(charge, f"it could not be brought back: {task.error.message}")

    def _hold(self, charge: Charge, reason: str) -> None:
        charge.standing = Standing.HELD
        state = int(charge.sub.state) if charge.sub.state is not None else 0
        message = f"{charge.sub.station} is held: {reason}"
        self._report(DeviceHeld(self._now(), charge.sub, message, state, reason))

    def _start_return(self, charge: Charge, conversation: Procedure[None]) -> None:
        charge.standing = Standing.RETURNING
        charge.task = self._submit(conversation)

    # Return of devices

    def _find_returned(self) -> Procedure[None]:
        """Find returned devices without a valid address, and assign them to vacant places."""
        present = yield from restore.find_devices(len(self._charges) + STRANGERS_MAX)
        known = [charge.plan.station_address for charge in self._charges]
        free = vacancies([presence.station_address for presence in present], known)
        taken: set[int] = set()
        for rank, places in free.items():
            lost = [
                self._charges[place]
                for place in places
                if place not in taken and self._charges[place].standing is Standing.LOST
            ]
            charge = yield from self._recognise(present[rank], lost)
            if charge is not None:
                taken.add(charge.plan.position)
                self._handle_return(charge)

    def _recognise(
        self, presence: restore.Presence, lost: Sequence[Charge]
    ) -> Procedure[Charge | None]:
        """Give a returned device the address of its place, and return the state of this place.

        If the device has no place here, is unreadable, or is a replacement that is held, remove its
        address and return None.
        """
        found: Identity | None = None
        for charge in lost:
            if charge.sub.alias and charge.sub.alias != presence.alias:
                continue
            station = charge.sub.station
            try:
                if found is None:
                    yield from restore.give_address(presence, station)
                    found = yield from restore.identify(station)
                elif found.same_kind(charge.plan.identity):
                    yield from restore.give_address(presence, station)
            except CatenaryError as error:
                # It is lost again, or unreadable. It must not keep the address of the former one.
                yield from restore.forget_address(presence)
                self._note_unread(charge, error)
                return None
            if found.same_kind(charge.plan.identity):
                if found.serial == charge.identity.serial:
                    return charge
                return (yield from self._handle_replacement(charge, presence, found))
        yield from restore.forget_address(presence)
        if lost and found is not None:
            self._report_replaced(lost[0], presence, found)
        return None

    def _note_unread(self, charge: Charge, error: CatenaryError) -> None:
        """Report once that the identity of a device was unreadable FAILURES_MAX times."""
        charge.unread += 1
        if charge.unread == FAILURES_MAX:
            reason = f"the identity of the device in its place cannot be read: {error.message}"
            message = f"{charge.sub.station} is held: {reason}"
            self._report(DeviceHeld(self._now(), charge.sub, message, 0, reason))

    def _handle_replacement(
        self, charge: Charge, presence: restore.Presence, found: Identity
    ) -> Procedure[Charge | None]:
        """Report a replacement: the same product with another serial number.

        Return `charge` if it is accepted. Otherwise, remove its address and return None.
        """
        self._report_replaced(charge, presence, found)
        if self._policy.on_replacement == "restore" or charge.released:
            charge.identity = found  # the place now belongs to this device
            self._strangers = {each for each in self._strangers if each[0] != charge.plan.position}
            return charge
        yield from restore.forget_address(presence)
        return None

    def _report_replaced(self, charge: Charge, presence: restore.Presence, found: Identity) -> None:
        """Put the event once for each device that is in a wrong place."""
        if (charge.plan.position, found) in self._strangers:
            return
        self._strangers.add((charge.plan.position, found))
        expected = charge.identity
        message = f"{charge.sub.station} was replaced: found {found} instead of {expected}"
        self._report(DeviceReplaced(self._now(), charge.sub, message, expected, found))

    def _handle_return(self, charge: Charge) -> None:
        """Bring back or hold a device that was lost and has its address again."""
        charge.unread = 0
        self._report_returned(charge)
        if self._may_return(charge):
            charge.released = False
            self._start_return(charge, self._restored(charge))
        else:
            self._start_return(charge, self._waiting(charge))

    def _may_return(self, charge: Charge) -> bool:
        return self._policy.on_return == "restore" or charge.released or charge.required

    def _back_to_op(self, charge: Charge) -> Procedure[None]:
        """Request OP, as the configuration is usually intact. After a failure, start from INIT."""
        if charge.failures == 0:
            yield from write_in_safe_op(charge.sub.channel, charge.plan)
            yield from run_commands(charge.sub.station, charge.plan.registers, "SO")
            yield from request_state(charge.sub.station, AlState.OP)
        else:
            yield from self._restored(charge)

    def _restored(self, charge: Charge) -> Procedure[None]:
        """Configure the device from INIT on, and bring it to OP."""
        sub, plan = charge.sub, charge.plan
        yield from restore.bring_to_pre_op(sub.station, sub.channel, plan.registers)
        sub.state = AlState.PRE_OP
        clock = self._rejoin(plan.position, plan) if self._rejoin is not None else None
        yield from restore.bring_to_safe_op(sub.station, sub.channel, sub.description, plan, clock)
        sub.state = AlState.SAFE_OP
        yield from request_state(sub.station, AlState.OP)

    def _waiting(self, charge: Charge) -> Procedure[Any]:
        """Bring the device to PRE-OP, and hold it there."""
        yield from restore.bring_to_pre_op(
            charge.sub.station, charge.sub.channel, charge.plan.registers
        )
        charge.sub.state = AlState.PRE_OP
        self._hold(charge, 'on_return="hold"')
