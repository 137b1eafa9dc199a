"""SERCOS part of one virtual drive: its IDNs, commands, telegrams and states together.

It is also the mailbox protocol SoE of the device.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from catenary.virtual import _segment
from catenary.virtual.protocols import Surroundings
from catenary.virtual.soe.commands import Commands
from catenary.virtual.soe.dictionary import (
    MotorFacts,
    command_parameters,
    cyclic_parameters,
    stored_parameters,
)
from catenary.virtual.soe.drive_states import DriveStates
from catenary.virtual.soe.parameter import (
    HEX,
    INVALID,
    TOO_LARGE,
    WHILE_CYCLIC,
    Parameter,
    Refusal,
    idn,
    idn_list,
    packed,
)
from catenary.virtual.soe.quirks import SoeQuirks
from catenary.virtual.soe.server import EMERGENCY, SoeServer
from catenary.virtual.soe.telegrams import CONFIGURABLE, ENTRIES_MAX, STANDARD, Telegrams

CONTROL_SLOT, STATUS_SLOT = _segment.SLOTS_PER_AXIS, _segment.SLOTS_PER_AXIS + 1
SLOTS = _segment.SLOTS_PER_AXIS + 2
STEP_NS = 1_000_000  # internal cycle of the state machine
OP = 8
CYCLIC = 0x700A
DIAGNOSTICS = {True: "F2000 error: {0:04X}", False: "A0013 ready for operation"}


class SercosAxis:
    """SERCOS part of a drive. Implements `virtual.protocols.MailboxProtocol`."""

    number = 5  # SoE

    def __init__(
        self,
        motor: MotorFacts,
        quirks: SoeQuirks,
        *,
        get: Callable[[int], int],
        put: Callable[[int, int], None],
        motor_state: Callable[[], int],
    ) -> None:
        """Initialise the drive.

        Args:
            motor: MotorFacts of the drive.
            quirks: Differences from the standard.
            get: Function that returns the value of a slot.
            put: Function that sets a slot.
            motor_state: Function that returns the CiA 402 state of the motor.
        """
        self._get, self._put = get, put
        self._quirks = quirks
        self._surroundings: Surroundings | None = None
        self._commands: Commands | None = None
        self.parameters: dict[int, Parameter] = {}
        self.telegrams = Telegrams(self.parameters, self._phase_3_is_valid)
        self.states = DriveStates(
            get,
            put,
            motor_state=motor_state,
            operation_mode=lambda which: self._word(32 + which),
            command_changed=lambda: self._commands is not None and self._commands.changed,
        )
        self._invalid: list[int] = []
        self._emergency = 0
        self._add_parameters(motor)

    def start(self, surroundings: Surroundings) -> SoeServer:
        """Make the server, and start the internal cycle."""
        self._surroundings = surroundings
        self._commands = Commands(
            {
                99: self._reset_class_1,
                127: self._phase_3_is_valid,
                128: lambda: True,
                264: lambda: True,
            },
            surroundings.mailbox,
            surroundings.scheduler,
            self._quirks,
        )
        self._step()
        return SoeServer(self.parameters, surroundings, self._quirks, self._commands.write)

    def send_emergency(self, code: int) -> None:
        """Report an error of class 1; 0: its end."""
        self._emergency = code
        if self._surroundings is not None and self._al_state() >= 2:
            head = struct.pack("<BBH", EMERGENCY, 0, 0)
            self._surroundings.mailbox.send(self.number, head + struct.pack("<HB5x", code, 1))

    def _al_state(self) -> int:
        return 0 if self._surroundings is None else self._surroundings.state()

    def _step(self) -> None:
        """Run one internal cycle, and schedule the next one."""
        control = self._get(CONTROL_SLOT) & 0xFFFF
        status = self.states.step(control, in_operation=self._al_state() == OP)
        self._put(STATUS_SLOT, status)
        if self._surroundings is not None:
            self._surroundings.scheduler.after(STEP_NS, self._step)

    def _word(self, number: int) -> int:
        return int.from_bytes(self.parameters[number].content, "little")

    # -- IDNs ----------------------------------------------------------------------------------

    def _add_parameters(self, motor: MotorFacts) -> None:
        for each in (
            *cyclic_parameters(self._slot_reader, self._put),
            *stored_parameters(motor),
            *command_parameters(),
            *self._words(),
            *self._lists(),
        ):
            self.parameters[each.number] = each
        for number in (36, 37, 47, 80, 81):
            self._protect(self.parameters[number])
        self.parameters[2].written = self._set_cycle_time

    def _slot_reader(self, place: int) -> Callable[[], bytes]:
        size, slot = place >> 8, place & 0xFF
        mask = (1 << 8 * size) - 1
        return lambda: (self._get(slot) & mask).to_bytes(size, "little")

    def _words(self) -> list[Parameter]:
        control = self._slot_reader(2 << 8 | CONTROL_SLOT)
        status = self._slot_reader(2 << 8 | STATUS_SLOT)
        return [
            Parameter(11, "Class 1 diagnostic (C1D)", 2, HEX, read=self._class_1),
            Parameter(134, "Master control word", 2, HEX, read=control, slot=CONTROL_SLOT),
            Parameter(135, "Drive status word", 2, HEX, read=status, slot=STATUS_SLOT),
            Parameter(390, "Diagnostic message number", 4, HEX, read=self._diagnostic_number),
            Parameter(
                15,
                "Telegram type parameter",
                2,
                HEX,
                minimum=0,
                maximum=CONFIGURABLE,
                default=CONFIGURABLE,
                protection=WHILE_CYCLIC,
                read=lambda: struct.pack("<H", self.telegrams.kind),
                written=self._set_telegram_type,
            ),
            Parameter(
                95,
                "Diagnostic message",
                1,
                4,
                is_list=True,
                read=lambda: self._diagnostic().encode("latin-1"),
            ),
        ]

    def _lists(self) -> list[Parameter]:
        return [
            idn_list(17, "IDN-list of all operation data", read=self._all),
            self._telegram_list(16, "Configuration list of AT", outputs=False),
            self._telegram_list(24, "Configuration list of MDT", outputs=True),
            idn_list(21, "IDN-list of invalid operation data for CP2", read=self._invalid_idns),
            idn_list(22, "IDN-list of invalid operation data for CP3", read=lambda: b""),
            idn_list(25, "IDN-list of all procedure commands", read=self._all_commands),
            idn_list(187, "IDN-list of configurable data in the AT", read=self._all_in_at),
            idn_list(188, "IDN-list of configurable data in the MDT", read=self._all_in_mdt),
        ]

    def _telegram_list(self, number: int, name: str, *, outputs: bool) -> Parameter:
        return idn_list(
            number,
            name,
            read=lambda: self.telegrams.content(outputs),
            limit=2 * ENTRIES_MAX,
            written=lambda data: self._set_telegram(outputs, data),
        )

    def _all(self) -> bytes:
        return packed(sorted(self.parameters))

    def _all_commands(self) -> bytes:
        return packed([each.number for each in self.parameters.values() if each.is_command])

    def _invalid_idns(self) -> bytes:
        return packed(self._invalid)

    def _all_in_at(self) -> bytes:
        return packed(sorted(each.number for each in self.parameters.values() if each.in_at))

    def _all_in_mdt(self) -> bytes:
        return packed(sorted(each.number for each in self.parameters.values() if each.in_mdt))

    def _set_telegram_type(self, data: bytes) -> None:
        kind = int.from_bytes(data, "little")
        if kind not in STANDARD and kind != CONFIGURABLE:
            raise Refusal(TOO_LARGE)
        self.telegrams.kind = kind

    def _set_telegram(self, outputs: bool, data: bytes) -> None:
        numbers = struct.unpack(f"<{len(data) // 2}H", data)
        for number in numbers:
            found = self.parameters.get(number)
            if found is None or not (found.in_mdt if outputs else found.in_at):
                raise Refusal(INVALID)
        if len(set(numbers)) != len(numbers):
            raise Refusal(INVALID)
        self.telegrams.lists[outputs] = numbers

    def _set_cycle_time(self, data: bytes) -> None:
        self._put(_segment.SLOT_INTERPOLATION_PERIOD, int.from_bytes(data, "little"))
        self._put(_segment.SLOT_INTERPOLATION_EXPONENT, -6)

    def _protect(self, parameter: Parameter) -> None:
        """Refuse to write a command value while the telegram contains it."""
        write = parameter.written

        def checked(data: bytes) -> None:
            if self._al_state() > 2 and parameter.number in self.telegrams.idns(True):
                raise Refusal(CYCLIC)
            if write is not None:
                write(data)

        parameter.written = checked

    # -- diagnosis and commands ----------------------------------------------------------------

    def _class_1(self) -> bytes:
        return struct.pack("<H", 0x8000 if self.states.in_fault else 0)  # bit 15: of the vendor

    def _diagnostic_number(self) -> bytes:
        return struct.pack("<I", 0xF2000 if self.states.in_fault else 0xA0013)

    def _diagnostic(self) -> str:
        return DIAGNOSTICS[self.states.in_fault].format(self._emergency)

    def _reset_class_1(self) -> bool:
        self.states.reset_fault()
        return True

    def _phase_3_is_valid(self) -> bool:
        """Check the parameters for SAFE-OP. S-0-0021 then contains the invalid ones."""
        self._invalid = [idn(each) for each in self._quirks.invalid_for_phase_3]
        return not self._invalid
