"""States of a virtual SERCOS drive: control word S-0-0134, status word S-0-0135.

The motor and its control loops are those of the CiA 402 servo (`servo.h`). This bridge translates
the words in the internal cycle of the drive. As AX5000 (Beckhoff, "AX5000 IDN description",
S-0-0134, S-0-0135 and S-0-0273):

- The power section is on while the drive has mains power. Bit 15 is not necessary for it.
- Bits 15, 14 and 13 together enable the motor. Without bit 13 it halts and keeps its torque.
- The end of bit 15 alone is "drive off": the drive brakes, and then removes the torque.
- The end of bit 14 removes the torque at once.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary.virtual import _segment

# S-0-0134
ON, ENABLE, RESTART = 1 << 15, 1 << 14, 1 << 13
RUN = ON | ENABLE | RESTART
MODE_SHIFT = 8  # bits 8 and 9 select the operation mode
# S-0-0135
POWERED, OPERATING, READY = 0b10 << 14, 0b11 << 14, 0b01 << 14
CLASS_1, CHANGE, FOLLOWS = 1 << 13, 1 << 5, 1 << 3
FAULT_REACTION, FAULT = 6, 7  # indices in `motor_device.STATES`
FAULT_STATES = (FAULT_REACTION, FAULT)
SWITCH_ON_DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION, QUICK_STOP = range(1, 6)
DISABLE_VOLTAGE, SHUTDOWN, SWITCH_ON = 0x00, 0x06, 0x07
ENABLE_OPERATION, HALT, RESET = 0x0F, 0x0B, 0x80
FOLLOWS_TARGET = 0x1000  # bit 12 of the motor's statusword
HOLD_AFTER_QUICK_STOP = 6  # 0x605A
STANDSTILL = 4775  # [0.0001 rpm] 0.05 rad/s
DRIVE_OFF_STEPS = 2000  # S-0-0273: longest time of braking [steps of 1 ms]
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
        self._braking = 0  # steps since drive off
        self.mains = True  # mains power is available

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
        word = control if in_operation else ENABLE  # drive off: it brakes
        self._put(_segment.SLOT_MODE, self._mode(word))
        self._put(_segment.SLOT_QUICK_STOP_OPTION, HOLD_AFTER_QUICK_STOP)
        self._put(_segment.SLOT_CONTROLWORD, self._controlword(word, state))
        return self._status(word, state)

    def _mode(self, control: int) -> int:
        return MODES.get(self._operation_mode(control >> MODE_SHIFT & 3) & 7, 0)

    def _controlword(self, control: int, state: int) -> int:
        if state == FAULT:
            resets, self._resets = self._resets, False
            return RESET if resets else DISABLE_VOLTAGE
        if not self.mains:
            return DISABLE_VOLTAGE
        if state in (OPERATION, QUICK_STOP):
            return self._operating(control)
        self._braking = 0
        if state < READY_TO_SWITCH_ON:
            return SHUTDOWN
        runs = state == SWITCHED_ON and control & RUN == RUN
        return ENABLE_OPERATION if runs else SWITCH_ON

    def _operating(self, control: int) -> int:
        """Return the controlword of a motor with torque."""
        if not control & ENABLE:
            return DISABLE_VOLTAGE
        if control & ON:
            self._braking = 0
            return ENABLE_OPERATION if control & RESTART else HALT
        self._braking += 1
        rests = self._braking > 1 and abs(self._get(_segment.SLOT_VELOCITY)) < STANDSTILL
        return DISABLE_VOLTAGE if rests or self._braking > DRIVE_OFF_STEPS else HALT

    def _status(self, control: int, state: int) -> int:
        change = CHANGE if self._command_changed() else 0
        word = (control >> MODE_SHIFT & 3) << MODE_SHIFT | change
        if state == FAULT_REACTION:
            return CLASS_1 | OPERATING | word
        if state == FAULT:
            return CLASS_1 | word
        if state in (OPERATION, QUICK_STOP):
            follows = control & ON and self._get(_segment.SLOT_STATUSWORD) & FOLLOWS_TARGET
            return OPERATING | word | (FOLLOWS if state == OPERATION and follows else 0)
        if state == SWITCHED_ON and self.mains:
            return POWERED | word
        return (READY if state >= SWITCH_ON_DISABLED else 0) | word
