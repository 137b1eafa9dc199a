"""Body of the loop over both networks: actual values to the tasks, commands to the laws."""

from __future__ import annotations

from collections.abc import Sequence

import laws
import numpy as np
from exchange import STATE, Cause, Exchange, Mode, Verdict
from networks import Network, Sensors
from operation import Operation

import catenary as cat
from catenary import realtime

BRAKE = 1.2  # [s] from a decision to brake to the stop, at most
BRING_UP = 10.0  # [s] until all drives are enabled and all tasks send values, at most


class Robot:
    """Owner of the cycle's data: one `STATE` out, one `COMMAND` in.

    Args:
        networks: upper and lower network.
        sensors: IMU and force sensors.
        exchange: Values of the tasks.
        share: share on which an operator requests modes and presets.
        silence: number of cycles without a value of a task, after which the laws brake.
    """

    def __init__(
        self,
        networks: Sequence[Network],
        sensors: Sensors,
        exchange: Exchange,
        share: cat.Share,
        silence: int,
    ) -> None:
        self.operation = Operation()
        self._networks, self._sensors, self._x = networks, sensors, exchange
        self._state = np.zeros((), STATE)
        self._silences = {
            Cause.SILENT_SAFETY: realtime.Silence(exchange.safety),
            Cause.SILENT_BALANCE: realtime.Silence(exchange.command),
        }
        self._share, self._silence = share, silence
        self._preset = self.operation.preset
        self._mode: Mode | None = None  # published
        self._follows_policy = False

    def step(self, cycle: cat.Cycle) -> bool:
        """Run one cycle. Return False after the decision to stop."""
        operation = self.operation
        operation.now = cycle.time
        self._publish(cycle)
        self._decide()
        self._serve()
        command = self._x.command.read()
        self._note_policy(bool(command["policy"]))
        for network in self._networks:
            network.write(cycle.number, self._law_mode, command)
            for text in network.status.step(cycle.time):
                operation.note(text)
        return operation.verdict != Verdict.STOP

    @property
    def state(self) -> np.ndarray:
        """The `STATE` of this cycle."""
        return self._state

    @property
    def _law_mode(self) -> float:
        return laws.DAMPED if self.operation.mode == Mode.DAMPING else laws.COMPLIANT

    def _publish(self, cycle: cat.Cycle) -> None:
        """Send the actual values and the mode to the tasks."""
        state, operation = self._state, self.operation
        state["number"], state["time"] = cycle.number, cycle.time
        state["mode"], state["held"] = operation.mode, operation.held
        for network in self._networks:
            actual, rows = network.drives.actual, network.rows
            state["position"][rows] = actual.position
            state["velocity"][rows] = actual.velocity
            state["torque"][rows] = actual.torque
            state["drives_valid"][network.number] = network.works
        self._sensors.write(state)
        self._x.state.write(state)
        if operation.preset != self._preset:
            self._preset = operation.preset
            self._x.preset.write(self._preset)

    def _note_policy(self, follows: bool) -> None:
        if follows != self._follows_policy:
            self._follows_policy = follows
            change = "balances" if follows else "is replaced by the balance"
            self.operation.note(f"the policy {change}")

    def _serve(self) -> None:
        """Answer the operator, and publish the mode."""
        for request in self._share.requests():
            self.operation.serve(request)
        if self._mode != self.operation.mode:
            self._mode = self.operation.mode
            self._share.mode = self._mode.name.lower()

    def _decide(self) -> None:
        """Take over the decision of the safety task, and find tasks that are silent."""
        operation, decision = self.operation, self._x.safety.read()
        if not operation.ready:
            operation.ready = self._x.command.number > 0 and all(
                network.drives.enabled.all() for network in self._networks
            )
        operation.decide(Verdict(int(decision["verdict"])), Cause(int(decision["cause"])))
        for cause, silence in self._silences.items():
            is_watched = operation.mode != Mode.DAMPING
            if cause == Cause.SILENT_SAFETY:
                is_watched = operation.ready  # also while the joints brake
            if silence.look() > self._silence and is_watched:
                operation.decide(Verdict.DAMP, cause)
        if not operation.ready and operation.now > BRING_UP:
            operation.decide(Verdict.STOP, Cause.NOT_READY)
        if operation.braking > BRAKE:  # also without the safety task
            operation.decide(Verdict.STOP, operation.cause)
