"""Description of a device from its registers and its SII image, ETG.1000.6 §5.4.

Real images have faults: no FMMU category, no end mark, vendor 0, PDOs assigned to a missing
SyncManager, an EEPROM that was never written. Such faults do not stop a scan. Unusable parts are
omitted, and a note in the description reports them.
"""

from __future__ import annotations

import struct
from dataclasses import replace

from catenary.errors import DecodeError
from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Entry,
    Identity,
    MailboxLayout,
    OpMode,
    Pdo,
    SyncManager,
)
from catenary.model.text import printable
from catenary.model.topology import open_ports
from catenary.wire import sii_categories
from catenary.wire.coe import SDO_SIZE
from catenary.wire.features import decode_information
from catenary.wire.frame import MAXIMUM_DATA
from catenary.wire.mailbox import HEADER_SIZE
from catenary.wire.register import PROCESS_RAM, SYNC_MANAGER_COUNT
from catenary.wire.sii import CHECKSUM_WORD, MailboxArea, MailboxProtocol, Sii, decode_sii
from catenary.wire.sii_categories import (
    CoeDetails,
    General,
    GeneralFlags,
    SyncManagerEnable,
    SyncManagerUse,
)
from catenary.wire.sync_manager import Buffering, Control
from catenary.wire.sync_manager import Direction as Flow

NOT_ASSIGNED = 0xFF
MAILBOX_MIN = HEADER_SIZE + SDO_SIZE  # [bytes]; the size of the shortest SDO message
RAM_END = 0x10000
_MANDATORY, _FIXED_CONTENT = 0x0001, 0x0010  # PDO flags, ETG.2010 table 14
_CHECKSUM_DISABLED = struct.pack("<H", 0x88A4)
_UNPROGRAMMED = (bytes(4), b"\xff\xff\xff\xff")

_KINDS = {
    (Buffering.MAILBOX, Flow.WRITE): SyncManagerUse.MAILBOX_OUT,
    (Buffering.MAILBOX, Flow.READ): SyncManagerUse.MAILBOX_IN,
    (Buffering.THREE_BUFFERS, Flow.WRITE): SyncManagerUse.OUTPUTS,
    (Buffering.THREE_BUFFERS, Flow.READ): SyncManagerUse.INPUTS,
}


def describe(
    position: int,
    *,
    station_address: int,
    alias: int,
    dl_status: int,
    information: bytes,
    image: bytes,
    system_time: bool = False,
) -> DeviceDescription:
    """Return the description of one device. Notes report faults of the image.

    Args:
        position: Position in the segment.
        station_address: Configured station address.
        alias: Station alias (0x0012).
        dl_status: DL status (0x0110).
        information: ESC information, 10 bytes (0x0000 to 0x0009).
        image: SII image, as far as it was read.
        system_time: True if the device has a system time (0x0910).

    Raises:
        DecodeError: `information` has the wrong size.
    """
    bare = DeviceDescription(
        position=position,
        station_address=station_address,
        alias=alias,
        identity=Identity(0, 0, 0, 0),
        name="unknown",
        controller=decode_information(information),
        mailbox=None,
        sync_managers=(),
        outputs=(),
        inputs=(),
        output_pdos=(),
        input_pdos=(),
        open_ports=open_ports(dl_status),
        system_time=system_time,
    )
    notes: list[str] = []
    sii = _decoded(image, notes)
    if sii is None:
        return replace(bare, notes=tuple(notes))
    return replace(_filled(bare, sii, notes), notes=tuple(notes))


def _decoded(image: bytes, notes: list[str]) -> Sii | None:
    try:
        return decode_sii(image)
    except DecodeError as error:
        notes.append(str(error.message))
    product = image[20:24]
    if product in _UNPROGRAMMED:
        return None
    # Some devices work with a wrong checksum, because their image was edited by hand.
    start = 2 * CHECKSUM_WORD
    try:
        return decode_sii(image[:start] + _CHECKSUM_DISABLED + image[start + 2 :])
    except DecodeError:
        return None


def _filled(bare: DeviceDescription, sii: Sii, notes: list[str]) -> DeviceDescription:
    header = sii.header
    managers = _sync_managers(sii, bare.controller.sync_manager_count, notes)
    texts = _Texts(sii)
    outputs = _pdos(texts, sii.receive_pdos, managers, SyncManagerUse.OUTPUTS, notes)
    inputs = _pdos(texts, sii.transmit_pdos, managers, SyncManagerUse.INPUTS, notes)
    general = sii.general or General()
    order = texts[general.order]
    name = texts[general.name]
    nameless = f"0x{header.vendor:08X}:0x{header.product:08X}"
    return replace(
        bare,
        identity=Identity(header.vendor, header.product, header.revision, header.serial),
        name=name or order or nameless,  # as in SOEM and IgH
        mailbox=_mailbox(sii, notes),
        bootstrap=bootstrap_mailbox(header.bootstrap_receive, header.bootstrap_send, "SII"),
        sync_managers=managers,
        outputs=assignments(outputs),
        inputs=assignments(inputs),
        output_pdos=outputs,
        input_pdos=inputs,
        op_modes=tuple(_op_mode(texts, mode) for mode in sii.clock_modes),
        group=texts[general.group],
        order=order,
        sii_denies_lrw=bool(general.flags & GeneralFlags.NO_LRW),
    )


def assignments(pdos: tuple[Pdo, ...]) -> tuple[Assignment, ...]:
    """Return the PDOs grouped by their default SyncManager."""
    channels = sorted({pdo.sync_manager for pdo in pdos if pdo.sync_manager is not None})
    return tuple(
        Assignment(channel, tuple(pdo for pdo in pdos if pdo.sync_manager == channel))
        for channel in channels
    )


def _mailbox(sii: Sii, notes: list[str]) -> MailboxLayout | None:
    receive, send = sii.header.standard_receive, sii.header.standard_send
    if not (receive.size and send.size):
        return None
    impossible = [area for area in (receive, send) if not _is_possible(area)]
    if impossible:
        notes.append(
            f"its SII specifies a mailbox of {impossible[0].size} bytes at "
            f"0x{impossible[0].offset:04X}, which is not used: a mailbox has {MAILBOX_MIN} to "
            f"{MAXIMUM_DATA} bytes and begins at 0x{PROCESS_RAM:04X} or above"
        )
        return None
    coe = sii.general.coe if sii.general else CoeDetails(0)
    # If no bit is set, the details are unknown, as in IgH (fsm_pdo.c, `has_general`).
    unknown = coe == CoeDetails(0)
    protocols = MailboxProtocol(sii.header.mailbox_protocols & 0x3F)
    return MailboxLayout(
        receive.offset,
        receive.size,
        send.offset,
        send.size,
        protocols,
        complete_access=CoeDetails.COMPLETE_ACCESS in coe,
        sdo_information=CoeDetails.SDO_INFORMATION in coe,
        pdo_assign=unknown or CoeDetails.PDO_ASSIGN in coe,
        pdo_configuration=unknown or CoeDetails.PDO_CONFIGURATION in coe,
        stated=not unknown,
    )


def bootstrap_mailbox(receive: MailboxArea, send: MailboxArea, source: str) -> MailboxLayout | None:
    """Return the mailbox of a device in BOOT; None if it has none, or one that is not possible.

    Args:
        receive: The memory that the MainDevice writes.
        send: The memory that the MainDevice reads.
        source: Origin of the two areas, such as "SII".
    """
    if not (_is_possible(receive) and _is_possible(send)):
        return None
    areas = (receive.offset, receive.size, send.offset, send.size)
    return MailboxLayout(*areas, MailboxProtocol.FOE, source=source)


def _is_possible(area: MailboxArea) -> bool:
    """Return True if a mailbox fits into one datagram and into the process-data memory."""
    end = area.offset + area.size
    return (
        MAILBOX_MIN <= area.size <= MAXIMUM_DATA and area.offset >= PROCESS_RAM and end <= RAM_END
    )


def _sync_managers(sii: Sii, supported: int, notes: list[str]) -> tuple[SyncManager, ...]:
    """Return the SyncManagers of the SII that the controller supports.

    Add a note if the SII has more. If `supported` is 0, the limit is SYNC_MANAGER_COUNT.
    """
    count = min(supported or SYNC_MANAGER_COUNT, SYNC_MANAGER_COUNT)
    if len(sii.sync_managers) > count:
        notes.append(
            f"its SII has {len(sii.sync_managers)} SyncManagers, its controller has {count}"
        )
    return tuple(
        SyncManager(
            index,
            _kind(entry),
            entry.address,
            entry.length,
            entry.control,
            SyncManagerEnable.ENABLED in entry.enable,
        )
        for index, entry in enumerate(sii.sync_managers[:count])
    )


def _kind(entry: sii_categories.SyncManagerEntry) -> SyncManagerUse:
    """Return the use of a SyncManager.

    Early images leave it at 0. It is then derived from the control byte, as in SOEM. A SyncManager
    without an address is unused.
    """
    if entry.use in (1, 2, 3, 4):
        return SyncManagerUse(entry.use)
    if not entry.address:
        return SyncManagerUse.UNUSED
    try:
        control = Control.from_byte(entry.control)
    except DecodeError:
        return SyncManagerUse.UNUSED
    return _KINDS[control.buffering, control.direction]


def _pdos(
    texts: _Texts,
    pdos: tuple[sii_categories.Pdo, ...],
    managers: tuple[SyncManager, ...],
    kind: SyncManagerUse,
    notes: list[str],
) -> tuple[Pdo, ...]:
    usable = {manager.index for manager in managers if manager.use is kind}
    found = []
    for pdo in pdos:
        channel = None if pdo.sync_manager == NOT_ASSIGNED else pdo.sync_manager
        if channel is not None and channel not in usable:
            notes.append(
                f"PDO 0x{pdo.index:04X} is assigned to SyncManager {channel}, which does not carry "
                f"{kind.name.lower()}"
            )
            channel = None
        entries = tuple(
            Entry(e.index, e.subindex, e.bit_length, texts[e.name], e.data_type)
            for e in pdo.entries
        )
        found.append(
            Pdo(
                pdo.index,
                entries,
                channel,
                fixed=bool(pdo.flags & _FIXED_CONTENT),
                mandatory=bool(pdo.flags & _MANDATORY),
                name=texts[pdo.name],
            )
        )
    return tuple(found)


def _op_mode(texts: _Texts, mode: sii_categories.ClockMode) -> OpMode:
    return OpMode(
        name=texts[mode.name],
        description=texts[mode.description],
        assign_activate=mode.assign_activate,
        sync0_ns=mode.cycle_time_ns,
        sync0_factor=mode.sync0_factor,
        shift_ns=mode.shift_time_ns,
        sync1_factor=mode.sync1_factor,
        sync1_shift_ns=mode.shift_time_1_ns,
    )


class _Texts:
    """Printable strings of an image, by number from 1; empty for an unknown number."""

    def __init__(self, sii: Sii) -> None:
        self._strings = ["", *(printable(text) for text in sii.strings)]

    def __getitem__(self, number: int) -> str:
        return self._strings[number] if number < len(self._strings) else ""
