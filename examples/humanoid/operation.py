"""Operating mode of the robot: requests of the operator, and the decision of the safety task."""

from __future__ import annotations

from dataclasses import dataclass

import arms
from exchange import Cause, Mode, Verdict

from catenary.share import OperatorRequest


@dataclass(frozen=True)
class Event:
    """Event of a run, for the report and the timeline."""

    time: float  # [s] of the loop
    text: str


class Operation:
    """Owner of the operating mode, of the requested preset and of the events of the run."""

    def __init__(self) -> None:
        self.mode = Mode.DAMPING
        self.held = True  # the robot hangs in its gantry
        self.ready = False  # all drives are enabled, and the tasks send values
        self.preset = (0, 0)  # serial number and number of the newest preset
        self.verdict, self.cause = Verdict.GO, Cause.NONE
        self.events: list[Event] = []
        self.now = 0.0  # [s] of the loop
        self._braking_since = 0.0  # [s]

    @property
    def braking(self) -> float:
        """Time since the decision to brake [s]; 0 without one."""
        return 0.0 if self.verdict == Verdict.GO else self.now - self._braking_since

    def note(self, text: str) -> None:
        """Add an event at the present time, and print it."""
        print(f"{self.now:8.3f} s  {text}", flush=True)
        self.events.append(Event(self.now, text))

    def serve(self, request: OperatorRequest) -> None:
        """Answer the request of an operator, and do what it asks for."""
        reason = self.objection(request.kind, request.name)
        if reason is not None:
            request.refuse(reason)
        elif request.accept():
            self._obey(request.kind, request.name)

    def request(self, kind: str, name: str) -> str | None:
        """Request a "mode" or a "preset" by its name. Return the reason of a refusal, or None."""
        reason = self.objection(kind, name)
        if reason is None:
            self._obey(kind, name)
        else:
            self.note(f"{kind} {name} refused: {reason}")
        return reason

    def objection(self, kind: str, name: str) -> str | None:
        """Return the reason why a mode or preset is impossible now; None if it is possible."""
        if kind == "preset":
            is_damped = self.mode == Mode.DAMPING
            return "the joints are in the mode damping; select stand first" if is_damped else None
        if name == "damping":
            return None
        if self.verdict != Verdict.GO:
            return f"safety: {self.cause.text}; start the program again"
        if not self.ready:
            return "the drives are not enabled, or a task sends no values yet"
        if name == "balance" and self.held:
            return "the robot hangs in its gantry; let it stand first"
        return None

    def _obey(self, kind: str, name: str) -> None:
        if kind == "preset":
            self.preset = self.preset[0] + 1, arms.NAMES.index(name)
        else:
            self.mode = Mode[name.upper()]
        self.note(f"{kind} {name}")

    def decide(self, verdict: Verdict, cause: Cause) -> None:
        """Take over a decision of the safety task, or of the loop. It is never withdrawn."""
        if verdict > self.verdict:
            if self.verdict == Verdict.GO:
                self._braking_since = self.now
            self.verdict, self.cause = verdict, cause
            action = "damping" if verdict == Verdict.DAMP else "stop"
            self.note(f"{cause.text}: {action}")
            self.mode = Mode.DAMPING
