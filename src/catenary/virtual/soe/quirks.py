"""Quirks of SERCOS drives. In TOML, a quirk is a field of a table: `soe_quirks = {...}`.

No drive with these quirks has been reported, except where a comment names one.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from catenary.virtual.soe.parameter import idn


class SoeQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences of a drive from ETG.1000.6 §5.9 and IEC 61800-7-204. The default has none."""

    refused: Mapping[str, int] = {}  # error code of each request, by IDN
    fragment_bytes: int = 0  # longest data of a fragment of an answer; 0: the mailbox is filled
    constant_fragments: bool = False  # fragments have the IDN in place of the number left
    one_element: bool = False  # a request for several elements is refused with 0x800B
    stuck_commands: tuple[str, ...] = ()  # these procedure commands never end
    failing_commands: tuple[str, ...] = ()
    lying_lists: tuple[str, ...] = ()  # these lists state twice the length of their content
    invalid_for_phase_3: tuple[str, ...] = ()  # S-0-0127 and SAFE-OP are refused; see S-0-0021
    notifications: bool = True  # the end of a procedure command is reported

    def __post_init__(self) -> None:
        for each in (*self.refused, *self.stuck_commands, *self.failing_commands):
            idn(each)
        for each in (*self.lying_lists, *self.invalid_for_phase_3):
            idn(each)
        if not 0 <= self.fragment_bytes <= 1024:
            raise ValueError(f"fragment_bytes must be 0 to 1024, not {self.fragment_bytes}")


NO_SOE_QUIRKS = SoeQuirks()
