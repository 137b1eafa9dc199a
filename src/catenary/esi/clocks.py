"""Distributed clocks of an ESI device (`Dc`)."""

from __future__ import annotations

from catenary.esi.device import EsiModeSyncManager, EsiOpMode
from catenary.esi.findings import Findings, text_of
from catenary.esi.xml import Element


def read_op_modes(device: Element, findings: Findings) -> tuple[EsiOpMode, ...]:
    """Return the modes of the distributed clocks, in the order of the file.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    clocks = device.find("Dc")
    elements = clocks.all("OpMode") if clocks is not None else ()
    return tuple(_op_mode(element, findings) for element in elements)


def _op_mode(element: Element, findings: Findings) -> EsiOpMode:
    shift = element.find("ShiftTimeSync0")
    sync0, sync1 = element.find("CycleTimeSync0"), element.find("CycleTimeSync1")
    managers = (_sync_manager(child, findings) for child in element.all("Sm"))
    return EsiOpMode(
        name=text_of(element, "Name"),
        description=text_of(element, "Desc"),
        assign_activate=findings.required(element, "AssignActivate", bits=16, reaction="0 assumed")
        or 0,
        sync0_ns=_time(sync0, findings),
        sync0_factor=_factor(sync0, findings),
        shift_ns=_time(shift, findings),
        shift_factor=_factor(shift, findings),
        shift_of_inputs=findings.flag(shift, "Input"),
        sync1_ns=_time(sync1, findings),
        sync1_factor=_factor(sync1, findings),
        sync1_shift_ns=_time(element.find("ShiftTimeSync1"), findings),
        sync_managers=tuple(manager for manager in managers if manager is not None),
        source=findings.source(element),
    )


def _time(element: Element | None, findings: Findings) -> int:
    return findings.integer(element, signed=True)


def _factor(element: Element | None, findings: Findings) -> int:
    return findings.integer(element, "Factor", bits=16, signed=True)


def _sync_manager(element: Element, findings: Findings) -> EsiModeSyncManager | None:
    index = findings.number(element, "No", bits=8)
    if index is None:
        findings.warn(element, "Sm of an OpMode without a number is ignored")
        return None
    found = [(findings.number(pdo, bits=16), pdo) for pdo in element.all("Pdo")]
    pdos = [(number, pdo) for number, pdo in found if number is not None]
    return EsiModeSyncManager(
        index=index,
        sync_type=findings.number(element.find("SyncType"), bits=16),
        cycle_ns=findings.number(element.find("CycleTime"), signed=True),
        shift_ns=findings.number(element.find("ShiftTime"), signed=True),
        pdos=tuple(number for number, _ in pdos),
        oversampling=tuple(findings.integer(pdo, "OSFac", default=1, bits=16) for _, pdo in pdos),
    )
