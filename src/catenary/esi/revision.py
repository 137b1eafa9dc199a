"""Rules for the revision of a device, against the revision in its ESI (`CheckRevisionNo`).

HW is the high word of the revision, LW the low word (ETG.2000, `Device/Type`).
"""

from __future__ import annotations

from collections.abc import Callable

from catenary.esi.device import DeviceKey, RevisionCheck

Rule = Callable[[int, int, int, int], bool]  # HW and LW found, HW and LW in the file

_RULES: dict[RevisionCheck, Rule] = {
    RevisionCheck.EQUAL: lambda hw, lw, hw0, lw0: (hw, lw) == (hw0, lw0),
    RevisionCheck.EQUAL_OR_GREATER: lambda hw, lw, hw0, lw0: (hw, lw) >= (hw0, lw0),
    RevisionCheck.LOW_EQUAL: lambda hw, lw, hw0, lw0: lw == lw0,
    RevisionCheck.LOW_EQUAL_OR_GREATER: lambda hw, lw, hw0, lw0: lw >= lw0,
    RevisionCheck.LOW_EQUAL_HIGH_EQUAL_OR_GREATER: lambda hw, lw, hw0, lw0: lw == lw0 and hw >= hw0,
    RevisionCheck.HIGH_EQUAL: lambda hw, lw, hw0, lw0: hw == hw0,
    RevisionCheck.HIGH_EQUAL_OR_GREATER: lambda hw, lw, hw0, lw0: hw >= hw0,
    RevisionCheck.HIGH_EQUAL_LOW_EQUAL_OR_GREATER: lambda hw, lw, hw0, lw0: hw == hw0 and lw >= lw0,
}


def revision_accepted(rule: RevisionCheck, described: DeviceKey, revision: int) -> bool:
    """Return True if the rule accepts a device with this revision. Without a rule, return True.

    Args:
        rule: Rule of the ESI.
        described: Key of the device in the ESI.
        revision: Revision of the device.
    """
    accepts = _RULES.get(rule)
    if accepts is None:
        return True
    expected = described.revision
    return accepts(revision >> 16, revision & 0xFFFF, expected >> 16, expected & 0xFFFF)
