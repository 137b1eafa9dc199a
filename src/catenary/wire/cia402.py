"""CiA 402 drives: states, controlword, statusword and modes, IEC 61800-7-201 / CiA 402-2.

The object indices are those of axis 0. For axis k, add k * SLOT_OFFSET.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag


class AxisState(IntEnum):
    """States of the drive's state machine, in the order of the standard."""

    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7


STATE_CODING = {
    # state: (mask, value) of the statusword, CiA 402-2 table 30
    AxisState.NOT_READY_TO_SWITCH_ON: (0x004F, 0x0000),
    AxisState.SWITCH_ON_DISABLED: (0x004F, 0x0040),
    AxisState.READY_TO_SWITCH_ON: (0x006F, 0x0021),
    AxisState.SWITCHED_ON: (0x006F, 0x0023),
    AxisState.OPERATION_ENABLED: (0x006F, 0x0027),
    AxisState.QUICK_STOP_ACTIVE: (0x006F, 0x0007),
    AxisState.FAULT_REACTION_ACTIVE: (0x004F, 0x000F),
    AxisState.FAULT: (0x004F, 0x0008),
}


IN_FAULT = (AxisState.FAULT_REACTION_ACTIVE, AxisState.FAULT)
POWERED = (  # states in which a drive moves or brakes its axis
    AxisState.OPERATION_ENABLED,
    AxisState.QUICK_STOP_ACTIVE,
    AxisState.FAULT_REACTION_ACTIVE,
)


def state_of(statusword: int) -> AxisState | None:
    """Return the state that a statusword encodes; None if it encodes no valid state."""
    for state, (mask, value) in STATE_CODING.items():
        if statusword & mask == value:
            return state
    return None


class Status(IntFlag):
    """Bits of the statusword 0x6041."""

    READY_TO_SWITCH_ON = 1 << 0
    SWITCHED_ON = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    VOLTAGE_ENABLED = 1 << 4
    QUICK_STOP = 1 << 5  # 0 while a quick stop is active
    SWITCH_ON_DISABLED = 1 << 6
    WARNING = 1 << 7
    MANUFACTURER_8 = 1 << 8
    REMOTE = 1 << 9  # the drive follows the controlword
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT_ACTIVE = 1 << 11
    # CSP, CSV, CST: drive follows the set-points; HM: homing attained; PP: set-point acknowledged
    MODE_12 = 1 << 12
    MODE_13 = 1 << 13  # CSP: following error; HM: homing error
    MANUFACTURER_14 = 1 << 14
    MANUFACTURER_15 = 1 << 15


FOLLOWS_COMMAND = Status.MODE_12
FOLLOWING_ERROR = Status.MODE_13


class Control(IntFlag):
    """Bits of the controlword 0x6040."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2  # 0 requests a quick stop
    ENABLE_OPERATION = 1 << 3
    MODE_4 = 1 << 4  # PP: new set-point; HM: start homing
    MODE_5 = 1 << 5  # PP: change set immediately
    MODE_6 = 1 << 6
    FAULT_RESET = 1 << 7  # a rising edge resets the fault
    HALT = 1 << 8
    MODE_9 = 1 << 9
    RESERVED_10 = 1 << 10
    MANUFACTURER_11 = 1 << 11
    MANUFACTURER_12 = 1 << 12
    MANUFACTURER_13 = 1 << 13
    MANUFACTURER_14 = 1 << 14
    MANUFACTURER_15 = 1 << 15


QUICK_STOP_COMMAND = (0x0086, 0x0002)  # (mask, value) of the controlword, IEC 61800-7-201 table 28
MODE_CONTROL_BITS = 0xFA70  # bits 4, 5, 6, 9, 11 to 15: not for the state machine or halt


@dataclass(frozen=True, slots=True)
class Controlword:
    """A device control command: mask and value in the controlword, CiA 402-2 table 28."""

    name: str
    mask: int
    value: int

    def matches(self, controlword: int) -> bool:
        """Return True if a controlword contains this command."""
        return controlword & self.mask == self.value

    def apply(self, controlword: int) -> int:
        """Return the controlword with this command; the other bits are unchanged."""
        return controlword & ~self.mask & 0xFFFF | self.value


SHUTDOWN = Controlword("shutdown", 0x0087, 0x0006)
SWITCH_ON = Controlword("switch on", 0x008F, 0x0007)
ENABLE_OPERATION = Controlword("enable operation", 0x008F, 0x000F)
DISABLE_OPERATION = Controlword("disable operation", 0x008F, 0x0007)  # the same bits as switch on
DISABLE_VOLTAGE = Controlword("disable voltage", 0x0082, 0x0000)
QUICK_STOP = Controlword("quick stop", 0x0086, 0x0002)
FAULT_RESET = Controlword("fault reset", 0x0080, 0x0080)  # a rising edge of bit 7

COMMANDS = (
    *(SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, DISABLE_OPERATION),
    *(DISABLE_VOLTAGE, QUICK_STOP, FAULT_RESET),
)


@dataclass(frozen=True, slots=True)
class Transition:
    """One transition of the state machine. It is automatic if it has no commands."""

    number: int
    source: AxisState | None  # None: power-up (number 0) or any state (number 13)
    target: AxisState
    commands: tuple[Controlword, ...] = ()


TRANSITIONS = (
    Transition(0, None, AxisState.NOT_READY_TO_SWITCH_ON),
    Transition(1, AxisState.NOT_READY_TO_SWITCH_ON, AxisState.SWITCH_ON_DISABLED),
    Transition(2, AxisState.SWITCH_ON_DISABLED, AxisState.READY_TO_SWITCH_ON, (SHUTDOWN,)),
    Transition(3, AxisState.READY_TO_SWITCH_ON, AxisState.SWITCHED_ON, (SWITCH_ON,)),
    Transition(4, AxisState.SWITCHED_ON, AxisState.OPERATION_ENABLED, (ENABLE_OPERATION,)),
    Transition(5, AxisState.OPERATION_ENABLED, AxisState.SWITCHED_ON, (DISABLE_OPERATION,)),
    Transition(6, AxisState.SWITCHED_ON, AxisState.READY_TO_SWITCH_ON, (SHUTDOWN,)),
    Transition(
        7, AxisState.READY_TO_SWITCH_ON, AxisState.SWITCH_ON_DISABLED, (DISABLE_VOLTAGE, QUICK_STOP)
    ),
    Transition(8, AxisState.OPERATION_ENABLED, AxisState.READY_TO_SWITCH_ON, (SHUTDOWN,)),
    Transition(9, AxisState.OPERATION_ENABLED, AxisState.SWITCH_ON_DISABLED, (DISABLE_VOLTAGE,)),
    Transition(
        10, AxisState.SWITCHED_ON, AxisState.SWITCH_ON_DISABLED, (DISABLE_VOLTAGE, QUICK_STOP)
    ),
    Transition(11, AxisState.OPERATION_ENABLED, AxisState.QUICK_STOP_ACTIVE, (QUICK_STOP,)),
    # Transition 12 is also automatic when the drive has stopped and 0x605A is 1 to 4.
    Transition(12, AxisState.QUICK_STOP_ACTIVE, AxisState.SWITCH_ON_DISABLED, (DISABLE_VOLTAGE,)),
    Transition(13, None, AxisState.FAULT_REACTION_ACTIVE),
    Transition(14, AxisState.FAULT_REACTION_ACTIVE, AxisState.FAULT),
    Transition(15, AxisState.FAULT, AxisState.SWITCH_ON_DISABLED, (FAULT_RESET,)),
    # Transition 16 is possible only if 0x605A is 5 to 8.
    Transition(16, AxisState.QUICK_STOP_ACTIVE, AxisState.OPERATION_ENABLED, (ENABLE_OPERATION,)),
)


class Mode(IntEnum):
    """Modes of operation, objects 0x6060 and 0x6061."""

    NONE = 0
    PP = 1  # profile position
    VL = 2  # velocity (frequency converter)
    PV = 3  # profile velocity
    TQ = 4  # profile torque
    HM = 6  # homing
    IP = 7  # interpolated position
    CSP = 8  # cyclic synchronous position
    CSV = 9  # cyclic synchronous velocity
    CST = 10  # cyclic synchronous torque
    CSTCA = 11  # cyclic synchronous torque with commutation angle

    @property
    def supported_bit(self) -> int:
        """Bit mask of the mode in the supported drive modes, object 0x6502; 0 for NONE."""
        return 1 << self - 1 if self else 0


class Object(IntEnum):
    """Objects of the profile, axis 0."""

    ABORT_CONNECTION_OPTION = 0x6007
    ERROR_CODE = 0x603F
    CONTROLWORD = 0x6040
    STATUSWORD = 0x6041
    QUICK_STOP_OPTION = 0x605A
    DISABLE_OPERATION_OPTION = 0x605C
    FAULT_REACTION_OPTION = 0x605E
    MODE_OF_OPERATION = 0x6060
    MODE_OF_OPERATION_DISPLAY = 0x6061
    POSITION_DEMAND = 0x6062
    POSITION_ACTUAL = 0x6064
    FOLLOWING_ERROR_WINDOW = 0x6065
    VELOCITY_ACTUAL = 0x606C
    TARGET_TORQUE = 0x6071
    MAX_TORQUE = 0x6072  # in thousandths of the rated torque
    TORQUE_DEMAND = 0x6074
    MOTOR_RATED_TORQUE = 0x6076  # [mN·m]; torques are in thousandths of this value
    TORQUE_ACTUAL = 0x6077
    TARGET_POSITION = 0x607A
    HOME_OFFSET = 0x607C
    SOFTWARE_POSITION_LIMIT = 0x607D
    MAX_PROFILE_VELOCITY = 0x607F
    MAX_MOTOR_SPEED = 0x6080  # [rpm]
    PROFILE_VELOCITY = 0x6081
    PROFILE_ACCELERATION = 0x6083
    PROFILE_DECELERATION = 0x6084
    QUICK_STOP_DECELERATION = 0x6085
    POSITION_ENCODER_RESOLUTION = 0x608F
    GEAR_RATIO = 0x6091
    HOMING_METHOD = 0x6098
    HOMING_SPEEDS = 0x6099
    HOMING_ACCELERATION = 0x609A
    POSITION_OFFSET = 0x60B0
    VELOCITY_OFFSET = 0x60B1
    TORQUE_OFFSET = 0x60B2
    INTERPOLATION_TIME_PERIOD = 0x60C2
    FOLLOWING_ERROR_ACTUAL = 0x60F4
    DIGITAL_INPUTS = 0x60FD
    DIGITAL_OUTPUTS = 0x60FE
    TARGET_VELOCITY = 0x60FF
    SUPPORTED_DRIVE_MODES = 0x6502


SLOT_OFFSET = 0x800  # index distance between the same object of two adjacent axes
PROFILE = 402  # low word of the device type, object 0x1000
