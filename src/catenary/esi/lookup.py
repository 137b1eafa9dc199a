"""Choice of a description by vendor, product and revision.

Beckhoff's rule is that the revision of the device is not below that of the configuration
(infosys.beckhoff.com, ethercatsystem/2477553291), because newer devices support older descriptions.
So the newest description that is not above the device is used. `CheckRevisionNo` (ETG.2000) states
the vendor's own rule. Descriptions whose rule accepts the device are preferred.

`HideType` names older revisions that a newer one replaces in a catalogue. A device of an older
revision still needs its own description. So hidden ones are only omitted from a search without a
revision, as in EtherLab (getEtherCATInfo.m).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from catenary.esi.device import DeviceKey, RevisionCheck
from catenary.esi.record import Record

LOW = 0xFFFF

# rules by (device revision, revision in the file); HW is the high word, LW the low word
RULES: Mapping[RevisionCheck, Callable[[int, int], bool]] = {
    RevisionCheck.NONE: lambda device, file: device >= file,
    RevisionCheck.EQUAL: lambda device, file: device == file,
    RevisionCheck.EQUAL_OR_GREATER: lambda device, file: device >= file,
    RevisionCheck.LOW_EQUAL: lambda device, file: device & LOW == file & LOW,
    RevisionCheck.LOW_EQUAL_OR_GREATER: lambda device, file: device & LOW >= file & LOW,
    RevisionCheck.LOW_EQUAL_HIGH_EQUAL_OR_GREATER: lambda device, file: (
        device & LOW == file & LOW and device >> 16 >= file >> 16
    ),
    RevisionCheck.HIGH_EQUAL: lambda device, file: device >> 16 == file >> 16,
    RevisionCheck.HIGH_EQUAL_OR_GREATER: lambda device, file: device >> 16 >= file >> 16,
    RevisionCheck.HIGH_EQUAL_LOW_EQUAL_OR_GREATER: lambda device, file: (
        device >> 16 == file >> 16 and device & LOW >= file & LOW
    ),
}


class Rule(StrEnum):
    """Rule by which a description was chosen."""

    EXACT = "exact revision"
    NOT_ABOVE = "newest revision not above the device's"
    REFUSED = (
        "newest revision not above the device's, although its CheckRevisionNo refuses the device"
    )
    ACCEPTED = "newer revision whose CheckRevisionNo accepts the device"
    NEWEST = "newest revision"
    UNSUITABLE = "no suitable revision"


@dataclass(frozen=True, slots=True)
class Choice:
    """Descriptions with the chosen key, the preferred one first; empty if none is suitable."""

    rule: Rule
    records: tuple[Record, ...]
    candidates: tuple[Record, ...]  # all revisions of the product, newest first

    @property
    def record(self) -> Record | None:
        """The preferred description; None if none is suitable."""
        return self.records[0] if self.records else None


def accepts(check: RevisionCheck, device: int, file: int) -> bool:
    """Return True if a device fulfils the rule of a description.

    Args:
        check: The rule in the file. Without a rule, equal and newer devices are accepted.
        device: Revision of the device.
        file: Revision in the file.
    """
    return RULES[check](device, file)


def choose(records: Iterable[Record], revision: int | None, order: str = "") -> Choice | None:
    """Choose among the descriptions of one product; None if there are none.

    Args:
        records: All descriptions of the product.
        revision: Revision of the device; None for the newest one that is not hidden.
        order: Order code that is preferred among descriptions of one revision.
    """
    ranked = sorted(records, key=_newest_first)
    ranked.sort(key=lambda each: (-each.entry.revision, each.entry.type != order))  # stable
    if not ranked:
        return None
    rule, best = _newest(ranked) if revision is None else _for_device(ranked, revision)
    same = tuple(each for each in ranked if best is not None and each.key == best.key)
    return Choice(rule, same, tuple(ranked))


def _newest_first(record: Record) -> tuple[int, int, str, int]:
    """Order of preference: revision, then the source added last, then path and line."""
    return -record.entry.revision, -record.order, record.path, record.entry.line


def _for_device(ranked: Sequence[Record], revision: int) -> tuple[Rule, Record | None]:
    accepted = [
        each for each in ranked if accepts(each.entry.revision_check, revision, each.entry.revision)
    ]
    below = [each for each in ranked if each.entry.revision < revision]
    tries = (
        (Rule.EXACT, [each for each in ranked if each.entry.revision == revision]),
        (Rule.NOT_ABOVE, [each for each in accepted if each.entry.revision < revision]),
        (Rule.REFUSED, below),
        (Rule.ACCEPTED, _oldest(accepted)),
    )
    for rule, found in tries:
        if found:
            return rule, found[0]
    return Rule.UNSUITABLE, None


def _oldest(ranked: Sequence[Record]) -> list[Record]:
    """Return the records of the oldest revision, the preferred one first."""
    return [each for each in ranked if each.entry.revision == ranked[-1].entry.revision]


def _newest(ranked: Sequence[Record]) -> tuple[Rule, Record]:
    hidden = hidden_keys(ranked)
    shown = [each for each in ranked if each.key not in hidden]
    return Rule.NEWEST, (shown or list(ranked))[0]


def hidden_keys(records: Iterable[Record]) -> frozenset[DeviceKey]:
    """Return the keys that newer descriptions hide. A description cannot hide itself."""
    return frozenset(key for each in records for key in each.entry.hides if key != each.key)


def newest(records: Iterable[Record]) -> list[Record]:
    """Return the newest revision of each product."""
    found: dict[tuple[int, int], Record] = {}
    for each in records:
        old = found.setdefault((each.entry.vendor, each.entry.product), each)
        if each.entry.revision > old.entry.revision:
            found[each.entry.vendor, each.entry.product] = each
    return list(found.values())
