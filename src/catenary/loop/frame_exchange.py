"""Exchange of a session that sends its own frames."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.bus import CycleClock, Pending
from catenary.core import Engine
from catenary.errors import CatenaryError
from catenary.link import ring_of
from catenary.loop.cycle_errors import (
    Evidence,
    is_astray,
    tight_period,
)
from catenary.loop.session import Session
from catenary.loop.watches.device import Attendance, Watch
from catenary.loop.watches.error import ErrorWatch
from catenary.loop.watches.frame import FrameWatch
from catenary.model.break_location import judge_silence
from catenary.model.device import Direction
from catenary.procedure.al_state import request_state
from catenary.procedure.al_status_poll import survey
from catenary.procedure.process_data_check import probe_inputs
from catenary.procedure.sdo import upload
from catenary.procedure.sercos_fault import read_diagnosis
from catenary.types import UINT
from catenary.wire.al import AlState
from catenary.wire.cia402 import SLOT_OFFSET, Object


class FrameExchange:
    """Exchange of a session that sends its own frames. Implements `Exchange`."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._stations = [sub.station for sub in session.main.subs]

    def make_engine(self) -> Engine:
        """Return the engine of the session's plan."""
        return Engine(self._session.plan.cycle, self._session.main.link.capsule)

    def cycle_clock(self) -> CycleClock:
        """Set the epoch of the engine's clock, and return the clock."""
        clock = self._session.engine.clock
        assert clock is not None  # a plan with clocks makes an engine with clocks
        clock.set_epoch(self._session.main.clock_epoch_ns)
        return clock

    def attend(self) -> None:
        """Make the watches of devices, error counters and repeated frames."""
        session = self._session
        engine, put = session.engine, session.main.events.put

        def now() -> float:
            return engine.now() * 1e-9

        self.watch: Attendance = Watch(
            session.main,
            session.plan,
            disturbed=lambda: engine.disturbed,
            submit=session.service.runner.submit,
            now=now,
            rejoin=None if session.clocks is None else session.clocks.rejoin,
            cables_seen=session.announce_clocks,
            policy=session.stop,
        )
        self.errors = ErrorWatch(session.main, now=now)
        self.frames = FrameWatch(self._repeated_frames, put=put, now=now)

    def _repeated_frames(self) -> int:
        """Return the number of frames that returned repeatedly, or that a ring could not assign."""
        ring = ring_of(self._session.main.link)
        unassigned = 0 if ring is None else ring.counts["alien"]
        return self._session.engine.counters["repeated"] + unassigned

    def bring_to_op(self) -> list[Pending[None]]:
        """Wait for all answers and for the clocks, then bring all devices to OP together.

        Start the watches and return them.
        """
        session = self._session
        session.settle()
        if session.clocks is not None:
            session.clocks.settle(session.raise_ended)
        session.service.converse(
            *(request_state(station, AlState.OP) for station in self._stations)
        )
        for sub in session.main.subs:
            sub.state = AlState.OP
        watches = [self.watch.run(), self.errors.run(), self.frames.run()]
        if session.diagnosis is not None:
            watches.append(session.diagnosis.run())
        if session.external is not None:
            watches.append(session.external.run())
        if session.trigger is not None:
            watches.append(session.trigger.run())
        return [session.service.runner.submit(watch) for watch in watches]

    def query_silence(self, suspects: Sequence[int]) -> Evidence:
        """Query all devices, and find the place where the silence begins."""
        session, converse = self._session, self._session.service.converse
        [answers] = converse(survey(self._stations))
        [noise] = converse(self.errors.look())
        silent = [answer.station.position for answer in answers if answer.word is None]
        silence = judge_silence(self.errors.topology, self.errors.names, silent)
        [mute] = converse(probe_inputs(self._input_areas(suspects)))
        cycle = session.plan.cycle
        tight = tight_period(cycle.wire_ns, cycle.period_ns)
        return Evidence(answers, silence or noise, mute, tight)

    def _input_areas(self, positions: Sequence[int]) -> dict[int, tuple[int, int]]:
        """Return the logical areas of the devices' inputs: position → (start, length)."""
        return {
            position: (fmmu.logical_start, fmmu.length)
            for position in positions
            for fmmu in self._session.plan.devices[position].layout.fmmus
            if fmmu.direction is Direction.INPUT
        }

    def query_states(self) -> Evidence:
        """Query all devices for their states.

        A required device has lost its address if it is silent in two surveys while others answer.
        This is not checked if a required device is out of OP, or if the cyclic AL status shows OP.
        """
        session = self._session
        others = session.main.other_masters
        for _ in range(2):
            [answers] = session.service.converse(survey(self._stations))
            required = [a for a in answers if self.watch.requires(a.station.position)]
            silent = [answer for answer in required if answer.word is None]
            all_in_op = session.engine.al_status == AlState.OP
            if (
                any(map(is_astray, required))
                or not silent
                or all_in_op
                or len(silent) == len(answers)
            ):
                return Evidence(answers, other_masters=others)
        return Evidence(answers, without_address=silent, other_masters=others)

    def error_code(self, axis: int) -> int | str | None:
        """Return object 0x603F of the axis, or the diagnosis of a SERCOS drive.

        None if it cannot be read.
        """
        plan = self._session.plan.cycle.axes[axis]
        channel = self._session.main.subs[plan.device].channel
        if channel is None:
            return None
        if plan.profile == "sercos":
            return self._session.service.converse(read_diagnosis(channel, plan.slot))[0]
        index = Object.ERROR_CODE + SLOT_OFFSET * plan.slot
        try:
            [data] = self._session.service.converse(upload(channel, index, 0))
            return UINT.decode(data)
        except CatenaryError:
            return None  # a drive in trouble may not answer: the error then shows no code
