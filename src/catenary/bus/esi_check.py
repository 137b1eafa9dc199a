"""Comparison of the devices of a segment with their ESI. The devices are only read."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol, TypeVar

from catenary.errors import CatenaryError, DecodeError
from catenary.esi.compare import another_device, compare
from catenary.esi.default_modules import with_default_modules
from catenary.esi.device import EsiDevice
from catenary.esi.difference import Difference
from catenary.model.coe_facts import CoeFacts
from catenary.model.device import DeviceDescription
from catenary.procedure.al_state import read_state, request_state
from catenary.procedure.coe_facts import Progress, Question, in_pre_op, read_coe_facts
from catenary.procedure.exchange import Procedure
from catenary.procedure.sii import read_image
from catenary.procedure.sii_owner import with_eeprom
from catenary.procedure.station import station_of
from catenary.wire.al import AlState
from catenary.wire.sii import CHECKSUM_DISABLED, CHECKSUM_WORD, Sii, decode_sii
from catenary.wire.sii_categories import CoeDetails, SyncManagerUse

T = TypeVar("T")
PROCESS_DATA = (SyncManagerUse.OUTPUTS, SyncManagerUse.INPUTS)
NOT_READ = "its object dictionary was not read: "


class Conversing(Protocol):
    """Part of a MainDevice that this module needs."""

    def converse(self, procedure: Procedure[T]) -> T: ...


@dataclass(frozen=True, slots=True)
class Depth:
    """Extent of a comparison."""

    coe: bool = True  # True to read objects in PRE-OP; False changes no state
    objects: bool = False  # True to compare the whole object dictionary
    reason: str = ""  # why `coe` is False


@dataclass(frozen=True, slots=True)
class Comparison:
    """Differences of one device, and notes about what was not compared."""

    differences: tuple[Difference, ...]
    notes: tuple[str, ...] = ()


def check_device(
    main: Conversing,
    device: DeviceDescription,
    esi: EsiDevice,
    depth: Depth,
    progress: Progress,
) -> Comparison:
    """Compare one device with its ESI.

    Its SII is read. For its objects, a device in INIT or PRE-OP is brought to PRE-OP and back.
    A device in another state keeps it.

    Args:
        main: MainDevice of the device.
        device: The device, from a passive scan.
        esi: Its ESI.
        depth: Extent of the comparison.
        progress: Function to call with (objects read, objects in total).
    """
    if another_device(device.identity, esi):
        return Comparison(compare(device, esi))
    notes: list[str] = []
    sii = _sii(main, device, notes)
    coe = None
    if device.coe and depth.coe:
        coe = _coe_facts(main, device, _question(device, esi, sii, depth), notes, progress)
    elif device.coe and depth.reason:
        notes.append(NOT_READ + depth.reason)
    return Comparison(compare(device, esi, sii, coe), tuple(notes))


def _sii(main: Conversing, device: DeviceDescription, notes: list[str]) -> Sii | None:
    """Return the SII, even if its checksum is wrong; None if it cannot be decoded.

    In both cases, a note names the fault.
    """
    station = station_of(device)
    image = main.converse(with_eeprom(station, read_image(station)))
    try:
        return decode_sii(image)
    except DecodeError as error:
        notes.append(error.message)
    start = 2 * CHECKSUM_WORD
    ignored = CHECKSUM_DISABLED.to_bytes(2, "little")
    try:
        return decode_sii(image[:start] + ignored + image[start + 2 :])
    except DecodeError:
        return None


def _question(device: DeviceDescription, esi: EsiDevice, sii: Sii | None, depth: Depth) -> Question:
    whole = with_default_modules(esi)
    claimed = sii.general.coe if sii is not None and sii.general is not None else CoeDetails(0)
    pdos = [pdo.index for pdo in whole.pdos]
    pdos += [pdo.index for pdo in (*sii.receive_pdos, *sii.transmit_pdos)] if sii else []
    managers = {each.index for each in esi.sync_managers if each.use in PROCESS_DATA}
    managers |= {each.index for each in device.sync_managers if each.use in PROCESS_DATA}
    given, objects = esi.mailbox, whole.dictionary.objects if whole.dictionary else {}
    return Question(
        sync_managers=tuple(sorted(managers)),
        pdos=tuple(dict.fromkeys(pdos)),
        sdo_information=CoeDetails.SDO_INFORMATION in claimed
        or (given is not None and given.sdo_information),
        complete_access=CoeDetails.COMPLETE_ACCESS in claimed
        or (given is not None and given.complete_access),
        objects=tuple(objects) if depth.objects else None,
    )


def _coe_facts(
    main: Conversing,
    device: DeviceDescription,
    question: Question,
    notes: list[str],
    progress: Progress,
) -> CoeFacts | None:
    """Return the facts; None with a note if the mailbox of the device cannot be used."""
    station = station_of(device)
    try:
        before = main.converse(read_state(station)).state
        try:
            facts = main.converse(
                in_pre_op(
                    station, device, lambda channel: read_coe_facts(channel, question, progress)
                )
            )
        except KeyboardInterrupt:
            if before is AlState.INIT:
                with suppress(CatenaryError):
                    main.converse(request_state(station, before))
            raise
    except CatenaryError as error:
        hint = f" ({error.hint})" if error.hint else ""
        notes.append(f"{NOT_READ}{error.message}{hint}")
        return None
    notes += facts.notes
    return facts
