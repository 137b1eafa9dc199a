"""FrameMaster: state changes and configuration of devices by frames that this process sends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from catenary.bus import event_types
from catenary.bus.master import Complete, MasterOwner
from catenary.bus.runner import BlockingRunner
from catenary.bus.sdo import Objects, read_each
from catenary.bus.segment_scan import ScannedDevice, find, oddities, with_places
from catenary.bus.sub_device import SubDevice
from catenary.errors import DecodeError, LinkError
from catenary.link import ring_of
from catenary.model.device import DeviceDescription
from catenary.procedure.live_outputs import Running, find_refreshed, find_running
from catenary.procedure.mailbox import ReceivedEmergency
from catenary.procedure.stations import (
    StationRegisters,
    assign,
    bring_all_down,
    count,
    duplicate_aliases,
    reset,
)
from catenary.wire.al import STATE_MASK, AlState
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.soe import decode_soe

if TYPE_CHECKING:  # plan imports NumPy, which a scan does not need
    from catenary.bus.diagnosis import Diagnosis
    from catenary.bus.states import Outcome
    from catenary.plan.planner import Plan
    from catenary.plan.request import ProcessDataRequest


class FrameMaster:
    """Master that sends its own frames. Implements `bus.Master` with procedures."""

    def __init__(self, main: MasterOwner, *, force: bool) -> None:
        self.carrier = None
        self._main = main
        self._force = force

    def forget(self) -> None:
        """Do nothing: a forked child only holds the link, which the MainDevice releases."""

    def scan(self, complete: Complete) -> tuple[Sequence[SubDevice], tuple[str, ...]]:
        """Reset all devices, bring them to PRE-OP and read their descriptions.

        Return the handles of the devices, and notes about the segment. If a device cannot be
        brought to PRE-OP, its handle has the error.

        Args:
            complete: Function that adds the facts of ESI files to a description.

        Raises:
            LinkError: Another master refreshes the outputs of a device, unless `force`.
            NoDeviceError: No device answers.
            SegmentError: The two ports of a ring are swapped.
        """
        main, runner = self._main, self._main.runner
        runner.flush()
        device_count, states = runner.run(count())
        running_notes = self._judge_running(runner, device_count, states)
        runner.run(reset(device_count))
        registers, ring_notes = self._addressed(runner, device_count)
        found = runner.run_all([find(each, complete) for each in registers])
        descriptions = with_places([each.description for each in found])
        subs = [
            self._handle(each._replace(description=description))
            for each, description in zip(found, descriptions, strict=True)
        ]
        notes = (
            *running_notes,
            *ring_notes,
            *(
                f"devices {positions} have the same alias {alias}"
                for alias, positions in duplicate_aliases(registers).items()
            ),
            *oddities(descriptions, ring=ring_of(main.link) is not None),
        )
        return subs, notes

    def _judge_running(
        self, runner: BlockingRunner, device_count: int, states: int
    ) -> tuple[str, ...]:
        """Return a note on devices that another program has left in SAFE-OP or OP, if any.

        Raises:
            LinkError: Another master refreshes their outputs, unless `force`.
        """
        if states & STATE_MASK <= AlState.BOOT:
            return ()
        running = runner.run(find_running(device_count))
        if not self._force:
            self._refuse_refreshed(runner, running)
        if not running:
            return ()
        left = ", ".join(map(str, running))
        return (f"{left}: left by another program, which may have been killed; now reset",)

    def _refuse_refreshed(self, runner: BlockingRunner, running: Sequence[Running]) -> None:
        refreshed = runner.run(find_refreshed(running))
        if refreshed:
            raise LinkError(
                f"another EtherCAT master is live on {self._main.link.name}: it refreshes the "
                f"outputs of {', '.join(f'device {position}' for position in refreshed)} (0x0440)",
                hint="a scan would reset devices that may be in motion. Stop that master, which "
                "may be at the other end of the line, or pass force=True (--force) to scan anyway",
            )

    def _addressed(
        self, runner: BlockingRunner, device_count: int
    ) -> tuple[Sequence[StationRegisters], tuple[str, ...]]:
        """Address the devices. Return their registers, and a note on the cuts of a ring."""
        ring = ring_of(self._main.link)
        if ring is None:
            return runner.run(assign(range(device_count))), ()
        from catenary.bus.ring import assign_from_both_ends, find_cuts

        registers = assign_from_both_ends(runner, ring, device_count)
        cuts = find_cuts(ring.state, device_count)
        return registers, (str(cuts),) if cuts is not None and cuts.cables else ()

    def passive_scan(self, *, names: bool) -> Sequence[DeviceDescription]:
        """Read the devices without changing a state or mapping."""
        from catenary.bus.passive_scan import passive_scan

        return passive_scan(self._main.runner, ring_of(self._main.link), names)

    def request_states(
        self, devices: Sequence[DeviceDescription], positions: Sequence[int], state: AlState
    ) -> dict[int, Outcome]:
        """Bring devices to a state and leave them there.

        Return the reached state or the error, by position.
        """
        from catenary.bus.states import request_states

        return request_states(self._main.runner, devices, positions, state)

    def diagnose(
        self, subs: Sequence[SubDevice], *, since: Diagnosis | None, lost_frames: int
    ) -> Diagnosis:
        """Read the error counters and states of devices, and locate faults."""
        from catenary.bus.diagnosis import diagnose

        ring = ring_of(self._main.link) is not None
        return self._main.converse(diagnose(subs, since=since, lost_frames=lost_frames, ring=ring))

    def read_mappings(self, requests: Sequence[ProcessDataRequest], period_ns: int) -> None:
        """Update the mappings and the requested objects in the descriptions of the devices."""
        from catenary.bus.bring_up import describe_mappings

        describe_mappings(self._main.runner, self._main.subs, requests, period_ns)

    def read_objects(self, wanted: Mapping[int, Sequence[tuple[int, int]]]) -> dict[int, Objects]:
        """Read objects of several devices at the same time."""
        positions, subs = list(wanted), self._main.subs
        found = self._main.runner.run_all([read_each(subs[k].sdo, wanted[k]) for k in positions])
        return dict(zip(positions, found, strict=True))

    def configure(self, plan: Plan, epoch_ns: int) -> tuple[int | None, ...]:
        """Configure every device as planned and bring all to SAFE-OP.

        Return the delays after the first clock [ns], by position; empty without clocks.
        """
        from catenary.bus.bring_up import bring_to_safe_op

        main = self._main
        measured = bring_to_safe_op(main.runner, main.subs, plan, epoch_ns, ring_of(main.link))
        return measured.delays_ns if measured is not None else ()

    def leave(self, timeout: float) -> None:
        """Bring all devices to SAFE-OP, then to PRE-OP."""
        self._bring_down(AlState.SAFE_OP, timeout)
        self._bring_down(AlState.PRE_OP, timeout)

    def close(self, timeout: float) -> None:
        """Bring all devices to INIT."""
        self._bring_down(AlState.INIT, timeout)

    def _bring_down(self, state: AlState, timeout: float) -> None:
        subs = self._main.subs
        self._main.runner.run(bring_all_down([sub.station for sub in subs], state, timeout))
        for sub in subs:
            sub.state = state

    def _handle(self, found: ScannedDevice) -> SubDevice:
        """Update and return the handle of a scanned device. Its emergencies become events.

        The handle is the existing one if the identity at its position is the same, otherwise a new
        one.
        """
        subs = self._main.subs
        position = found.description.position
        known = subs[position] if position < len(subs) else None
        if known is None or known.identity != found.description.identity:
            known = SubDevice(self._main, found.description, found.channel)
        known.description, known.channel = found.description, found.channel
        if known.channel is not None:
            known.channel.listen(partial(self._on_emergency, known))
            known.channel.subscribers[Type.SOE] = partial(self._on_soe, known)
        known.error = found.error
        known.state = AlState.PRE_OP if found.error is None else None
        return known

    def _on_emergency(self, sub: SubDevice, received: ReceivedEmergency) -> None:
        self._main.events.put(
            event_types.emergency(received.time_ns * 1e-9, sub, received.emergency)
        )

    def _on_soe(self, sub: SubDevice, message: Mailbox, time_ns: int) -> bool:
        """Turn a notification or emergency into an event. Return False for other messages."""
        with suppress(DecodeError):
            event = event_types.soe_event(time_ns * 1e-9, sub, decode_soe(message.data))
            if event is not None:
                self._main.events.put(event)
                return True
        return False
