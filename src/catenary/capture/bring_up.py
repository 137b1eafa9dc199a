"""The way of one device from INIT to its highest state, as a capture shows it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from catenary.capture.contents import StateReached, StateRefused, StateRequest
from catenary.capture.difference import level, state_of
from catenary.capture.events import Event, Step
from catenary.capture.text import duration
from catenary.wire.al import AlState


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of the transition to one state."""

    step: Step
    requested: bool = False
    reached: Event | None = None
    refusals: tuple[Event, ...] = ()  # before the state was reached
    falls: tuple[Event, ...] = ()  # after the state was reached

    @property
    def codes(self) -> tuple[tuple[int | None, ...], ...]:
        """AL status codes of the refusals and of the falls, each once, in their order."""
        return tuple(
            tuple(dict.fromkeys(_refused(each).code for each in events))
            for events in (self.refusals, self.falls)
        )

    @property
    def error(self) -> Event | None:
        """The error that ended the transition; None if the state was reached and kept."""
        if self.falls:
            return self.falls[0]
        return self.refusals[-1] if self.refusals and self.reached is None else None

    @property
    def is_known(self) -> bool:
        """True if the capture shows the transition."""
        return self.requested or self.reached is not None or bool(self.refusals)

    def __str__(self) -> str:
        parts = []
        refused, fell = self.codes
        if refused:
            parts.append(f"refused {_codes(refused)}")
        if self.reached is not None:
            content = self.reached.content
            after = content.after_ns if isinstance(content, StateReached) else None
            waited = "" if after is None else f" after {_short(after)}"
            parts.append(f"{self.step.after}{waited}")
        elif self.requested and not refused:
            parts.append(f"{self.step.after} requested, not reached")
        if fell:
            parts.append(f"left {self.step.after} by itself, {_codes(fell)}")
        return ", then ".join(parts)


@dataclass(frozen=True, slots=True)
class BringUp:
    """The first bring-up of a device to the highest state that the capture shows.

    `events` are those of the capture until its end, `first` is the index of the first event of the
    bring-up. `outcomes` has the transitions to PRE-OP, SAFE-OP and OP.
    """

    events: tuple[Event, ...]
    first: int
    highest: int  # rank of the state
    outcomes: tuple[Outcome, ...]

    @property
    def error(self) -> Event | None:
        """The error that ended the bring-up; None if there was none."""
        return next((each.error for each in self.outcomes if each.error is not None), None)

    @property
    def ended_ns(self) -> int | None:
        """Time at which the highest state was reached; None if it was not seen."""
        reached = [each.reached.time_ns for each in self.outcomes if each.reached is not None]
        return reached[-1] if reached else None


def find_bring_up(events: Sequence[Event]) -> BringUp:
    """Return the bring-up of a device.

    A new attempt begins with INIT after a higher state. The first of the attempts with the highest
    state is chosen.

    Args:
        events: Events of one device and of all devices, in order.
    """
    attempts = list(_attempts(events))
    first, last, highest = max(attempts, key=lambda each: (each[2], -each[0]))
    attempt = events[first:last]
    outcomes = tuple(_outcome(attempt, rank) for rank in (1, 2, 3))
    end = first + _end(attempt, highest)
    return BringUp(tuple(events[:end]), first, highest, outcomes)


def _attempts(events: Sequence[Event]) -> Iterator[tuple[int, int, int]]:
    """Yield the first index, the index after the last event, and the highest rank."""
    first = highest = 0
    for index, event in enumerate(events):
        content = event.content
        if isinstance(content, StateRequest | StateReached) and content.state is AlState.INIT:
            if highest:
                yield first, index, highest
                first, highest = index, 0
        elif isinstance(content, StateReached | StateRefused):
            highest = max(highest, level(content.state))
    yield first, len(events), highest


def _end(attempt: Sequence[Event], highest: int) -> int:
    """Return the index after the last event that belongs to the bring-up.

    It ends with OP, with the refusal of a state above the highest one, or when the master gives up.
    """
    aimed = None  # rank that the master aims at, once the highest state is reached
    for index, event in enumerate(attempt):
        content = event.content
        if isinstance(content, StateReached):
            if level(content.state) == highest:
                if state_of(highest) is AlState.OP:
                    return index + 1
                aimed = max(aimed or 0, highest)
        elif isinstance(content, StateRefused) and not content.fell:
            requested = content.requested
            if requested is not None and level(requested) > highest:
                return index + 1
        elif isinstance(content, StateRequest) and aimed is not None:
            if level(content.state) < aimed:
                return index
            aimed = level(content.state)
    return len(attempt)


def _outcome(attempt: Sequence[Event], rank: int) -> Outcome:
    target = state_of(rank)
    requested, reached = False, None
    refusals: list[Event] = []
    falls: list[Event] = []
    for event in attempt:
        content = event.content
        if isinstance(content, StateRequest):
            if content.state is target:
                requested = True
            elif reached and level(content.state) < rank:
                break  # the master ends the operation
        elif isinstance(content, StateReached) and content.state is target:
            reached = reached or event
        elif isinstance(content, StateRefused):
            if content.fell and content.before is target:
                falls.append(event)
            elif content.requested is target and not content.fell and reached is None:
                refusals.append(event)
    step = Step(state_of(rank - 1), target)
    return Outcome(step, requested, reached, tuple(refusals), tuple(falls))


def _refused(event: Event) -> StateRefused:
    assert isinstance(event.content, StateRefused)
    return event.content


def _codes(codes: Sequence[int | None]) -> str:
    return ", ".join("(code not read)" if code is None else f"0x{code:04X}" for code in codes)


def _short(ns: int) -> str:
    """Return a time with three digits, because it differs in every run."""
    digits = 10 ** max(len(str(abs(ns))) - 3, 0)
    return duration(round(ns / digits) * digits)
