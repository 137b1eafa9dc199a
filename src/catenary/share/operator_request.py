"""Request of an operator, and its answer.

Theory of operation. A request is open until the first of three answers: the program accepts it, the
program refuses it, or the service withdraws it because the time for an answer has passed or the
client has left. The program answers in the thread of the loop, and the service in its own thread.
`dict.setdefault` is one atomic operation of CPython, so exactly one answer wins, without a lock.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from catenary.share.choice import Kind

REASON_MAX = 400  # characters


class Answer(NamedTuple):
    """Answer to a request. A withdrawn request has neither been accepted nor refused."""

    accepted: bool
    reason: str = ""  # of a refusal
    withdrawn: bool = False


WITHDRAWN = Answer(False, withdrawn=True)


OnAccepted: TypeAlias = "Callable[[OperatorRequest], None]"


class OperatorRequest:
    """Request of an operator for an operating mode or a preset. `Share.requests` yields it.

    Attributes:
        kind: "mode" or "preset".
        name: name of the mode or preset, which the program has declared.
        client: process and user of the client.
        time_ns: time of the request on CLOCK_MONOTONIC.
    """

    __slots__ = ("_answers", "_on_accepted", "client", "kind", "name", "time_ns")

    def __init__(
        self, kind: Kind, name: str, client: str, on_accepted: OnAccepted | None = None
    ) -> None:
        self.kind: Kind = kind
        self.name = name
        self.client = client
        self.time_ns = time.monotonic_ns()
        self._on_accepted = on_accepted
        self._answers: dict[None, Answer] = {}

    def __repr__(self) -> str:
        return f"OperatorRequest({self.kind}={self.name!r}, client={self.client!r})"

    def accept(self) -> bool:
        """Accept the request. The client receives this answer, and the share an event.

        Return False if the request already has an answer, or was withdrawn because the time for an
        answer has passed. Then do not act on it: the client knows that it has failed.
        """
        accepted = self._settle(Answer(True))
        if accepted and self._on_accepted is not None:
            self._on_accepted(self)
        return accepted

    def refuse(self, reason: str) -> bool:
        """Refuse the request. The client raises RequestRefused with the reason.

        Args:
            reason: why, as a sentence without a full stop.

        Returns:
            False if the request already has an answer, or was withdrawn.
        """
        text = "".join(c if c.isprintable() else "?" for c in str(reason)[:REASON_MAX])
        return self._settle(Answer(False, text or "the program gives no reason"))

    def withdraw(self) -> Answer:
        """End the request, and return its answer. Called by the service of the share."""
        return self._answers.setdefault(None, WITHDRAWN)

    @property
    def answer(self) -> Answer | None:
        """Answer of the program; None while the request is open."""
        return self._answers.get(None)

    def _settle(self, answer: Answer) -> bool:
        return self._answers.setdefault(None, answer) is answer
