"""KernelMaster: state changes and configuration of devices by the IgH kernel master."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NoReturn

from catenary import bus
from catenary.errors import CatenaryError, ConfigurationError, NoDeviceError
from catenary.igh.configure import Configuration, configure
from catenary.igh.describe import describe, object_information, read_if_there, with_module_lists
from catenary.igh.kernel_access import KernelAccess
from catenary.igh.kernel_cycle import KernelCarrier
from catenary.igh.reservation import Reservation
from catenary.igh.sub_device import SubDevice
from catenary.igh.sync_types import read_types, write_types
from catenary.igh.topology import check_delays
from catenary.model.device import DeviceDescription, Direction, mapped_entries
from catenary.wire.al import AlState

if TYPE_CHECKING:  # plan imports NumPy, which a scan does not need
    from catenary.bus.diagnosis import Diagnosis
    from catenary.bus.master import Complete, MasterOwner
    from catenary.bus.states import Outcome
    from catenary.esi.device import EsiDevice
    from catenary.plan.planner import Plan
    from catenary.plan.request import DeviceRequest, ProcessDataRequest
    from catenary.plan.start_up import DevicePlan

# [s] An INIT request may be lost if the device fails at that moment. The master repeats it after
# 5 s (ec_fsm_change_timeout_ms in IgH's master/fsm_change.c). Observed at every second stop.
RESTORE_PATIENCE = 6.0


class KernelMaster:
    """Kernel master that a MainDevice reserves while it is open. Implements `bus.Master`.

    The kernel changes the states of the devices, serves their mailboxes and reconfigures devices
    that return. A `Loop` exchanges the process images. Closing the MainDevice releases the master.
    """

    def __init__(self, main: MasterOwner) -> None:
        self.main = main
        self._kernel = KernelAccess(main)
        self.carrier: KernelCarrier | None = None

    def forget(self) -> None:
        """Drop the parent's master in a forked child."""
        carrier, self.carrier = self.carrier, None
        if carrier is not None:
            carrier.end()

    @property
    def reservation(self) -> Reservation:
        """The reserved master."""
        return self._kernel.reservation

    def scan(self, complete: Complete) -> tuple[Sequence[SubDevice], tuple[str, ...]]:
        """Return the devices that the master has found and brought to PRE-OP.

        Args:
            complete: Function that adds the facts of ESI files to a description.

        Raises:
            NoDeviceError: The master found no device.
        """
        count = self.reservation.device_count()
        self.reservation.wait_preop()
        found = [self._completed(position, complete) for position in range(count)]
        if not found:
            raise NoDeviceError(
                f"{self.reservation.name}: the master found no device",
                hint="check cable and power; ethercat slaves lists the devices it finds",
            )
        subs = [self._handle(description) for description in found]
        for sub in subs:
            sub.read_state()
        notes = tuple(f"{each}: {note}" for each in found for note in each.notes)
        return subs, notes

    def _completed(self, position: int, complete: Complete) -> DeviceDescription:
        """Return the description of a device, with the facts of its ESI and its modules."""
        device = complete(describe(self.reservation, position))
        if device.modular is None:
            return device
        return complete(with_module_lists(self.reservation, device))

    def _with_esi(self, device: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
        from catenary.esi.apply import applied
        from catenary.esi.configured import with_reported_modules

        return with_reported_modules(with_module_lists(self.reservation, applied(device, esi)), esi)

    def read_mappings(self, requests: Sequence[ProcessDataRequest], period_ns: int) -> None:
        """Read the mapped PDOs, and the lengths of requested objects that are not mapped.

        Args:
            requests: The process-data requests of the loop.
            period_ns: The period of the loop.
        """
        from catenary.plan.combination import gather_requests

        asked = gather_requests(requests, period_ns)
        for sub in self.main.subs:
            renewed = describe(self.reservation, sub.position)
            _check_same(sub.description, renewed)
            if sub.esi is not None:
                renewed = self._with_esi(renewed, sub.esi)
            objects = [
                object_information(self.reservation, sub.position, index, subindex)
                for index, subindex in _unmapped(renewed, asked.get(sub.position))
                if renewed.coe
            ]
            sub.description = replace(renewed, objects=tuple(objects))

    def read_objects(
        self, wanted: Mapping[int, Sequence[tuple[int, int]]]
    ) -> dict[int, dict[tuple[int, int], bytes]]:
        """Read objects before a loop starts, one after the other.

        Returns:
            The data of each object that could be read, by position, index and subindex.
        """
        found: dict[int, dict[tuple[int, int], bytes]] = {}
        for position, places in wanted.items():
            read = {
                place: read_if_there(self.reservation, self._kernel.place_of(position), *place)
                for place in places
            }
            found[position] = {place: data for place, data in read.items() if data}
        return found

    def configure(self, plan: Plan, epoch_ns: int) -> tuple[int | None, ...]:
        """Configure the master by the plan and activate it. The loop must then run cycles.

        Args:
            plan: The plan of the loop.
            epoch_ns: Offset from the loop's clock to the application time.

        Raises:
            ConfigurationError: The master is already active.
        """
        if self.carrier is not None:
            raise ConfigurationError(
                f"{self.reservation.name} is already activated: its configuration cannot change",
                hint="leave the running loop, or call main.leave()",
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
        """Save the synchronisation types of a device before a loop with SYNC0.

        For a device without SYNC0, restore the types that an earlier loop could not restore.
        """
        if plan.sync is None:
            self._restore_sync_types(sub)
        elif sub.description.coe and not sub.sync_types:
            sub.sync_types = read_types(self.reservation, sub.position)

    def _undo(self, error: BaseException) -> None:
        """Restore the synchronisation types after a failed configuration.

        The master has been released and reserved again. Further errors become notes of `error`.
        """
        if self.reservation.handle:
            self.reservation.wait_preop(RESTORE_PATIENCE)
            for problem in self._settle():
                error.add_note(f"while leaving operation: {problem}")

    def leave(self, timeout: float) -> None:
        """End the operation of the master, wait for PRE-OP and restore the synchronisation types.

        The master itself brings its devices to PRE-OP, with its own timeouts.

        Raises:
            CatenaryError: A device that was synchronised to SYNC0 does not reach PRE-OP, or refuses
                its former type. Further errors are notes of the first.
        """
        carrier, self.carrier = self.carrier, None
        if carrier is None:
            return
        carrier.end()
        what = f"deactivating master {self.reservation.index}"
        self.reservation.ask("ecrt_master_deactivate", what=what)
        self.reservation.blocking_calls.end()
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
        """Read all states and restore all synchronisation types. Return the errors."""
        problems = []
        for sub in self.main.subs:
            try:
                self._restore_sync_types(sub)
            except CatenaryError as problem:
                problems.append(problem)
        return problems

    def _restore_sync_types(self, sub: bus.SubDevice) -> None:
        """Restore the types of a device. Keep the types of a lost device until it returns."""
        if not self.reservation.has(sub.position, sub.identity):
            sub.state = None
            return
        state = sub.read_state()
        if sub.sync_types:
            write_types(self.reservation, sub.position, sub.sync_types, state)
            sub.sync_types = {}

    def close(self, timeout: float) -> None:
        """Deactivate the master. Its release leaves the devices in PRE-OP."""
        try:
            self.leave(timeout)
        except CatenaryError as problem:  # the master must be released in any case
            warnings.warn(str(problem), RuntimeWarning, stacklevel=4)

    @property
    def configuration(self) -> Configuration:
        """The active configuration.

        Raises:
            RuntimeError: No loop is open.
        """
        if self._kernel.active is None:
            raise RuntimeError("the master is not activated: open a loop first")
        return self._kernel.active

    # Services that libethercat does not offer

    def passive_scan(self, *, names: bool) -> NoReturn:
        """Raise ConfigurationError: the master controls the states of the devices."""
        self._cannot(
            "read devices without reserving the master",
            "ethercat slaves -v, and states, reg_read, sii_read, alias, graph, crc",
        )

    def diagnose(
        self, subs: Sequence[bus.SubDevice], *, since: Diagnosis | None, lost_frames: int
    ) -> NoReturn:
        """Raise ConfigurationError: only the master's own tool reads error counters."""
        self._cannot("read the error counters of all devices", "ethercat crc, ethercat graph CRC")

    def request_states(
        self, devices: Sequence[DeviceDescription], positions: Sequence[int], state: AlState
    ) -> dict[int, Outcome]:
        """Raise ConfigurationError: the master controls the states."""
        self._cannot("request a state of single devices", f"ethercat states {state}")

    def _cannot(self, what: str, command: str) -> NoReturn:
        raise ConfigurationError(f"libethercat cannot {what}", hint=f"use IgH's tool: {command}")

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


def _unmapped(
    device: DeviceDescription, request: DeviceRequest | None
) -> Collection[tuple[int, int]]:
    """Return the requested objects that the device has not mapped."""
    if request is None:
        return ()
    sides = ((Direction.OUTPUT, request.outputs), (Direction.INPUT, request.inputs))
    missing: dict[tuple[int, int], None] = {}
    for direction, references in sides:
        mapped = {(e.index, e.subindex) for e in mapped_entries(device.assignments(direction))}
        missing.update(
            ((each.index, each.subindex), None)
            for each in references
            if (each.index, each.subindex) not in mapped
        )
    return tuple(missing)
