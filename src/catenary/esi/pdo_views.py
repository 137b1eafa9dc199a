"""PDOs of a device as its ESI, its SII and its object dictionary give them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

from catenary.esi.device import EsiDevice, EsiPdo
from catenary.esi.sii_process_data import NOT_ASSIGNED, PART_BITS
from catenary.model.coe_facts import CoeFacts
from catenary.model.device import Direction
from catenary.wire.sii import Sii
from catenary.wire.sii_categories import Pdo as SiiPdo


@dataclass(frozen=True, slots=True)
class Piece:
    """One object in a PDO, and its place."""

    index: int
    subindex: int
    offset: int  # [bits]
    bits: int

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.subindex:02X} with {self.bits} bits at bit {self.offset}"


Layout: TypeAlias = tuple[tuple[Piece, ...], int]  # objects, and total length [bits]


class Views(NamedTuple):
    """PDOs of one direction, by source."""

    esi: Mapping[int, EsiPdo]
    sii: Mapping[int, SiiPdo] | None  # None if the SII lists no PDO of this direction
    coe: CoeFacts | None  # None if no PDO object of this direction can be read
    assigned: frozenset[int]  # PDOs that the device has assigned, if known
    modular: bool
    configurable: bool  # the entries can be changed
    assignable: bool  # the assignment can be changed

    def coe_layout(self, index: int) -> Layout | None:
        """Return the entries that the device has now; None if they cannot be read."""
        entries = self.coe.mappings.get(index) if self.coe is not None else None
        return None if entries is None else layout(entries)

    def sii_layout(self, index: int) -> Layout | None:
        """Return the entries in the SII; None if it does not list the PDO."""
        found = self.sii.get(index) if self.sii is not None else None
        return (
            None
            if found is None
            else layout([(e.index, e.subindex, e.bit_length) for e in found.entries])
        )

    def is_assigned(self, index: int) -> bool:
        """Return True if the ESI, the SII or the device assigns the PDO."""
        given, own = self.esi.get(index), self.sii.get(index) if self.sii is not None else None
        return (
            (given is not None and given.sync_manager is not None)
            or (own is not None and own.sync_manager != NOT_ASSIGNED)
            or index in self.assigned
        )


def layout(entries: Sequence[tuple[int, int, int]]) -> Layout:
    """Return the objects of a PDO with their places.

    Args:
        entries: Index, subindex and number of bits. Index 0 marks a gap. Parts of one long entry
            are joined.
    """
    pieces: list[Piece] = []
    offset = 0
    for index, subindex, bits in entries:
        last = pieces[-1] if pieces else None
        joins = (
            last is not None
            and (last.index, last.subindex) == (index, subindex)
            and last.offset + last.bits == offset
            and last.bits % PART_BITS == 0
        )
        if last is not None and joins:
            pieces[-1] = replace(last, bits=last.bits + bits)
        elif index:
            pieces.append(Piece(index, subindex, offset, bits))
        offset += bits
    return tuple(pieces), offset


def views_of(esi: EsiDevice, sii: Sii | None, coe: CoeFacts | None, direction: Direction) -> Views:
    """Return the PDOs of one direction as the sources give them.

    Args:
        esi: The ESI, with its default modules in place.
        sii: The SII of the device; None if it cannot be decoded.
        coe: What the object dictionary gives; None if it was not read.
        direction: Outputs or inputs.
    """
    listed: tuple[SiiPdo, ...] = ()
    if sii is not None:
        listed = sii.receive_pdos if direction is Direction.OUTPUT else sii.transmit_pdos
    own = {pdo.index: pdo for pdo in esi.pdos_of(direction)}
    assigned = _assigned(esi, coe, direction)
    indices = {*own, *(pdo.index for pdo in listed), *assigned}
    readable = coe is not None and any(coe.mappings.get(i) is not None for i in indices)
    mailbox = esi.mailbox
    return Views(
        own,
        {pdo.index: pdo for pdo in listed} if listed else None,
        coe if readable else None,
        assigned,
        modular=esi.slots is not None,
        configurable=mailbox is not None and mailbox.pdo_configuration,
        assignable=mailbox is not None and mailbox.pdo_assign,
    )


def _assigned(esi: EsiDevice, coe: CoeFacts | None, direction: Direction) -> frozenset[int]:
    """Return the PDOs that the device has assigned to the SyncManagers of a direction."""
    if coe is None:
        return frozenset()
    managers = (each.index for each in esi.sync_managers if each.use is direction.use)
    return frozenset(index for each in managers for index in coe.assignments.get(each) or ())
