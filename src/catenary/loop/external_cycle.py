"""Exchange of a session through an external master (`bus.Carrier`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from catenary.bus import Carrier, CycleClock, MainDevice, Pending, SubDevice
from catenary.bus.event_types import DeviceLost, DeviceReturned, StateLost
from catenary.core import Engine
from catenary.errors import CatenaryError, ConfigurationError
from catenary.loop.cycle_errors import Evidence, described, is_astray
from catenary.loop.session import FATAL, Session
from catenary.loop.watches.device import LOOK, Attendance
from catenary.plan.cycle import DatagramKind
from catenary.plan.planner import Plan
from catenary.procedure.al_status_poll import Answer
from catenary.procedure.exchange import Procedure, after
from catenary.types import UINT
from catenary.wire.al import AlState
from catenary.wire.cia402 import SLOT_OFFSET, Object


class CarriedExchange:
    """Exchange of a session through an external master. Implements `Exchange`."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def make_engine(self) -> Engine:
        """Return an engine that uses the process images of the external master."""
        cycle = replace(self._session.plan.cycle, clock=None)  # the master synchronises the clocks
        return Engine(cycle, self._session.main.link.capsule, self._carrier.image)

    def cycle_clock(self) -> CycleClock:
        """Return the distributed clocks, as the external master reports them."""
        clock = self._carrier.clock
        assert clock is not None  # `configure` has created it
        return clock

    def attend(self) -> None:
        """Create the watch of the devices."""
        optional = {
            position
            for unit in self._session.plan.cycle.sync_units
            if unit.optional
            for position in unit.devices
        }
        announce = self._session.announce_clocks
        self.watch: Attendance = CarriedWatch(
            self._session.main, self._carrier, self._session.engine, optional, announce
        )

    @property
    def _carrier(self) -> Carrier:
        carrier = self._session.main.carrier
        if carrier is None:
            raise RuntimeError("the MainDevice is closed")
        return carrier

    def bring_to_op(self) -> list[Pending[None]]:
        """Let the external master bring the required devices to OP while the cycle runs.

        Then wait until all sync units answer, and start the watch. Return the running watch.
        """
        required = [
            sub.position for sub in self._session.main.subs if self.watch.requires(sub.position)
        ]
        self._session.service.converse(self._carrier.bring_to_op(required))
        self._session.settle()
        for sub in self._session.main.subs:
            sub.state = AlState.OP
        watches = [self.watch.run()]
        if self._session.diagnosis is not None:
            watches.append(self._session.diagnosis.run())
        return [self._session.service.runner.submit(watch) for watch in watches]

    def query_silence(self, suspects: Sequence[int]) -> Evidence:
        """Query all devices through the external master."""
        return self.query_states()

    def query_states(self) -> Evidence:
        """Query the states of all devices through the external master."""
        [answers] = self._session.service.converse(self._carrier.survey())
        return Evidence(answers)

    def error_code(self, axis: int) -> int | None:
        """Return object 0x603F of the axis; None if it cannot be read."""
        plan = self._session.plan.cycle.axes[axis]
        sub = self._session.main.subs[plan.device]
        try:
            answer = sub.sdo.request(Object.ERROR_CODE + SLOT_OFFSET * plan.slot, type=UINT)
            while not answer.done:
                if self._session.cycle() & FATAL:
                    return None
                self._session.service.step_without_thread()
            return answer.result()
        except CatenaryError:
            return None  # a faulty drive may not answer; the error then contains no code


class CarriedWatch:
    """Watch of all devices. It puts events for devices that are lost, return or leave OP."""

    def __init__(
        self,
        main: MainDevice,
        carrier: Carrier,
        engine: Engine,
        optional: set[int],
        announce: Callable[[], None],
    ) -> None:
        self._announce = announce  # puts an event if the clocks were locked or unlocked
        self._main = main
        self._carrier = carrier
        self._engine = engine
        self._optional = optional
        self._answers: Sequence[Answer] = ()

    def run(self) -> Procedure[None]:
        """Watch the devices until the procedure is cancelled."""
        while True:
            yield from self._carrier.listen()
            self._announce()
            if self._engine.disturbed or any(a.word != AlState.OP for a in self._answers):
                answers = yield from self._carrier.survey()
                self._report(answers)
                self._answers = answers
            yield after(LOOK)

    @property
    def excuses(self) -> bool:
        """True if some devices are optional, and no required one answers out of OP.

        The value is as of the last survey. Devices that do not answer are ignored.
        """
        required = (a for a in self._answers if self.requires(a.station.position))
        return bool(self._optional) and not any(is_astray(answer) for answer in required)

    def requires(self, position: int) -> bool:
        """Return True if the loss of this device ends the loop."""
        return position not in self._optional

    def release(self, sub: SubDevice) -> None:
        """Raise ValueError, because the external master brings devices back to OP itself."""
        raise ValueError(
            f"{sub.station} is not held: the kernel master brings devices back to OP itself"
        )

    def _report(self, answers: Sequence[Answer]) -> None:
        """Put events for lost and returned devices and those that left OP; update `sub.state`."""
        before = {answer.station.position: answer.word for answer in self._answers}
        now = self._engine.now() * 1e-9
        for answer in answers:
            position, word = answer.station.position, answer.word
            was, sub = before.get(position, int(AlState.OP)), self._main.subs[position]
            if word is None and was is not None:
                message = f"{answer.station} does not answer any more"
                self._main.events.put(DeviceLost(now, sub, message))
                sub.state = None
            elif word is not None and was is None:
                message = f"{answer.station} answers again"
                self._main.events.put(DeviceReturned(now, sub, message))
            if word is not None and word != AlState.OP and was == AlState.OP:
                message = f"{described(answer)}, out of OP"
                lost = StateLost(now, sub, message, int(AlState.OP), word & 0xF, answer.code)
                self._main.events.put(lost)
                sub.state = None
            elif word == AlState.OP:
                sub.state = AlState.OP


def carried(plan: Plan) -> Plan:
    """Return the plan without frames, because the external master builds them.

    Raises:
        ConfigurationError: The plan needs exact matching, which an external master does not
            support.
    """
    kinds = {datagram.kind for frame in plan.cycle.frames for datagram in frame.datagrams}
    if DatagramKind.CYCLE_NUMBER in kinds:
        raise ConfigurationError(
            "exact_matching=True is not possible: an external master makes the frames",
            hint="omit the option, or open the network interface directly",
        )
    return replace(plan, cycle=replace(plan.cycle, frames=()))
