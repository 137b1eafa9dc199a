"""KernelMaster: brings devices up and down by the IgH kernel master."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NoReturn

from catenary import bus
from catenary.errors import CatenaryError, ConfigurationError, NoDeviceError
from catenary.igh.configure import Configuration, configure
from catenary.igh.describe import describe, object_information, read_if_there
from catenary.igh.kernel_access import KernelAccess
from catenary.igh.kernel_cycle import KernelCarrier
from catenary.igh.reservation import Reservation
from catenary.igh.sub_device import SubDevice
from catenary.igh.sync_types import read_types, write_types
from catenary.igh.topology import check_delays
from catenary.model.device import DeviceDescription, Direction, mapped_entries
from catenary.wire.al import AlState

if TYPE_CHECKING:  # plan needs NumPy, a scan does not
    from catenary.bus.diagnosis import Diagnosis
    from catenary.bus.master import MasterOwner
    from catenary.bus.states import Outcome
    from catenary.plan.planner import Plan
    from catenary.plan.request import PdoWish, Wish
    from catenary.plan.start_up import DevicePlan

# [s] An INIT request to a device that fails at that moment may be lost: the master repeats it after
# 5 s (ec_fsm_change_timeout_ms in IgH's master/fsm_change.c). Seen at every second stop.
RESTORE_PATIENCE = 6.0


class KernelMaster:
    """Owns a reserved kernel master while a MainDevice is open on it. Implements `bus.Master`.

    The kernel brings devices up, talks to their mailboxes and leads those back that were away; a
    `Loop` exchanges the process images. Closing the MainDevice gives the master back.
    """

    def __init__(self, main: MasterOwner) -> None:
        self.main = main
        self._kernel = KernelAccess(main)
        self.carrier: KernelCarrier | None = None

    def forget(self) -> None:
        """Let go of the parent's master in a forked child."""
        carrier, self.carrier = self.carrier, None
        if carrier is not None:
            carrier.end()

    @property
    def reservation(self) -> Reservation:
        """The reserved master."""
        return self._kernel.reservation

    def scan(self) -> tuple[Sequence[SubDevice], tuple[str, ...]]:
        """Return the devices that the master has found. It has brought them to PRE-OP.

        Raises:
            NoDeviceError: there are none.
        """
        count = self.reservation.device_count()
        self.reservation.wait_preop()
        found = [describe(self.reservation, position) for position in range(count)]
        if not found:
            raise NoDeviceError(
                f"{self.reservation.name}: the master finds no device",
                hint="check cable and power; ethercat slaves lists what it sees",
            )
        subs = [self._handle(description) for description in found]
        for sub in subs:
            sub.read_state()
        return subs, ()

    def read_mappings(self, wishes: Sequence[Wish], period_ns: int) -> None:
        """Read what is mapped, and how long other wanted objects are."""
        from catenary.plan.planner import gather_wishes

        asked = gather_wishes(wishes, period_ns)
        for sub in self.main.subs:
            renewed = describe(self.reservation, sub.position)
            _check_same(sub.description, renewed)
            objects = [
                object_information(self.reservation, sub.position, index, subindex)
                for index, subindex in _unmapped(renewed, asked.get(sub.position))
                if renewed.coe
            ]
            sub.description = replace(renewed, objects=tuple(objects))

    def read_objects(
        self, wanted: Mapping[int, Sequence[tuple[int, int]]]
    ) -> dict[int, dict[tuple[int, int], bytes]]:
        """Read objects before a loop, one after the other."""
        found: dict[int, dict[tuple[int, int], bytes]] = {}
        for position, places in wanted.items():
            read = {
                place: read_if_there(self.reservation, self._kernel.place_of(position), *place)
                for place in places
            }
            found[position] = {place: data for place, data in read.items() if data}
        return found

    def configure(self, plan: Plan, epoch_ns: int) -> tuple[int | None, ...]:
        """Tells the master the plan and activates it: from here on it waits for cycles."""
        if self.carrier is not None:
            raise ConfigurationError(
                f"{self.reservation.name} is activated already: nothing can be configured any more",
                hint="leave the loop that runs, or main.leave()",
            )
        infos = [self.reservation.slave(sub.position) for sub in self.main.subs]
        if plan.cycle.clock is not None:
            check_delays(infos)
        for sub, device in zip(self.main.subs, plan.devices, strict=True):
            self._keep_sync_types(sub, device)
        found = [sub.description for sub in self.main.subs]
        try:
            configuration = configure(self.reservation, plan, found, epoch_ns)
        except BaseException as error:
            self._undo(error)
            raise
        self.carrier = KernelCarrier(self._kernel, configuration)
        return ()

    def _keep_sync_types(self, sub: bus.SubDevice, plan: DevicePlan) -> None:
        """Read how a device keeps time, before SYNC0 is written to it. Without clocks, write back
        what could not be written when an earlier loop ended."""
        if plan.sync is None:
            self._restore_sync_types(sub)
        elif sub.description.coe and not sub.sync_types:
            sub.sync_types = read_types(self.reservation, sub.position)

    def _undo(self, error: BaseException) -> None:
        """Take back what a configuration that failed has written. Its master was given back and
        reserved again. Further errors are added to `error` as notes."""
        if self.reservation.handle:
            self.reservation.wait_preop(RESTORE_PATIENCE)
            for problem in self._settle():
                error.add_note(f"on the way down: {problem}")

    def leave(self, timeout: float) -> None:
        """End the operation of the master, wait for PRE-OP and restore the synchronisation types.

        The master brings its devices to PRE-OP by itself, within its own times.

        Raises:
            CatenaryError: A device that was synchronised to SYNC0 does not reach PRE-OP, or refuses
                its former type; further ones as notes.
        """
        carrier, self.carrier = self.carrier, None
        if carrier is None:
            return
        carrier.end()
        what = f"deactivating master {self.reservation.index}"
        self.reservation.ask("ecrt_master_deactivate", what=what)
        self.reservation.beside.end()
        if any(sub.sync_types for sub in self.main.subs):
            self.reservation.wait_preop(RESTORE_PATIENCE)
        else:
            self.reservation.wait_preop()
        problems = self._settle()
        if problems:
            for other in problems[1:]:
                problems[0].add_note(f"also: {other}")
            raise problems[0]

    def _settle(self) -> list[CatenaryError]:
        """Read all states and restore all synchronisation types; return what went wrong."""
        problems = []
        for sub in self.main.subs:
            try:
                self._restore_sync_types(sub)
            except CatenaryError as problem:
                problems.append(problem)
        return problems

    def _restore_sync_types(self, sub: bus.SubDevice) -> None:
        """Keep the types of a lost device until it returns."""
        if not self.reservation.has(sub.position, sub.identity):
            sub.state = None
            return
        state = sub.read_state()
        if sub.sync_types:
            write_types(self.reservation, sub.position, sub.sync_types, state)
            sub.sync_types = {}

    def close(self, timeout: float) -> None:
        """Deactivate the master. Giving it back leaves the devices in PRE-OP."""
        try:
            self.leave(timeout)
        except CatenaryError as problem:  # the master must be given back all the same
            warnings.warn(str(problem), RuntimeWarning, stacklevel=4)

    @property
    def configuration(self) -> Configuration:
        """What runs. RuntimeError before a loop is open."""
        if self._kernel.active is None:
            raise RuntimeError("the master is not activated: with Loop(...) as loop:")
        return self._kernel.active

    # What the master keeps to itself

    def passive_scan(self, *, names: bool) -> NoReturn:
        """Raise ConfigurationError: the states of the devices are the master's."""
        self._cannot(
            "look at devices without taking them over",
            "ethercat slaves -v, and states, reg_read, sii_read, alias, graph, crc",
        )

    def diagnose(
        self, subs: Sequence[bus.SubDevice], *, since: Diagnosis | None, lost_frames: int
    ) -> NoReturn:
        """Raise ConfigurationError: the master's own tool reads error counters."""
        self._cannot("read the error counters of all devices", "ethercat crc, ethercat graph CRC")

    def request_states(
        self, devices: Sequence[DeviceDescription], positions: Sequence[int], state: AlState
    ) -> dict[int, Outcome]:
        """Raise ConfigurationError: the master leads the states."""
        self._cannot("request a state of single devices", f"ethercat states {state}")

    def _cannot(self, what: str, command: str) -> NoReturn:
        raise ConfigurationError(f"libethercat cannot {what}", hint=f"its tool does: {command}")

    def _handle(self, description: DeviceDescription) -> SubDevice:
        position = description.position
        known = self.main.subs[position] if position < len(self.main.subs) else None
        if not isinstance(known, SubDevice) or known.identity != description.identity:
            return SubDevice(self.main, self._kernel, description)
        known.description = description
        return known


def _check_same(before: DeviceDescription, now: DeviceDescription) -> None:
    from catenary.bus.segment_scan import check_identity

    check_identity(now, before.identity)


def _unmapped(device: DeviceDescription, wish: PdoWish | None) -> Collection[tuple[int, int]]:
    """Objects wished for that the device has not mapped."""
    if wish is None:
        return ()
    sides = ((Direction.OUTPUT, wish.outputs), (Direction.INPUT, wish.inputs))
    missing: dict[tuple[int, int], None] = {}
    for direction, references in sides:
        mapped = {(e.index, e.subindex) for e in mapped_entries(device.assignments(direction))}
        missing.update(
            ((each.index, each.subindex), None)
            for each in references
            if (each.index, each.subindex) not in mapped
        )
    return tuple(missing)
