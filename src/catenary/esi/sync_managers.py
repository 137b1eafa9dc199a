"""SyncManagers and FMMUs of an ESI device (`Sm`, `Fmmu`)."""

from __future__ import annotations

from catenary.esi.device import EsiSyncManager
from catenary.esi.findings import Findings
from catenary.esi.values import plain_text, shown
from catenary.esi.xml import Element
from catenary.wire.sii_categories import SyncManagerUse

USES = {
    "mboxout": SyncManagerUse.MAILBOX_OUT,
    "mbxout": SyncManagerUse.MAILBOX_OUT,
    "mboxin": SyncManagerUse.MAILBOX_IN,
    "mbxin": SyncManagerUse.MAILBOX_IN,
    "outputs": SyncManagerUse.OUTPUTS,
    "output": SyncManagerUse.OUTPUTS,
    "inputs": SyncManagerUse.INPUTS,
    "input": SyncManagerUse.INPUTS,
    "dynamicoutputs": SyncManagerUse.OUTPUTS,  # Beckhoff AX5000
    "dynamicinputs": SyncManagerUse.INPUTS,
    "": SyncManagerUse.UNUSED,
}
USE_OF = {"RxPdo": SyncManagerUse.OUTPUTS, "TxPdo": SyncManagerUse.INPUTS}
COUNT_MAX = 16  # ETG.1000.4 §6.7
# Register 0x0804 + 8·index, ETG.1000.4 §6.7: buffer mode and direction.
MODE, MAILBOX, WRITTEN = 0x03, 0x02, 0x04


def read_sync_managers(device: Element, findings: Findings) -> tuple[EsiSyncManager, ...]:
    """Return the SyncManagers of a device, numbered in the order of the file.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    carried = {pdo.attributes.get("Sm", "").strip(): USE_OF[pdo.tag] for pdo in device.all(*USE_OF)}
    return tuple(
        _sync_manager(index, element, carried.get(str(index)), findings)
        for index, element in enumerate(device.all("Sm")[:COUNT_MAX])
    )


def read_fmmus(device: Element) -> tuple[str, ...]:
    """Return the texts of the FMMUs of a device, in the order of the file."""
    return tuple(plain_text(element.text) for element in device.all("Fmmu"))


def _sync_manager(
    index: int, element: Element, carried: SyncManagerUse | None, findings: Findings
) -> EsiSyncManager:
    control = findings.integer(element, "ControlByte", bits=8)
    return EsiSyncManager(
        index=index,
        use=_use(element, control, carried, findings),
        start=findings.integer(element, "StartAddress", bits=16),
        default_size=findings.integer(element, "DefaultSize", bits=16),
        min_size=findings.number(element, "MinSize", bits=16),
        max_size=findings.number(element, "MaxSize", bits=16),
        control=control,
        enabled=findings.flag(element, "Enable", default=True),
        virtual=findings.flag(element, "Virtual"),
        op_only=findings.flag(element, "OpOnly"),
        fixed_assignment=findings.flag(element, "FixedAssignment"),
        name=plain_text(element.text),
        source=findings.source(element),
    )


def _use(
    element: Element, control: int, carried: SyncManagerUse | None, findings: Findings
) -> SyncManagerUse:
    """Return the use that the text names; for other texts, that of its PDOs or control byte."""
    text = plain_text(element.text)
    known = USES.get(text.lower())
    if known is not None:
        return known
    use = carried if carried is not None else _use_of_control(control)
    cause = "PDOs" if carried is not None else f"control byte 0x{control:02X}"
    findings.warn(
        element, f"Sm: unknown text {shown(text)}; used as {use.name} because of its {cause}"
    )
    return use


def _use_of_control(control: int) -> SyncManagerUse:
    written = bool(control & WRITTEN)
    if control & MODE == MAILBOX:
        return SyncManagerUse.MAILBOX_OUT if written else SyncManagerUse.MAILBOX_IN
    return SyncManagerUse.OUTPUTS if written else SyncManagerUse.INPUTS
