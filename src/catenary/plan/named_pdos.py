"""Choice of PDOs by name, and the rules of an ESI for their assignment.

A name is that of a PDO, or of an assignment of several PDOs (`AlternativeSmMapping`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from itertools import combinations
from typing import TYPE_CHECKING

from catenary.errors import MappingError
from catenary.model.device import DeviceDescription, Direction, Pdo
from catenary.plan.pdo_search import pdo_names

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import WrittenPdo


def pdos_named(device: DeviceDescription, name: str) -> tuple[WrittenPdo, ...]:
    """Return the PDO with a name, or the PDOs of the mapping with this name; case is ignored.

    Args:
        device: Device with its PDOs.
        name: Name of a mapping or of a PDO.

    Raises:
        MappingError: The name is unknown, or several PDOs have it.
    """
    from catenary.plan.request import WrittenPdo

    wanted = name.casefold()
    for mapping in device.named_mappings:
        if mapping.name.casefold() == wanted:
            return tuple(
                WrittenPdo(index, None, channel, name=mapping.name, source=mapping.source)
                for channel, indices in mapping.pdos
                for index in indices
            )
    pdos = (*device.output_pdos, *device.input_pdos)
    found = [pdo for pdo in pdos if pdo.name.casefold() == wanted]
    if len(found) == 1:
        return (WrittenPdo(found[0].index, name=found[0].name),)
    if found:
        raise MappingError(
            f"{device}: {len(found)} PDOs have the name {name!r}: {pdo_names(found)}",
            hint="use the number of the PDO in pdos=",
        )
    raise _unknown(device, name, pdos)


def check_rules(
    device: DeviceDescription, direction: Direction, written: Sequence[WrittenPdo]
) -> None:
    """Check PDOs that were chosen by name: Mandatory, Exclude, Fixed and ExcludedSm.

    PDOs that were given only by numbers are not checked, because such flags are often wrong.

    Args:
        device: Device with its PDOs and their rules.
        direction: Outputs or inputs.
        written: PDOs of the direction, as chosen by the application.

    Raises:
        MappingError: The choice breaks rules. The error names each of them, with file and line.
    """
    if not any(each.name for each in written):
        return
    broken = list(_broken_rules(device, direction, written))
    if not broken:
        return
    lines = "".join(f"\n    {each}" for each in broken)
    raise MappingError(
        f"{device}: these PDOs cannot be assigned together as {direction.noun}: "
        f"{', '.join(_label(each) for each in written)}:{lines}",
        hint="choose other names; with numbers in pdos=, these rules are not checked",
    )


def _broken_rules(
    device: DeviceDescription, direction: Direction, written: Sequence[WrittenPdo]
) -> Iterator[str]:
    known = {pdo.index: pdo for pdo in device.pdos(direction)}
    chosen = [known[each.index] for each in written if each.index in known]
    for one, other in combinations(chosen, 2):
        for first, second in ((one, other), (other, one)):
            if second.index in first.excludes:
                yield f"{_name(first)} excludes {_name(second)}{_place(first)}"
    taken = {pdo.index for pdo in chosen}
    for pdo in device.pdos(direction):
        if pdo.mandatory and pdo.index not in taken:
            yield f"{_name(pdo)} is mandatory{_place(pdo)}"
    for each in written:
        pdo = known.get(each.index, Pdo(each.index, (), None))
        if each.sync_manager in pdo.excluded_sync_managers:
            yield f"{_name(pdo)} cannot be in SyncManager {each.sync_manager}{_place(pdo)}"
        if pdo.fixed and each.entries is not None:
            yield f"{_name(pdo)} is fixed: its entries cannot be changed{_place(pdo)}"


def _unknown(device: DeviceDescription, name: str, pdos: Sequence[Pdo]) -> MappingError:
    names = [mapping.name for mapping in device.named_mappings]
    names += [pdo.name for pdo in pdos if pdo.name]
    near = get_close_matches(name, names, n=3) or names
    shown = ", ".join(repr(each) for each in dict.fromkeys(near))
    return MappingError(
        f"{device}: no PDO or mapping has the name {name!r}",
        hint=f"known names: {shown}"
        if shown
        else "its PDOs have no names: use their numbers, or scan with its ESI file",
    )


def _label(written: WrittenPdo) -> str:
    return f"{written.name!r} (0x{written.index:04X})" if written.name else f"0x{written.index:04X}"


def _name(pdo: Pdo) -> str:
    return f"0x{pdo.index:04X} {pdo.name!r}" if pdo.name else f"0x{pdo.index:04X}"


def _place(pdo: Pdo) -> str:
    return f": {pdo.source}" if pdo.source else ""
