"""PDOs and clock modes of an ESI as contents of SII categories 50, 51 and 60 (ETG.2010)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from catenary import types
from catenary.esi.device import EsiEntry, EsiOpMode, EsiPdo
from catenary.esi.dictionary import EsiDictionary
from catenary.esi.sii_strings import SiiStrings
from catenary.wire.sii_categories import ClockMode, Pdo, PdoEntry, PdoFlags

NOT_ASSIGNED = 0xFF
BITS_MAX = 255  # the length of an entry has one byte
PART_BITS = 248  # largest multiple of 8 below it
_DERIVATIONS_MAX = 8  # in a chain of derived types
_LENGTH = re.compile(r"\(.*\)$")  # STRING(26)
_BYTES = re.compile(r"^ARRAY\s*\[.*\]\s*OF\s+(BYTE|USINT)$", re.IGNORECASE)


def type_number(name: str, dictionary: EsiDictionary | None) -> int:
    """Return the CoE index of a data type; 0 if it has none that fits into a byte.

    Args:
        name: Name of the data type in the file: a base type, an alias, or a declared type.
        dictionary: Declared types; None if the file has none.
    """
    for _ in range(_DERIVATIONS_MAX):
        bare = _LENGTH.sub("", name).strip()
        if _BYTES.match(bare):
            return types.OCTET_STRING.index
        try:
            return types.by_name(bare).index
        except ValueError:
            declared = dictionary.types.get(name) if dictionary is not None else None
        if declared is None or declared.arrays or declared.members or not declared.base:
            return 0
        name = declared.base
    return 0


def sii_pdos(
    pdos: Sequence[EsiPdo],
    dictionary: EsiDictionary | None,
    strings: SiiStrings,
    notes: list[str],
    *,
    names: bool = True,
) -> tuple[Pdo, ...]:
    """Return the PDOs of one direction for category 50 or 51.

    Args:
        pdos: PDOs of the direction.
        dictionary: Declared data types.
        strings: Strings of the image, which receive the names.
        notes: Receives a note for each difference from the file.
        names: False leaves the names of PDOs and entries out.
    """

    def number(name: str) -> int:
        return strings.number(name) if names else 0

    def entry(each: EsiEntry) -> Iterator[PdoEntry]:
        data_type = type_number(each.type, dictionary) if each.type else 0
        for bits in _parts(each.bit_length):
            yield PdoEntry(each.index, each.subindex, bits, data_type, number(each.name))

    return tuple(
        Pdo(
            pdo.index,
            tuple(part for each in pdo.entries for part in entry(each)),
            NOT_ASSIGNED if pdo.sync_manager is None else pdo.sync_manager,
            name=number(pdo.name),
            flags=_flags(pdo),
        )
        for pdo in _noted(pdos, notes)
    )


def _noted(pdos: Sequence[EsiPdo], notes: list[str]) -> Sequence[EsiPdo]:
    for pdo in pdos:
        for each in pdo.entries:
            if each.bit_length > BITS_MAX:
                notes.append(
                    f"PDO 0x{pdo.index:04X}: 0x{each.index:04X}:{each.subindex:02X} has "
                    f"{each.bit_length} bits and is written in parts of {PART_BITS} bits, because "
                    "an entry of an SII has at most 255 bits"
                )
    return pdos


def _parts(bits: int) -> Iterator[int]:
    """Yield the lengths of the SII entries for one entry, so that their sum is right."""
    while bits > BITS_MAX:
        yield PART_BITS
        bits -= PART_BITS
    yield bits


def _flags(pdo: EsiPdo) -> PdoFlags:
    """Return the flags of a PDO.

    DEFAULT is not set for assigned PDOs: no vendor's image sets it (Beckhoff EL2004, Pollen).
    """
    flags = PdoFlags(0)
    for given, flag in (
        (pdo.mandatory, PdoFlags.MANDATORY),
        (pdo.fixed, PdoFlags.FIXED_CONTENT),
        (pdo.virtual, PdoFlags.VIRTUAL_CONTENT),
        (pdo.depends_on_slot, PdoFlags.DEPENDS_ON_SLOT),
        (pdo.overwritten_by_module, PdoFlags.OVERWRITTEN_BY_MODULE),
        (pdo.oversampling_max, PdoFlags.OVERSAMPLE),
    ):
        if given:
            flags |= flag
    return flags


def sii_clock_modes(
    modes: Sequence[EsiOpMode], strings: SiiStrings, notes: list[str]
) -> tuple[ClockMode, ...]:
    """Return the clock modes for category 60.

    Args:
        modes: OpModes of the file.
        strings: Strings of the image, which receive the names and descriptions.
        notes: Receives a note for each setting that category 60 cannot contain.
    """
    return tuple(_clock_mode(mode, strings, notes) for mode in modes)


def _clock_mode(mode: EsiOpMode, strings: SiiStrings, notes: list[str]) -> ClockMode:
    lost = [
        name
        for name, value in (
            ("the factor of ShiftTimeSync0", mode.shift_factor),
            ("the time in CycleTimeSync1", mode.sync1_ns),
            ("the settings of SyncManagers", mode.sync_managers),
        )
        if value
    ]
    if lost:
        notes.append(f"OpMode {mode.name!r}: an SII has no field for {', '.join(lost)}")
    return ClockMode(
        cycle_time_ns=mode.sync0_ns,
        shift_time_ns=mode.shift_ns,
        shift_time_1_ns=mode.sync1_shift_ns,
        sync1_factor=mode.sync1_factor,
        assign_activate=mode.assign_activate,
        sync0_factor=mode.sync0_factor,
        name=strings.number(mode.name),
        description=strings.number(mode.description),
    )
