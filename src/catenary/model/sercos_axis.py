"""Telegrams and scaling of the drives of one SERCOS device: what a program or the core exchanges.

Each drive has a master data telegram (MDT, outputs) and a drive telegram (AT, inputs). They begin
with S-0-0134 and S-0-0135. The telegrams of drive 1 follow those of drive 0.
"""

from __future__ import annotations

from dataclasses import dataclass

from catenary.wire.sercos import Attribute, idn_number, idn_text

CONTROL_WORD, STATUS_WORD = 134, 135
AT_LIST, MDT_LIST, TELEGRAM_TYPE = 16, 24, 15
CONFIGURABLE = 7  # telegram type with the lists S-0-0016 and S-0-0024


@dataclass(frozen=True, slots=True)
class TelegramValue:
    """One value in a telegram."""

    number: int  # IDN
    bit_offset: int  # in the process data of its direction
    attribute: Attribute
    unit: str = ""

    @property
    def idn(self) -> str:
        """Notation, such as "S-0-0047"."""
        return idn_text(self.number)

    @property
    def bit_length(self) -> int:
        """Size of the value [bits]."""
        return 8 * self.attribute.size


@dataclass(frozen=True, slots=True)
class Scaling:
    """Scaling of one physical quantity. None: the drive does not have the IDN.

    Bits 0 to 2 of the type are 1 for a linear, 2 for a rotary scaling. Bit 3 is set if factor,
    exponent or resolution apply; otherwise the scaling is the preferred one of IEC 61800-7-204.
    """

    type: int | None = None  # S-0-0076 position, S-0-0044 velocity, S-0-0086 torque
    factor: int | None = None  # S-0-0077, S-0-0045, S-0-0093
    exponent: int | None = None  # S-0-0078, S-0-0046, S-0-0094
    polarity: int | None = None  # S-0-0055, S-0-0043, S-0-0085
    resolution: int | None = None  # S-0-0079: increments per turn


UNKNOWN = Scaling()


@dataclass(frozen=True, slots=True)
class SercosAxis:
    """Telegrams and scaling of one drive."""

    drive: int
    telegram_type: int | None  # S-0-0015
    outputs: tuple[TelegramValue, ...]  # S-0-0134, then those of S-0-0024
    inputs: tuple[TelegramValue, ...]  # S-0-0135, then those of S-0-0016
    position: Scaling = UNKNOWN
    velocity: Scaling = UNKNOWN
    torque: Scaling = UNKNOWN

    @property
    def is_configurable(self) -> bool:
        """True if the lists S-0-0016 and S-0-0024 determine the telegrams."""
        return self.telegram_type is None or self.telegram_type & CONFIGURABLE == CONFIGURABLE

    def output(self, idn: str | int) -> TelegramValue | None:
        """Return a value of the MDT; None if it does not contain the IDN."""
        number = idn_number(idn)
        return next((each for each in self.outputs if each.number == number), None)

    def input(self, idn: str | int) -> TelegramValue | None:
        """Return a value of the AT; None if it does not contain the IDN."""
        number = idn_number(idn)
        return next((each for each in self.inputs if each.number == number), None)
