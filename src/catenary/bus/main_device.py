"""MainDevice: the link to one segment and the handles of its devices."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Self, TypeVar

from catenary.bus import event_types
from catenary.bus.esi_source import EsiPlace, EsiSource, open_source, unchanged
from catenary.bus.event_queue import Callback, Callbacks, Events
from catenary.bus.external_master import Carrier
from catenary.bus.frame_master import FrameMaster
from catenary.bus.master import Complete, Master, MasterSource
from catenary.bus.pending import Pending
from catenary.bus.runner import BUSY_WAIT, BlockingRunner, FrameCounts, LinkLent, Runner, Watch
from catenary.bus.sdo import Objects
from catenary.bus.segment_eoe import SegmentEoe
from catenary.bus.segment_scan import check_identity
from catenary.bus.sub_device import SubDevice
from catenary.bus.sub_devices import SubDevices
from catenary.errors import CatenaryError, EsiError, SegmentError
from catenary.link import (
    Link,
    LinkSource,
    Ownership,
    forget_in_child,
    lives_in_virtual_time,
    other_sockets,
)
from catenary.model.device import Identity
from catenary.procedure.exchange import Procedure
from catenary.wire.al import AlState

if TYPE_CHECKING:  # plan imports NumPy, which a scan does not need
    from catenary.bus.diagnosis import Diagnosis
    from catenary.bus.states import Outcome
    from catenary.plan.cycle import ExecutionMode, ReceiveMode
    from catenary.plan.planner import Plan
    from catenary.plan.request import ProcessDataRequest

T = TypeVar("T")

EPOCH_2000_NS = 946_684_800_000_000_000  # 2000-01-01 in Unix time
LEAVE_TIMEOUT = 0.5  # [s] for each state change; short, because the segment may be broken


class MainDevice:
    """Link to one segment, and the handles of its devices.

        with MainDevice(Interface("eth0")) as main:
            for sub in main.scan():
                print(sub.position, sub.name, sub.identity)

    Leaving the block brings all devices of the last `scan` to INIT, if they can be reached.

    It is the only MainDevice on its network interfaces: opening fails while another master is live,
    unless `force=True`. A forked child cannot use it and does not change its devices.
    """

    def __init__(self, source: LinkSource, *, force: bool = False) -> None:
        self.subs = SubDevices()  # devices of the last scan
        self.notes: tuple[str, ...] = ()  # irregularities found by the last scan
        self.clock_delays_ns: tuple[int | None, ...] = ()  # from the first clock, by position
        self.clock_epoch_ns = 0  # system time of the clocks minus link time
        self.events = Events()  # iterate over it, or call get(timeout=)
        self.eoe = SegmentEoe(self)  # Ethernet ports of the devices
        self._callbacks = callbacks = Callbacks()
        events = self.events
        events.listen(lambda each: callbacks.report(events.stamped(each)))
        self._source = source
        self._force = force
        self._ownership: Ownership | None = None
        self._process = 0  # ID of the process that opened the link
        self._link: Link | None = None
        self._blocking: BlockingRunner | None = None
        self._attached: Runner | None = None
        self._leave_loop: Callable[[], object] | None = None  # ends the running loop
        # of the running loop: returns the axes that have power
        self._powered: Callable[[], Sequence[str]] | None = None
        self.master: Master = (
            source.make_master(self)
            if isinstance(source, MasterSource)
            else FrameMaster(self, force=force)
        )

    @property
    def link(self) -> Link:
        """The open link. Raises RuntimeError if no link is open, and in a forked child."""
        if self._link is None or self._is_inherited:
            raise self._not_open()
        return self._link

    @property
    def source(self) -> LinkSource:
        """Source of the link, such as an interface or a virtual segment."""
        return self._source

    def replace_link(self, link: Link) -> None:
        """Send and receive through another link from now on, such as a recorder of the present one.

        Args:
            link: An open link to the same segment. `close` closes it.

        Raises:
            RuntimeError: A loop runs, or the MainDevice is not open.
        """
        self.runner.replace_link(link)
        self._link = link

    @property
    def is_open(self) -> bool:
        """True while the link is open."""
        return self._link is not None

    @property
    def has_loop(self) -> bool:
        """True while a loop runs on this MainDevice."""
        return self._attached is not None

    @property
    def carrier(self) -> Carrier | None:
        """External master that exchanges the images; None if the loop sends its own frames."""
        return self.master.carrier

    @property
    def counts(self) -> FrameCounts:
        """Frame counts outside a loop. Raises RuntimeError under the conditions of `runner`."""
        return self.runner.counts

    def open(self) -> Self:
        """Open the link and return the MainDevice. No frame is sent.

        On a network interface, listen for another master for 0.1 s. No effect if the link is open.

        Raises:
            LinkError: The link cannot be used, or another master is live on it, unless `force`.
        """
        self.forget()
        if self._link is not None:
            return self
        link = self._source.open_link()
        try:
            self._ownership = Ownership(link, force=self._force)
        except BaseException:
            link.close()
            raise
        self._link = link
        self._process = os.getpid()
        self._callbacks.in_thread = not lives_in_virtual_time(link)
        busy_wait = 0.0 if lives_in_virtual_time(link) else BUSY_WAIT
        self._blocking = BlockingRunner(link, busy_wait=busy_wait)
        forget_in_child(self)
        return self

    def forget(self) -> None:
        """Release the parent's link and devices in a forked child. No frame is sent.

        No effect in the process that opened the link.
        """
        if not self._is_inherited:
            return
        self.master.forget()
        self._link = self._blocking = self._attached = self._leave_loop = self._powered = None
        if self._ownership is not None:
            self._ownership.release()

    @property
    def _is_inherited(self) -> bool:
        """True in a process that was forked while the link was open."""
        return self._process not in (0, os.getpid())

    def _not_open(self) -> RuntimeError:
        if self._is_inherited:
            return RuntimeError(
                f"the MainDevice was opened by process {self._process}: a forked child cannot use "
                "it; use it in the parent, or open a new MainDevice after the parent has closed it"
            )
        return RuntimeError("the MainDevice is not open: use it in a with block")

    @property
    def other_masters(self) -> tuple[str, ...]:
        """Evidence of another master on the network interfaces, as text.

        This is the evidence found when the link was opened with `force`. If there is none, each
        access checks for packet sockets of other programs.
        """
        if self._link is None or self._ownership is None:
            return ()
        return self._ownership.others or other_sockets(self._link)

    def close(self) -> None:
        """End a running loop, bring the devices to INIT, and close the link.

        Only the devices of the last `scan` are brought to INIT, if they can be reached. A forked
        child only releases the parent's link; no frame is sent.
        """
        self.forget()
        if self._link is None:
            return
        try:
            self.eoe.close()  # its threads use the link
            if self._leave_loop is not None:
                self._leave_loop()  # an open loop must not continue without its link
            if self.subs:
                with contextlib.suppress(CatenaryError):  # the segment may be unreachable
                    self._detach()
                    self.master.close(LEAVE_TIMEOUT)
        finally:
            self._release()

    def _release(self) -> None:
        link, self._link, self._blocking, self._attached = self.link, None, None, None
        try:
            link.close()
        finally:
            if self._ownership is not None:  # last: the next owner must not find our socket
                self._ownership.release()
            self._callbacks.close()

    def on_event(self, callback: Callback) -> None:
        """Call `callback(event)` for every event from now on, in addition to `events`.

        The callback runs in a separate thread and may read and write objects. In virtual time, it
        runs in the thread that advances the time, between two steps. Its exceptions are logged.
        """
        self._callbacks.add(callback)

    def mark(self, message: str, *, time: float | None = None) -> None:
        """Put a `Marker` event, which is shared and recorded like all events.

        Any thread may call it. It never waits.

        Args:
            message: Text of the marker.
            time: Time on the link's clock (`time.monotonic()` on a NIC) [s]; None for now.
        """
        when = self.link.now() * 1e-9 if time is None else float(time)
        self.events.put(event_types.Marker(when, None, message))

    def deliver_events(self) -> None:
        """In virtual time, call the callbacks with the pending events.

        In real time, a thread calls them.
        """
        self._callbacks.deliver()

    def scan(
        self,
        *,
        expected: Sequence[Identity | tuple[int, int] | None] | None = None,
        strict: bool = True,
        esi: EsiPlace = None,
        settings: Complete = unchanged,
    ) -> SubDevices:
        """Find all devices, bring them to PRE-OP, and update `subs` and `notes`.

        A handle is kept if its position has a device with the same identity. A device that cannot
        be read or brought to PRE-OP does not affect the others. Devices that another program left
        in SAFE-OP or OP are reset, and `notes` names them.

        Args:
            expected: By position, an identity or (vendor, product); None accepts any device.
            strict: If True, raise the first error of a device, with further errors as notes; `subs`
                still has all handles. If False, store each error in `SubDevice.error`, and raise it
                when the device is used.
            esi: ESI file, folder of ESI files, `Library`, or a list of these, the preferred one
                first. None: the user's library (`catenary esi`), if it exists. False: no ESI files.
                `SubDevice.esi` has the description of each device; `notes` has contradictions.
            settings: Function that changes the description of each device before PRE-OP, after its
                ESI was used. `cat.Machine` adds the commands of an ENI with it.

        Returns:
            All devices, by position.

        Raises:
            RuntimeError: A loop runs, or the MainDevice is not open.
            LinkError: Another master refreshes the outputs of a device, unless `force`.
            NoDeviceError: No device answers.
            IdentityError: A device is not the expected one.
            SegmentError: The number of devices is not the expected one.
            EsiError: `esi` cannot be read, or describes none of the devices.
        """
        self.require_no_loop()
        source = open_source(esi)
        complete = unchanged if source is None else source.complete
        subs, self.notes = self.master.scan(lambda device: settings(complete(device)))
        self.subs = SubDevices(subs)
        self._keep_esi(source, strict=strict)
        self._note_further_errors()
        self.deliver_events()
        if strict:
            self._raise_errors()
        if expected is not None:
            self._check_expected(expected)
        return self.subs

    def _keep_esi(self, source: EsiSource | None, *, strict: bool) -> None:
        """Store the ESI of each device. Check that given ESI files were used."""
        for sub in self.subs:
            sub.esi = None if source is None else source.found.get(sub.position)
        if source is None:
            return
        self.notes += source.notes
        try:
            source.check_used([sub.description for sub in self.subs])
        except EsiError as error:
            if strict:
                raise
            self.notes += (error.message,)

    def passive_scan(self, *, names: bool = True) -> SubDevices:
        """Read the devices without changing a state or mapping, for diagnosis.

        Devices without a unique station address get one. `subs` does not change, and `close` leaves
        these devices in their states. Raises RuntimeError while a loop runs.

        Args:
            names: True to also read the EEPROMs. If False, devices have no name or identity.
        """
        found = self.master.passive_scan(names=names)
        return SubDevices([SubDevice(self, each, None) for each in found])

    def request_states(
        self, subs: Sequence[SubDevice], positions: Sequence[int], state: AlState
    ) -> dict[int, Outcome]:
        """Bring devices to a state and leave them there.

        Do not call this while a loop runs.

        Args:
            subs: All devices of the segment, from `scan` or `passive_scan`.
            positions: Positions of the devices to change.
            state: Requested state.

        Returns:
            By position, the reached state or the error.
        """
        return self.master.request_states([sub.description for sub in subs], positions, state)

    def diagnose(
        self,
        *,
        since: Diagnosis | None = None,
        subs: Sequence[SubDevice] | None = None,
        lost_frames: int = 0,
    ) -> Diagnosis:
        """Read the error counters and states of all devices, and locate faults.

        Faults are located in cables, devices and the power supply. The call sends a few frames.
        While a loop runs, call it from another thread.

        Args:
            since: Earlier diagnosis to count from. The counts are from power-up if this is None or
                has another number of devices, and for devices that were silent then.
            subs: Devices of a `passive_scan`; None for those of the last `scan`.
            lost_frames: Number of frames lost or damaged in the same time span.
        """
        chosen = self.subs if subs is None else subs
        return self.master.diagnose(chosen, since=since, lost_frames=lost_frames)

    def plan(
        self,
        *requests: ProcessDataRequest,
        period: float = 1e-3,
        execution: ExecutionMode = "threaded",
        receive_mode: ReceiveMode = "wait",
        optional: Collection[int] = (),
        watchdog: float | None = None,
    ) -> Plan:
        """Return a printable plan for these requests, from the current mapping of the devices.

        The devices must be in PRE-OP. Their descriptions are updated (`read_mappings`), but nothing
        is written to them. For further options, call `read_mappings` and then
        `catenary.plan.make_plan` with `PlanOptions`.

        Args:
            requests: `Drives`, `Inputs`, `Outputs` and other process-data requests.
            period: Period of the cycle [s].
            execution: "threaded" or "inline", as for `Loop`.
            receive_mode: "poll", "wait" or "busy", as `Scheduling.receive`.
            optional: Positions of devices that may be absent.
            watchdog: Watchdog time [s], as for `Loop`.

        Raises:
            CatenaryError: A device did not reach PRE-OP in the scan, or cannot be read.
            MappingError: A device cannot map an object.
            ConfigurationError: The requests contradict each other or do not fit into the period.
            ValueError: An option is out of its range.
        """
        from catenary.plan.options import PlanOptions
        from catenary.plan.planner import make_plan

        self.read_mappings(*requests, period=period)
        options = PlanOptions(
            period=period,
            execution=execution,
            receive_mode=receive_mode,
            optional=optional,
            watchdog=watchdog,
        )
        return make_plan([sub.description for sub in self.subs], requests, options)

    def read_mappings(self, *requests: ProcessDataRequest, period: float = 1e-3) -> None:
        """Update the mappings and the requested objects in the descriptions of the devices.

        Args:
            *requests: Process-data requests.
            period: Period of the cycle [s].

        Raises:
            CatenaryError: A device did not reach PRE-OP in the scan, or cannot be read. This is
                its error.
            ValueError: The period is out of its range.
        """
        self._raise_errors()
        from catenary.plan.options import period_in_ns

        self.master.read_mappings(requests, period_in_ns(period))

    def configure(self, plan: Plan) -> None:
        """Configure every device as planned and bring all to SAFE-OP.

        This updates `clock_epoch_ns` and `clock_delays_ns`. Raises RuntimeError while a loop runs.
        """
        self.require_no_loop()
        self.clock_epoch_ns = self._epoch_ns()
        self.clock_delays_ns = self.master.configure(plan, self.clock_epoch_ns)

    def leave(self, *, timeout: float = LEAVE_TIMEOUT) -> None:
        """End operation: take the link back from the loop, and bring all devices to PRE-OP.

        Args:
            timeout: Timeout for each state change [s]. The kernel master uses its own timeout.

        Raises:
            StateError: A device does not leave its state.
        """
        self._detach()
        self.master.leave(timeout)

    def read_objects(self, wanted: Mapping[int, Sequence[tuple[int, int]]]) -> dict[int, Objects]:
        """Read objects of several devices before a loop starts.

        Args:
            wanted: (index, subindex) of the objects, by position.

        Returns:
            By position, the bytes of each object; refused objects are omitted.
        """
        return self.master.read_objects(wanted)

    def converse(self, procedure: Procedure[T], watch: Watch | None = None) -> T:
        """Run a procedure, wait for its end, and return its result or raise its error.

        While a loop runs, use its acyclic queue. Without a loop, events are delivered afterwards
        (`deliver_events`).

        Args:
            procedure: The procedure to run.
            watch: Function that is called in this thread while it waits. It must not send requests.

        Raises:
            RuntimeError: The caller is the thread of the loop, or the MainDevice is not open.
        """
        while True:
            runner = self._any_runner
            try:
                return runner.run(procedure, watch)
            except LinkLent:
                continue  # a loop has begun in another thread: use its queue
            finally:
                if self._attached is None:
                    self.deliver_events()

    def request(self, procedure: Procedure[T]) -> Pending[T]:
        """Start a procedure in the acyclic queue of the running loop, and return its handle.

        Without a loop, wait for the end of the procedure.
        """
        while True:
            runner = self._any_runner
            with contextlib.suppress(LinkLent):
                return runner.submit(procedure)

    def require_no_loop(self) -> None:
        """Raise RuntimeError while a loop runs on this MainDevice."""
        if self._attached is not None:
            raise RuntimeError(
                "a loop runs on this MainDevice: leave its with block or close() it first (in a "
                "notebook, before you run its cell again)"
            )

    @property
    def powered_axes(self) -> Sequence[str] | None:
        """Names of the axes that have power, or are requested to be enabled.

        The states are those of the last iteration of the loop. None if no loop runs, or it does not
        report its axes.
        """
        powered = self._powered
        return None if powered is None else powered()

    @contextlib.contextmanager
    def attached(
        self,
        runner: Runner,
        leave: Callable[[], object] | None = None,
        powered: Callable[[], Sequence[str]] | None = None,
    ) -> Iterator[None]:
        """Within the block, pass procedures to the runner of a loop and refuse scans.

        Entering waits for the procedures of other threads, because the loop needs exclusive use of
        the link.

        Args:
            runner: Runner of the loop.
            leave: Function that ends the loop.
            powered: Function that returns the axes that have power.
        """
        self.require_no_loop()
        blocking = self.runner
        self._attached, self._leave_loop, self._powered = runner, leave, powered
        blocking.lend()
        try:
            yield
        finally:
            self._detach()

    def _detach(self) -> None:
        if self._blocking is not None:
            self._blocking.take_back()
        self._attached = self._leave_loop = self._powered = None

    @property
    def _any_runner(self) -> Runner:
        """Runner of the running loop; without a loop, that of this MainDevice."""
        if self._is_inherited:
            raise self._not_open()
        return self._attached or self.runner

    @property
    def runner(self) -> BlockingRunner:
        """Runner of procedures outside a loop.

        Raises RuntimeError while a loop runs, if the link is not open, and in a forked child.
        """
        if self._blocking is None or self._is_inherited:
            raise self._not_open()
        self.require_no_loop()
        return self._blocking

    def _raise_errors(self) -> None:
        """Raise the first error of the scan, if any."""
        for sub in self.subs:
            if sub.error is not None:
                raise sub.error

    def _note_further_errors(self) -> None:
        errors = [sub.error for sub in self.subs if sub.error is not None]
        for other in errors[1:]:
            errors[0].add_note(f"also: {other}")

    def _epoch_ns(self) -> int:
        """Return EtherCAT time minus link time [ns]. EtherCAT time counts from 2000.

        ETG.1000.4 §6.8. In virtual time, return 0, so that runs are repeatable.
        """
        if lives_in_virtual_time(self.link):
            return 0
        return time.time_ns() - EPOCH_2000_NS - self.link.now()

    def _check_expected(self, expected: Sequence[Identity | tuple[int, int] | None]) -> None:
        if len(expected) != len(self.subs):
            raise SegmentError(
                f"{len(expected)} devices expected, {len(self.subs)} found",
                hint="check for a device without power or a loose cable",
            )
        for sub, wanted in zip(self.subs, expected, strict=True):
            if wanted is not None:
                check_identity(sub.description, Identity(*(*wanted, 0, 0)[:4]))

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def __repr__(self) -> str:
        name = self._link.name if self._link is not None else "closed"
        return f"<MainDevice {name}, {len(self.subs)} SubDevices>"
