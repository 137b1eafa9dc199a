"""Choice of PDOs for the requested objects, ETG.1000.6 §5.6.7.4 (0x1C12, 0x1C13 and PDOs).

Order of preference:

1. The present assignment: nothing is written. Optional objects that are not mapped are left out.
2. Another combination of the PDOs that the device offers (`pdo_search.py`): 0x1C1x is written. The
   combination also carries optional objects if possible.
3. A PDO that is not fixed also gets the missing required objects (`pdo_rewrite.py`), if the SII
   allows it.

An optional object alone never causes a write. The device may refuse it although its SII allows it,
and the bring-up would fail for an object that is not needed. A mapping that the application
specifies by numbers is tried regardless of the SII, because the permission bits of SIIs are often
wrong. IgH (fsm_pdo.c) also honours both bits, but warns and continues. PDOs that the application
chooses by their names follow the rules of the ESI (`named_pdos.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NoReturn

from catenary.errors import MappingError
from catenary.model.device import DeviceDescription, Direction, mapped_entries
from catenary.plan.named_pdos import check_rules
from catenary.plan.pdo_mapping import (
    Mapping,
    assignment_refusal,
    available_pdos,
    check_channel,
    with_pdos,
)
from catenary.plan.pdo_rewrite import rewrite, rewrite_refusal, write_down
from catenary.plan.pdo_search import (
    any_carries,
    explain_failure,
    find_combination,
    object_names,
    pdo_names,
)

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import ObjectReference, WrittenPdo

BITS_MAX = 1486 * 8  # the data of a device must fit into one datagram
OFFERS_SHOWN = 12


def make_mapping(
    device: DeviceDescription,
    direction: Direction,
    requested: Sequence[ObjectReference],
    written: Sequence[WrittenPdo] = (),
) -> Mapping:
    """Return the mapping with the specified PDOs, or find one that carries all required objects.

    The search prefers the mapping that changes least.

    Args:
        device: The device, with its present mapping.
        direction: Outputs or inputs.
        requested: Requested objects. Optional ones alone cause no change; those that are not mapped
            are in `left_out`.
        written: PDOs of this direction that the application specified; empty to search for PDOs.

    Raises:
        MappingError: No mapping is possible. The error names each alternative and its obstacle.
    """
    requested = tuple(dict.fromkeys(requested))
    if written:
        check_rules(device, direction, written)
        mapping = write_down(device, direction, written)
        _check_written(device, direction, mapping, requested)
    else:
        mapping = _search(device, direction, requested)
    _check_size(device, direction, mapping)
    mapped = {(entry.index, entry.subindex) for entry in mapped_entries(mapping.assignments)}
    left_out = [each for each in requested if (each.index, each.subindex) not in mapped]
    return replace(mapping, left_out=tuple(left_out))


def _search(
    device: DeviceDescription, direction: Direction, requested: Sequence[ObjectReference]
) -> Mapping:
    required = [each for each in requested if each.required]
    current = Mapping(device.assignments(direction))
    if not _missing(current, required):
        return current
    if device.coe:
        check_channel(device, direction)
    found = _assign_most(device, direction, requested)
    if found is not None:
        return replace(found, rejected=(_as_now(current, required),))
    rejected = (_as_now(current, required), _no_combination(device, direction, required))
    missing = _missing(current, required)
    refusal = rewrite_refusal(device, direction, missing)
    if refusal:
        _refuse(device, direction, missing, (*rejected, f"rewriting a PDO: {refusal}"))
    return replace(rewrite(device, direction, missing, required), rejected=rejected)


def _missing(mapping: Mapping, requested: Sequence[ObjectReference]) -> list[ObjectReference]:
    return [each for each in requested if not any_carries(mapping.pdos, each)]


def _assign(
    device: DeviceDescription, direction: Direction, requested: Sequence[ObjectReference]
) -> Mapping | None:
    """Return a combination of the PDOs that the device offers; None if none is possible."""
    if assignment_refusal(device, direction):
        return None
    assigned, offered, elsewhere = available_pdos(device, direction)
    here = [each for each in requested if not any_carries(elsewhere, each)]
    found = find_combination(assigned, offered, here)
    return None if found is None else with_pdos(device, direction, found.pdos)


def _assign_most(
    device: DeviceDescription, direction: Direction, requested: Sequence[ObjectReference]
) -> Mapping | None:
    """Return a combination with all required objects and, if possible, the optional ones.

    Return None if no combination carries the required objects.
    """
    kept = [each for each in requested if each.required]
    found = _assign(device, direction, kept)
    if found is None:
        return None
    for reference in requested:
        more = None if reference.required else _assign(device, direction, [*kept, reference])
        if more is not None:
            kept.append(reference)
            found = more
    return found


def _as_now(current: Mapping, requested: Sequence[ObjectReference]) -> str:
    lengths = {(e.index, e.subindex): e.bit_length for e in mapped_entries(current.assignments)}
    reasons = []
    for each in _missing(current, requested):
        bits = lengths.get((each.index, each.subindex))
        other = f"is mapped with {bits} bits, but {each.bit_length} were requested"
        reasons.append(f"{object_names([each])} {'is not mapped' if bits is None else other}")
    return f"as assigned now ({pdo_names(current.pdos)}): {'; '.join(reasons)}"


def _no_combination(
    device: DeviceDescription, direction: Direction, required: Sequence[ObjectReference]
) -> str:
    reason = assignment_refusal(device, direction)
    if not reason:
        assigned, offered, elsewhere = available_pdos(device, direction)
        here = [each for each in required if not any_carries(elsewhere, each)]
        reason = explain_failure(assigned, offered, here)
    return f"another combination of its PDOs: {reason}"


def _check_written(
    device: DeviceDescription,
    direction: Direction,
    mapping: Mapping,
    requested: Sequence[ObjectReference],
) -> None:
    missing = [each for each in _missing(mapping, requested) if each.required]
    if missing:
        carried = pdo_names(mapping.pdos)
        by = f" by {mapping.source}" * bool(mapping.source)
        reason = f"as specified{by} ({carried}): {object_names(missing)} is not in them"
        _refuse(device, direction, missing, (reason,))


def _check_size(device: DeviceDescription, direction: Direction, mapping: Mapping) -> None:
    for assignment in mapping.assignments:
        if assignment.bit_length > BITS_MAX:
            raise MappingError(
                f"{device}: {assignment.byte_length} bytes of {direction.noun} in SyncManager "
                f"{assignment.sync_manager} do not fit into a datagram of {BITS_MAX // 8} bytes",
                hint="request fewer objects",
            )


def _refuse(
    device: DeviceDescription,
    direction: Direction,
    missing: Sequence[ObjectReference],
    rejected: Sequence[str],
) -> NoReturn:
    alternatives = "".join(f"\n    {each}" for each in rejected)
    raise MappingError(
        f"{device}: its {direction.noun} cannot carry {object_names(missing)}:{alternatives}",
        hint=f"{_offers(device, direction)}; request these, use SDO for the others, or "
        "specify the PDOs with pdos=",
    )


def _offers(device: DeviceDescription, direction: Direction) -> str:
    objects = sorted(
        {
            f"0x{entry.index:04X}:{entry.subindex:02X}"
            for pdo in device.pdos(direction)
            for entry in pdo.entries
            if entry.index
        }
    )
    if not objects:
        return f"the device has no PDOs for {direction.noun}"
    shown = ", ".join(objects[:OFFERS_SHOWN]) + (" ..." if len(objects) > OFFERS_SHOWN else "")
    return f"its PDOs for {direction.noun} offer {shown}"
