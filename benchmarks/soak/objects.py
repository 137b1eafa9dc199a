"""Objects that are read during a soak test. Each answer must arrive and be correct."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from benchmarks.soak.cell import WITH_MAILBOX
from benchmarks.soak.witness import Witness
from catenary.bus import SubDevices
from catenary.bus.pending import Pending
from catenary.errors import CatenaryError
from catenary.types import UDINT
from catenary.virtual import faults as f

EVERY = 25  # cycles
ANSWERED = 20.0  # [s] deadline, including earlier requests in the mailbox
IDENTITY, PRODUCT = 0x1018, 2


class Asked(NamedTuple):
    """One requested object."""

    position: int
    time: float
    expected: int
    answer: Pending[int]


class Objects:
    """Owns the pending answers of one loop."""

    def __init__(self, subs: SubDevices, witness: Witness, random: Random) -> None:
        self._subs = subs
        self._witness = witness
        self._random = random
        self._pending: list[Asked] = []

    def step(self, cycle: int) -> int:
        """Request an object every `EVERY` cycles. Return the number of answers in this cycle."""
        now = self._witness.segment.time
        if cycle % EVERY == 0:
            sub = self._subs[self._random.choice(WITH_MAILBOX)]
            answer = sub.sdo.request(IDENTITY, PRODUCT, type=UDINT)
            self._pending.append(Asked(sub.position, now, sub.identity.product, answer))
        done = [asked for asked in self._pending if asked.answer.done]
        for asked in done:
            self._pending.remove(asked)
            self._judge(asked)
        for asked in self._pending:
            if now - asked.time > ANSWERED:
                what = f"device {asked.position}: no answer and no error for {ANSWERED:g} s"
                self._witness.violate("every request ends", what, about=str(asked.position))
        return len(done)

    def _judge(self, asked: Asked) -> None:
        error = asked.answer.error
        now = self._witness.segment.time
        faults = list(self._witness.injected.between(asked.time - 0.5, now))
        if error is not None and not isinstance(error, CatenaryError):
            raise error
        if error is not None and self._witness.quiet_since(asked.time - 0.5):
            what = f"device {asked.position}: {error}"
            self._witness.violate("objects are read", what, about=str(asked.position))
        garbled = any(isinstance(fault, f.Garble) for fault in faults)
        if error is None and asked.answer.result() != asked.expected and not garbled:
            what = f"device {asked.position}: {asked.answer.result():#x}, not {asked.expected:#x}"
            self._witness.violate("answers are right", what, about=str(asked.position))
