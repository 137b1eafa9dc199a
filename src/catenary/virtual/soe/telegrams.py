"""Telegrams of a virtual drive: process data from S-0-0015, S-0-0016 and S-0-0024.

The master data telegram (MDT, outputs) begins with S-0-0134, the drive telegram (AT, inputs) with
S-0-0135. Then follow the IDNs of the telegram.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from catenary.virtual.soe.parameter import SIGNED, Parameter, packed

CONFIGURABLE = 7  # telegram type with the lists S-0-0016 and S-0-0024
# Telegram types of S-0-0015: IDNs of the MDT, and of the AT
STANDARD: Mapping[int, tuple[tuple[int, ...], tuple[int, ...]]] = {
    0: ((), ()),
    1: ((80,), ()),
    2: ((36,), (40,)),
    3: ((36,), (51,)),
    4: ((47,), (51,)),
    5: ((47, 36), (51, 40)),
    6: ((36,), ()),
}
CONTROL_WORD, STATUS_WORD = 134, 135
ENTRIES_MAX = 16  # in each list


class Telegrams:
    """Content of the telegrams of one drive."""

    def __init__(self, parameters: Mapping[int, Parameter], check: Callable[[], bool]) -> None:
        """Initialise the telegrams.

        Args:
            parameters: IDNs of the drive.
            check: Function that returns True if SAFE-OP is permitted.
        """
        self._parameters = parameters
        self._check = check
        self.kind = CONFIGURABLE
        self.lists = {True: (47,), False: (51,)}  # IDNs of the MDT (True) and of the AT

    def idns(self, outputs: bool) -> tuple[int, ...]:
        """Return the IDNs of a telegram, without control word and status word."""
        if self.kind == CONFIGURABLE:
            return self.lists[outputs]
        return STANDARD[self.kind][0 if outputs else 1]

    def content(self, outputs: bool) -> bytes:
        """Return the value of S-0-0024 (outputs) or S-0-0016."""
        return packed(list(self.idns(outputs)))

    def mapped(self, outputs: bool) -> list[tuple[int, int, int, bool]]:
        """Return bit offset, size [bits], slot and sign of each value of a telegram."""
        entries: list[tuple[int, int, int, bool]] = []
        bit = 0
        for number in (CONTROL_WORD if outputs else STATUS_WORD, *self.idns(outputs)):
            parameter = self._parameters[number]
            signed = parameter.display == SIGNED
            entries.append((bit, 8 * parameter.size, parameter.slot, signed))
            bit += 8 * parameter.size
        return entries

    def size(self, outputs: bool) -> int:
        """Return the length of a telegram [bytes]."""
        bit, bits, _slot, _signed = self.mapped(outputs)[-1]
        return (bit + bits) // 8

    def valid(self) -> bool:
        """Return True if the parameters permit SAFE-OP, as S-0-0127 checks."""
        return self._check()
