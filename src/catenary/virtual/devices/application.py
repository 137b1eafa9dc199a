"""Application of a device (its microcontroller): state machine, mailbox, CoE and process data.

It runs in the service of the segment, not in the frame path.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence

from catenary.virtual import _segment
from catenary.virtual._buffers import Buffers
from catenary.virtual._segment import Core
from catenary.virtual.coe.diagnosis_history import (
    ERROR,
    FAULT,
    REFUSED,
    SYNC_LOST,
    TIMED_OUT,
    DiagnosisHistory,
    Number,
    error_code_of,
    word,
)
from catenary.virtual.coe.dictionary import (
    ARRAY,
    MAP_RX,
    MAP_TX,
    OCTET_STRING,
    SIGNED,
    TOO_LONG,
    TOO_SHORT,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_ANY,
    Abort,
    Dictionary,
    Entry,
    constant,
    number,
    slot_value,
    stored,
    text,
)
from catenary.virtual.coe.information import SDO_INFORMATION, InformationServer
from catenary.virtual.coe.module_lists import ModuleLists
from catenary.virtual.coe.pdo_objects import RX_ASSIGNMENT, PdoObjects
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.coe.sdo_server import SDO_REQUEST, SdoServer
from catenary.virtual.description import (
    Channel,
    Description,
    MailboxDefault,
    Pdo,
    SyncManagerDefault,
)
from catenary.virtual.devices.synchronisation import Synchronisation
from catenary.virtual.foe.access import FileAccess
from catenary.virtual.foe.store import FileStore
from catenary.virtual.mailbox import (
    COE_PROTOCOL,
    ERROR_TOO_SHORT,
    ERROR_UNSUPPORTED_PROTOCOL,
    FOE_PROTOCOL,
    HEADER,
    Mailbox,
)
from catenary.virtual.protocols import MailboxProtocol, ProtocolServer, Surroundings
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.state_machine import (
    BOOT,
    FATAL_SYNC_ERROR,
    INIT,
    INVALID_BOOT_MAILBOX_CONFIGURATION,
    INVALID_INPUT_CONFIGURATION,
    INVALID_INPUT_MAPPING,
    INVALID_MAILBOX_CONFIGURATION,
    INVALID_OUTPUT_CONFIGURATION,
    INVALID_OUTPUT_MAPPING,
    INVALID_WATCHDOG_CONFIGURATION,
    MODULES_DIFFER,
    NO_SYNC_ERROR,
    NO_VALID_FIRMWARE,
    NO_VALID_OUTPUTS,
    OP,
    PRE_OP,
    SAFE_OP,
    SYNC_MANAGER_WATCHDOG,
    SYNCHRONISATION_ERROR,
    StateMachine,
)

EMERGENCY = 1
ENABLE_AND_MODE = 0x0F  # mask of direction and mode in the control byte of a SyncManager
WATCHDOG_TRIGGER = 0x40  # bit in the same byte
STATION_ADDRESS, AL_STATUS, WATCHDOG_DIVIDER, WATCHDOG_TIME = 0x0010, 0x0130, 0x0400, 0x0420
RAM_START, RAM_END = 0x1000, 0x3000
BLOB_BYTES = 2048  # an object larger than any usual mailbox


def mailbox_of(size: int, coe_details: int = 0x2F) -> MailboxDefault:
    """Return the description of two mailboxes of `size` bytes, one after the other.

    Args:
        size: Size of each mailbox [bytes].
        coe_details: CoE details of the SII.
    """
    return MailboxDefault(RAM_START, size, RAM_START + size, size, coe_details)


def process_data_areas(mailbox_size: int) -> tuple[int, int, int]:
    """Return the start addresses of SM2 and SM3, and the maximum size of their buffers [bytes].

    The two SyncManagers share the RAM after the mailboxes. Each has three buffers.
    """
    outputs = RAM_START + (2 * mailbox_size + 0xFF & ~0xFF)
    room = (RAM_END - outputs) // 6 & ~0x7F
    return outputs, outputs + 3 * room, room


def sync_managers_of(
    mailbox_size: int,
    outputs: Sequence[Pdo],
    inputs: Sequence[Pdo],
    *,
    watchdog_trigger: bool = True,
) -> tuple[SyncManagerDefault, ...]:
    """Return the defaults of SyncManagers 0 to 3.

    Args:
        mailbox_size: Size of each mailbox [bytes].
        outputs: RxPDOs of the device.
        inputs: TxPDOs of the device.
        watchdog_trigger: True if SyncManager 2 triggers the watchdog.
    """

    def size(pdos: Sequence[Pdo]) -> int:
        return (sum(pdo.bits for pdo in pdos if pdo.sync_manager != 0xFF) + 7) // 8

    out, into, _room = process_data_areas(mailbox_size)
    control = 0x64 if watchdog_trigger else 0x24
    return (
        SyncManagerDefault(RAM_START, mailbox_size, 0x26, 1, 1),
        SyncManagerDefault(RAM_START + mailbox_size, mailbox_size, 0x22, 1, 2),
        SyncManagerDefault(out, size(outputs), control, 1 if size(outputs) else 0, 3),
        SyncManagerDefault(into, size(inputs), 0x20, 1 if size(inputs) else 0, 4),
    )


def channels_of(mailbox_size: int) -> tuple[Channel, ...]:
    """Return the process data of our own kinds of devices: SyncManagers 2 and 3."""
    out, into, room = process_data_areas(mailbox_size)
    return Channel(2, True, out, room), Channel(3, False, into, room)


class Application:
    """Application of one device."""

    on_restart: Callable[[], None] | None = None  # called if a new firmware is to start

    def __init__(
        self,
        core: Core,
        position: int,
        scheduler: Scheduler,
        description: Description,
        *,
        delay_ns: int,
        quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
        store: FileStore | None = None,
        protocols: Sequence[MailboxProtocol] = (),
    ) -> None:
        self._core, self._position, self._description = core, position, description
        self._buffers = Buffers(core)
        self._box, self._bootstrap = description.mailbox, description.bootstrap
        self._emulation = description.emulation
        self.synchronisation: Synchronisation | None = None  # only for devices that support SYNC0
        self.checks_watchdog = False  # see ServoQuirks
        self.module_lists: ModuleLists | None = None  # only of modular devices
        boots, identification = self._bootstrap is not None, description.identification
        self.states = StateMachine(self, scheduler, identification, supports_boot=boots)
        self._files = FileAccess(store, self._box, self._bootstrap, self._state)
        self.history: DiagnosisHistory | None = None  # only of devices with 0x10F3
        self.dictionary = Dictionary(self._state)
        self._add_communication_objects(description, quirks.text_prefix)
        size = description.mailbox.receive_size if description.mailbox else 0
        facts = description.facts
        self._from_file = facts is not None
        self._channels = channels_of(size) if facts is None else facts.channels
        mapping = description.rx_pdos, description.tx_pdos, description.mapping_quirks
        self.pdos = PdoObjects(self.dictionary, self._channels, *mapping)
        self._add_servers(description, quirks)
        self.mailbox = Mailbox(self, scheduler, self._serve, delay_ns=delay_ns, quirks=quirks)
        self._servers = self._start_protocols(protocols, scheduler)
        self._gate(mailbox=self._emulation, process_data=self._emulation)

    def _add_servers(self, description: Description, quirks: MailboxQuirks) -> None:
        box, facts = description.mailbox, description.facts
        size = (box.send_size if box else HEADER.size) - HEADER.size
        self._sdo = SdoServer(
            self.dictionary,
            size=size,
            complete_access=facts is None or facts.complete_access,
            quirks=quirks,
        )
        self._information = InformationServer(
            self.dictionary,
            size=size,
            supported=facts is None or facts.sdo_information,
            quirks=quirks,
        )

    def _start_protocols(
        self, protocols: Sequence[MailboxProtocol], scheduler: Scheduler
    ) -> dict[int, ProtocolServer]:
        """Return the servers of the protocols beside CoE and FoE, by number."""
        if self._box is None:
            return {}
        surroundings = Surroundings(
            self.mailbox,
            scheduler,
            self._state,
            self._box.receive_size - HEADER.size,
            self._box.send_size - HEADER.size,
            self.dictionary,
            self._station_address,
        )
        return {each.number: each.start(surroundings) for each in protocols}

    def _station_address(self) -> int:
        return int.from_bytes(self._core.peek(self._position, STATION_ADDRESS, 2), "little")

    def _state(self) -> int:
        """Return the AL state. With emulation, only the controller knows it."""
        if self._emulation:
            return self._core.peek(self._position, AL_STATUS, 1)[0] & 0x0F
        return self.states.state

    def _add_communication_objects(self, d: Description, text_prefix: str) -> None:
        add = self.dictionary.add_variable
        own_type = 0x0002_0192 if d.axes else 0x0000_1389
        device_type = own_type if d.facts is None else d.facts.device_type
        add(0x1000, number("Device type", UNSIGNED32, device_type))
        add(0x1001, Entry("Error register", UNSIGNED8, 8, 0x07, self._error_register))
        add(0x1008, text("Manufacturer device name", text_prefix + d.name))
        add(0x1009, text("Manufacturer hardware version", "1"))
        self._add_version(d)
        record = self.dictionary.add_record
        kinds = [
            number(f"Subindex {n:03d}", UNSIGNED8, each.kind)
            for n, each in enumerate(d.sync_managers, start=1)
        ]
        record(0x1C00, "Sync manager type", kinds, code=ARRAY)
        if d.facts is None:
            self._add_test_objects()

    def _add_version(self, d: Description) -> None:
        """Add or replace the objects that depend on the firmware."""
        version, revision = self._files.version
        self.dictionary.add_variable(0x100A, text("Manufacturer software version", version))
        identity = zip(
            ("Vendor ID", "Product code", "Revision number", "Serial number"),
            (d.vendor, d.product_code, revision or d.revision, d.serial),
            strict=True,
        )
        entries = [number(name, UNSIGNED32, value) for name, value in identity]
        self.dictionary.add_record(0x1018, "Identity", entries)

    def _add_test_objects(self) -> None:
        """Add objects of our own kinds of devices that exercise long and writable transfers."""
        add = self.dictionary.add_variable
        blob = bytes(k * 7 & 0xFF for k in range(BLOB_BYTES))
        add(0x2100, constant("Large octet string", OCTET_STRING, blob))
        add(
            0x2101,
            stored("Writable octet string", OCTET_STRING, bytes(BLOB_BYTES), variable_length=True),
        )
        add(0x2102, stored("Scratch word", UNSIGNED16, bytes(2)))

    def _error_register(self) -> bytes:
        return b"\x01" if self._core.emergency(self._position) else b"\x00"

    # -- events --------------------------------------------------------------------------------

    def handle(self, events: int) -> None:
        if events & _segment.EVENT_WATCHDOG:
            self._outputs_timed_out()
        if events & _segment.EVENT_AL_CONTROL:
            self.states.follow_request()
        if events & _segment.EVENT_SYNC_MISSED:
            self._synchronisation_failed(SYNCHRONISATION_ERROR)
        if events & _segment.EVENT_SYNC_LOST:
            self._synchronisation_failed(FATAL_SYNC_ERROR)
        if events & (_segment.EVENT_OUTPUTS | _segment.EVENT_SYNC_SEEN):
            self.states.report_arrival()
        if events & _segment.EVENT_MAILBOX_READ:
            self.mailbox.answer_read()
        if events & _segment.EVENT_REPEAT_REQUEST:
            self.mailbox.repeat_requested()
        if events & _segment.EVENT_MAILBOX_WRITTEN:
            self.mailbox.request_written()
        if events & _segment.EVENT_EMERGENCY:
            self.send_emergency(self._core.emergency(self._position))

    def _outputs_timed_out(self) -> None:
        self._core.expect_outputs(self._position)
        if self.states.state == OP:
            self._note(SYNC_MANAGER_WATCHDOG, TIMED_OUT)
            self.states.fail(SAFE_OP, SYNC_MANAGER_WATCHDOG)

    def _synchronisation_failed(self, code: int) -> None:
        if self.states.state == OP:
            self._note(code, SYNC_LOST, word(code))
            self.states.fail(SAFE_OP, code)

    def _note(self, al_status_code: int, text_id: int, *parameters: Number) -> None:
        """Store an error in the diagnosis history. Its code is an emergency of the state machine.

        Args:
            al_status_code: Cause. The emergency error code is 0xA000 + this code.
            text_id: Text of the message.
            *parameters: Values for the text.
        """
        if self.history is not None:
            code = error_code_of(0xA000 + (al_status_code & 0xFF))
            self.history.add(ERROR, code, text_id, parameters)

    def send_emergency(self, code: int, data: bytes = b"") -> None:
        """Send an emergency message, ETG.1000.6 §5.6.4. A no-op in INIT and BOOT.

        Args:
            code: Error code; 0: the error was reset.
            data: Up to 5 manufacturer-specific bytes.
        """
        if self.history is not None and code:
            self.history.add(ERROR, error_code_of(code), FAULT, [word(code)])
        if self.states.state in (INIT, BOOT):
            return
        register = 1 if code else 0
        head = struct.pack("<HHB", EMERGENCY << 12, code, register)
        self.mailbox.send(COE_PROTOCOL, head + data[:5].ljust(5, b"\0"))

    def _serve(self, protocol: int, payload: bytes) -> Iterable[bytes] | int:
        """Return the answers to a message, or the code of a mailbox error."""
        if protocol == FOE_PROTOCOL:
            return self._files.serve(payload)
        if self._state() == BOOT:  # only FoE, §6.4.1
            return ERROR_UNSUPPORTED_PROTOCOL
        if protocol == COE_PROTOCOL:
            return ERROR_TOO_SHORT if len(payload) < 3 else self._serve_coe(payload)
        server = self._servers.get(protocol)
        return ERROR_UNSUPPORTED_PROTOCOL if server is None else server.serve(payload)

    def _serve_coe(self, payload: bytes) -> Iterable[bytes]:
        [header] = struct.unpack_from("<H", payload)
        if header >> 12 == SDO_REQUEST:
            return self._sdo.serve(payload[2:])
        if header >> 12 == SDO_INFORMATION:
            return self._information.serve(payload[2:])
        return []

    # -- for the mailbox -----------------------------------------------------------------------

    def fetch_request(self) -> bytes | None:
        return self._buffers.read(self._position, 0)

    def put_answer(self, data: bytes) -> bool:
        return self._buffers.write(self._position, 1, data)

    def take_back_answer(self) -> bytes | None:
        return self._buffers.take_back(self._position, 1)

    def acknowledge_repeat(self) -> None:
        self._buffers.acknowledge_repeat(self._position, 1)

    # -- for the state machine -----------------------------------------------------------------

    def fetch_al_control(self) -> int:
        return self._core.fetch_al_control(self._position)

    def show_al_status(self, status: int, code: int) -> None:
        self._core.show_al_status(self._position, status, code)

    def check_state(self, state: int) -> int:
        """Return 0, or the AL status code with which the state is refused."""
        refusal = self._refusal_of(state)
        if refusal:
            self._note(refusal, REFUSED, word(state), word(refusal))
        return refusal

    def _refusal_of(self, state: int) -> int:
        before = self.states.state
        if state == BOOT:
            configured = before == BOOT or self._mailbox_is_configured(self._bootstrap)
            return 0 if configured else INVALID_BOOT_MAILBOX_CONFIGURATION
        if state >= PRE_OP and before == INIT and self._files.lacks_firmware:
            return NO_VALID_FIRMWARE
        if state >= PRE_OP and before == INIT and not self._mailbox_is_configured(self._box):
            return INVALID_MAILBOX_CONFIGURATION
        if state >= SAFE_OP and before == PRE_OP:
            if self.module_lists is not None and self.module_lists.differ:
                return MODULES_DIFFER
            for channel in self._channels:
                if refusal := self._check_channel(channel):
                    return refusal
            refusal = 0 if self.synchronisation is None else self.synchronisation.check()
            if refusal == 0 and self.checks_watchdog and not self._watchdog_is_consistent():
                return INVALID_WATCHDOG_CONFIGURATION
            return refusal
        return 0

    def _check_channel(self, channel: Channel) -> int:
        """Return 0, or the AL status code of a fault in the mapping or the SyncManager."""
        if self.pdos.contradicts(channel.assignment):
            return INVALID_OUTPUT_MAPPING if channel.outputs else INVALID_INPUT_MAPPING
        if self._buffer_is_configured(channel):
            return 0
        return INVALID_OUTPUT_CONFIGURATION if channel.outputs else INVALID_INPUT_CONFIGURATION

    def _watchdog_is_consistent(self) -> bool:
        """Return True if the trigger bit of SyncManager 2 matches the activation of the watchdog.

        Beckhoff's slave stack code has the same check (ecatslv.c, StartInputHandler).
        """
        [divider] = struct.unpack("<H", self._core.peek(self._position, WATCHDOG_DIVIDER, 2))
        [time] = struct.unpack("<H", self._core.peek(self._position, WATCHDOG_TIME, 2))
        on = bool(divider and time and self.pdos.size(RX_ASSIGNMENT))
        _start, _length, control, _enabled, _full = self._buffers.settings(self._position, 2)
        return on is bool(control & WATCHDOG_TRIGGER)

    def _mailbox_is_configured(self, box: MailboxDefault | None) -> bool:
        if box is None:
            return True
        expected = (
            (box.receive_offset, box.receive_size, 0x06),
            (box.send_offset, box.send_size, 0x02),
        )
        for n, (offset, size, control) in enumerate(expected):
            start, length, found, enabled, _full = self._buffers.settings(self._position, n)
            if (start, length, found & ENABLE_AND_MODE, enabled) != (offset, size, control, True):
                return False
        return True

    def _buffer_is_configured(self, channel: Channel) -> bool:
        size = self.pdos.size(channel.assignment)
        too_many = len(self.pdos.placed(channel.assignment)) > _segment.MAPPED_MAX
        if too_many and not self._from_file:
            return False
        start, length, found, enabled, _full = self._buffers.settings(
            self._position, channel.sync_manager
        )
        if size == 0:
            return not enabled or length in (0, channel.idle_length)
        expected = (channel.start, size, channel.control, True)
        return (start, length, found & ENABLE_AND_MODE, enabled) == expected

    def lacks_for_op(self) -> int:
        if self._has_outputs() and not self._core.outputs_seen(self._position):
            return NO_VALID_OUTPUTS
        if self.synchronisation is not None and self.synchronisation.awaits_pulses():
            return NO_SYNC_ERROR
        return 0

    def enter_state(self, before: int, state: int) -> None:
        if before == INIT and state in (PRE_OP, BOOT):
            self.mailbox.reset()
            self._files.reset()
            for server in self._servers.values():
                server.reset()
        if before == BOOT and state == INIT:
            self._leave_boot()
        if before < SAFE_OP <= state:
            self.map_process_data()
            if self.synchronisation is not None:
                self.synchronisation.begin()
        if state < SAFE_OP <= before and self.synchronisation is not None:
            self.synchronisation.end()
        if before != state:
            self._gate(mailbox=state >= PRE_OP, process_data=state >= SAFE_OP)
        if before != state == SAFE_OP:
            self._core.expect_outputs(self._position)
            self._core.refresh_inputs(self._position)
        self._core.enable_outputs(self._position, state == OP and self._takes_outputs())

    def _leave_boot(self) -> None:
        """End a transfer, and start another firmware, if there is one."""
        self._files.reset()
        if not self._files.restart_is_due:
            return
        if self.on_restart is not None:
            self.on_restart()
            return
        self._files.restart()
        self._add_version(self._description)

    def _takes_outputs(self) -> bool:
        """Return False for a device from a file without outputs: a pulse then misses none."""
        return not self._from_file or self._has_outputs()

    def _has_outputs(self) -> bool:
        return any(each.outputs and self.pdos.size(each.assignment) for each in self._channels)

    def _gate(self, *, mailbox: bool, process_data: bool) -> None:
        gates = {} if self._box is None else {0: mailbox, 1: mailbox}
        gates |= {channel.sync_manager: process_data for channel in self._channels}
        for n, opened in gates.items():
            self._buffers.block(self._position, n, not opened)

    def map_process_data(self) -> None:
        """Map the first SyncManager of each direction to slots; the model has no more."""
        mapped: set[bool] = set()
        for channel in self._channels:
            if channel.outputs in mapped:
                continue
            entries: list[tuple[int, int, int, bool]] = []
            for placed in self.pdos.placed(channel.assignment):
                entry = self.dictionary.known_entry(placed.index, placed.subindex)
                if entry is None:  # a clone may have PDOs with objects that it does not list
                    continue
                if entry.slot >= 0 and entry.mappable & (MAP_RX if channel.outputs else MAP_TX):
                    entries.append((placed.bit, placed.bits, entry.slot, entry.signed))
            n = channel.sync_manager if entries else -1
            entries = entries[: _segment.MAPPED_MAX]  # only devices from files have more
            self._core.map_process_data(self._position, channel.outputs, n, entries)
            if entries:
                mapped.add(channel.outputs)

    def put_slot(self, slot: int, value: int) -> None:
        """Set a slot of the model."""
        self._core.put_slot(self._position, slot, value)

    def slot_entry(
        self,
        name: str,
        data_type: int,
        bits: int,
        slot: int,
        access: int,
        *,
        signed: bool | None = None,
    ) -> Entry:
        """Return a dictionary entry whose value is a slot of the model.

        Args:
            name: Name of the entry.
            data_type: CANopen data type.
            bits: Size of the value [bits].
            slot: Number of the slot.
            access: Access flags.
            signed: True if the model needs a sign; None: as the data type requires.
        """
        signed = data_type in SIGNED if signed is None else signed
        size = (bits + 7) // 8

        def read() -> bytes:
            value = self._core.slot(self._position, slot) & ((1 << bits) - 1)
            return value.to_bytes(size, "little")

        def write(data: bytes) -> None:
            if len(data) != size:
                raise Abort(TOO_LONG if len(data) > size else TOO_SHORT)
            self._core.put_slot(self._position, slot, slot_value(data, bits, signed))

        writable = access & WRITE_ANY
        return Entry(name, data_type, bits, access, read, write if writable else None, slot, signed)
