"""States of a virtual SERCOS drive: control word S-0-0134, status word S-0-0135.

The motor and its control loops are those of the CiA 402 servo (`servo.h`). This bridge translates
the words in the internal cycle of the drive.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary.virtual import _segment

# S-0-0134
ON, ENABLE, RESTART = 1 << 15, 1 << 14, 1 << 13
MODE_SHIFT = 8  # bits 8 and 9 select the operation mode
# S-0-0135
POWERED, OPERATING, READY = 0b10 << 14, 0b11 << 14, 0b01 << 14
CLASS_1, CHANGE, FOLLOWS = 1 << 13, 1 << 5, 1 << 3
FAULT_STATES = (6, 7)  # indices in `motor_device.STATES`
SWITCH_ON_DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION, QUICK_STOP = range(1, 6)
SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, HALT, RESET = 0x06, 0x07, 0x0F, 0x0B, 0x80
DISABLE_VOLTAGE = 0
STANDSTILL = 10_000  # [0.0001 rpm]
HOLD_AFTER_QUICK_STOP = 6  # 0x605A
MODES = {1: 10, 2: 9, 3: 8, 4: 8}  # lower bits of S-0-0032 → CST, CSV, CSP


class DriveStates:
    """Bridge between the words of one drive and its motor."""

    def __init__(
        self,
        get: Callable[[int], int],
        put: Callable[[int, int], None],
        *,
        motor_state: Callable[[], int],
        operation_mode: Callable[[int], int],
        command_changed: Callable[[], bool],
    ) -> None:
        """Initialise the bridge.

        Args:
            get: Function that returns the value of a slot.
            put: Function that sets a slot.
            motor_state: Function that returns the CiA 402 state of the motor.
            operation_mode: Function that returns S-0-0032 to S-0-0035, by 0 to 3.
            command_changed: Function that returns True if a procedure command has ended.
        """
        self._get, self._put = get, put
        self._motor_state = motor_state
        self._operation_mode = operation_mode
        self._command_changed = command_changed
        self._resets = False

    def reset_fault(self) -> None:
        """Reset the fault in the next cycle (S-0-0099)."""
        self._resets = True

    @property
    def in_fault(self) -> bool:
        """True if the drive has an error of class 1."""
        return self._motor_state() in FAULT_STATES

    def step(self, control: int, *, in_operation: bool) -> int:
        """Translate the control word, and return the status word.

        Args:
            control: S-0-0134.
            in_operation: True in OP; otherwise the drive brakes, as without bit 15.
        """
        state = self._motor_state()
        word = control if in_operation else control & ~ON
        self._put(_segment.SLOT_MODE, self._mode(word))
        self._put(_segment.SLOT_QUICK_STOP_OPTION, HOLD_AFTER_QUICK_STOP)
        self._put(_segment.SLOT_CONTROLWORD, self._controlword(word, state))
        return self._status(word, state)

    def _mode(self, control: int) -> int:
        return MODES.get(self._operation_mode(control >> MODE_SHIFT & 3) & 7, 0)

    def _controlword(self, control: int, state: int) -> int:
        if state in FAULT_STATES:
            resets, self._resets = self._resets, False
            return RESET if resets else 0
        if state in (OPERATION, QUICK_STOP):
            if not control & ENABLE:
                return DISABLE_VOLTAGE  # the torque is removed at once
            if not control & ON:  # the drive brakes, then removes the torque
                moves = abs(self._get(_segment.SLOT_VELOCITY)) > STANDSTILL
                return HALT if moves else DISABLE_VOLTAGE
        if not control & ON or state < READY_TO_SWITCH_ON:
            return SHUTDOWN
        if not control & ENABLE or state == READY_TO_SWITCH_ON:
            return SWITCH_ON
        if not control & RESTART and state in (OPERATION, QUICK_STOP):
            return HALT
        return ENABLE_OPERATION

    def _status(self, control: int, state: int) -> int:
        change = CHANGE if self._command_changed() else 0
        mode = (control >> MODE_SHIFT & 3) << MODE_SHIFT
        if state in FAULT_STATES:
            return CLASS_1 | mode | change
        if state in (OPERATION, QUICK_STOP):
            follows = FOLLOWS if state == OPERATION and control & ON else 0
            return OPERATING | mode | change | follows
        if state == SWITCHED_ON:
            return POWERED | mode | change
        return (READY if state >= SWITCH_ON_DISABLED else 0) | mode | change
