"""Register map of an EtherCAT SubDevice Controller (ESC).

The sources are ETG.1000.4 §6 and Beckhoff's ESC data sheet, section II (register descriptions).
Indexed registers are functions, such as `fmmu(k)` or `receive_time(port)`. They raise ValueError if
the index is out of range.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from typing import Generic, TypeVar, cast

from catenary.errors import DecodeError

T = TypeVar("T", int, bytes)

PORT_COUNT = 4
FMMU_COUNT = 16
SYNC_MANAGER_COUNT = 16
PROCESS_RAM = 0x1000  # start of the memory for mailboxes and process data


# No slots: `Register[int](...)` of a frozen class with slots fails in Python 3.11 (cpython#105332).
@dataclass(frozen=True)
class Register(Generic[T]):
    """One register: its address, its name, and the `struct` format of its value.

    A block of several values is a `Register[bytes]`. Other modules convert its fields.
    """

    address: int
    format: str
    name: str

    @property
    def size(self) -> int:
        """Length in bytes."""
        return struct.calcsize(self.format)

    def pack(self, value: T) -> bytes:
        """Return the encoded value. Raises ValueError if it does not fit."""
        if isinstance(value, bytes) and len(value) != self.size:
            raise ValueError(f"{self}: needs {self.size} bytes, got {len(value)}")
        try:
            return struct.pack(self.format, value)
        except struct.error as error:
            raise ValueError(f"{self}: {value!r} does not fit: {error}") from None

    def unpack(self, data: bytes) -> T:
        """Return the value in `data`. Raises DecodeError if `data` has the wrong length."""
        if len(data) != self.size:
            raise DecodeError(f"{self}: needs {self.size} bytes, received {len(data)}")
        return cast(T, struct.unpack(self.format, data)[0])

    def __str__(self) -> str:
        return f"{self.name} (0x{self.address:04X})"


# ESC information
TYPE = Register[int](0x0000, "<B", "type")
REVISION = Register[int](0x0001, "<B", "revision")
BUILD = Register[int](0x0002, "<H", "build")
FMMUS_SUPPORTED = Register[int](0x0004, "<B", "FMMUs supported")
SYNC_MANAGERS_SUPPORTED = Register[int](0x0005, "<B", "SyncManagers supported")
RAM_SIZE = Register[int](0x0006, "<B", "RAM size in kbyte")
PORT_DESCRIPTOR = Register[int](0x0007, "<B", "port descriptor")
FEATURES = Register[int](0x0008, "<H", "ESC features supported")
INFORMATION = Register[bytes](0x0000, "10s", "ESC information")  # all eight above; see features.py

# Station address
STATION_ADDRESS = Register[int](0x0010, "<H", "configured station address")
STATION_ALIAS = Register[int](0x0012, "<H", "configured station alias")

# Write protection and reset
WRITE_REGISTER_ENABLE = Register[int](0x0020, "<B", "write register enable")
WRITE_REGISTER_PROTECTION = Register[int](0x0021, "<B", "write register protection")
ESC_WRITE_ENABLE = Register[int](0x0030, "<B", "ESC write enable")
ESC_WRITE_PROTECTION = Register[int](0x0031, "<B", "ESC write protection")
ESC_RESET_ECAT = Register[int](0x0040, "<B", "ESC reset ECAT")
ESC_RESET_PDI = Register[int](0x0041, "<B", "ESC reset PDI")

# Data link layer
DL_CONTROL = Register[int](0x0100, "<I", "DL control")
PHYSICAL_READ_WRITE_OFFSET = Register[int](0x0108, "<H", "physical read/write offset")
DL_STATUS = Register[int](0x0110, "<H", "DL status")

# Application layer
AL_CONTROL = Register[int](0x0120, "<H", "AL control")
AL_STATUS = Register[int](0x0130, "<H", "AL status")
AL_STATUS_CODE = Register[int](0x0134, "<H", "AL status code")
RUN_LED_OVERRIDE = Register[int](0x0138, "<B", "RUN LED override")
ERR_LED_OVERRIDE = Register[int](0x0139, "<B", "ERR LED override")

# Process data interface
PDI_CONTROL = Register[int](0x0140, "<B", "PDI control")
ESC_CONFIGURATION = Register[int](0x0141, "<B", "ESC configuration")
PDI_INFORMATION = Register[int](0x014E, "<H", "PDI information")
PDI_CONFIGURATION = Register[int](0x0150, "<B", "PDI configuration")
SYNC_LATCH_CONFIGURATION = Register[int](0x0151, "<B", "SYNC/LATCH PDI configuration")
PDI_EXTENDED_CONFIGURATION = Register[int](0x0152, "<H", "extended PDI configuration")

# Interrupts
ECAT_EVENT_MASK = Register[int](0x0200, "<H", "ECAT event mask")
AL_EVENT_MASK = Register[int](0x0204, "<I", "PDI AL event mask")
ECAT_EVENT_REQUEST = Register[int](0x0210, "<H", "ECAT event request")
AL_EVENT_REQUEST = Register[int](0x0220, "<I", "AL event request")

# Error counters; each block contains the counters of ports 0 to 3
RX_ERROR_COUNTERS = Register[bytes](0x0300, "8s", "RX error counters")
FORWARDED_RX_ERROR_COUNTERS = Register[bytes](0x0308, "4s", "forwarded RX error counters")
PROCESSING_UNIT_ERROR_COUNTER = Register[int](0x030C, "<B", "ECAT processing unit error counter")
PDI_ERROR_COUNTER = Register[int](0x030D, "<B", "PDI error counter")
PDI_ERROR_CODE = Register[int](0x030E, "<B", "PDI error code")
LOST_LINK_COUNTERS = Register[bytes](0x0310, "4s", "lost link counters")
ERROR_COUNTERS = Register[bytes](0x0300, "20s", "error counters")  # all error counters

# Watchdogs
WATCHDOG_DIVIDER = Register[int](0x0400, "<H", "watchdog divider")
WATCHDOG_TIME_PDI = Register[int](0x0410, "<H", "watchdog time PDI")
WATCHDOG_TIME_PROCESS_DATA = Register[int](0x0420, "<H", "watchdog time process data")
WATCHDOG_STATUS_PROCESS_DATA = Register[int](0x0440, "<H", "watchdog status process data")
WATCHDOG_COUNTER_PROCESS_DATA = Register[int](0x0442, "<B", "watchdog counter process data")
WATCHDOG_COUNTER_PDI = Register[int](0x0443, "<B", "watchdog counter PDI")

# SII EEPROM interface (bits: sii_interface.py)
SII_CONFIGURATION = Register[int](0x0500, "<B", "SII EEPROM configuration")
SII_PDI_ACCESS = Register[int](0x0501, "<B", "SII EEPROM PDI access state")
SII_CONTROL_STATUS = Register[int](0x0502, "<H", "SII EEPROM control/status")
SII_ADDRESS = Register[int](0x0504, "<I", "SII EEPROM address")
SII_DATA = Register[bytes](0x0508, "8s", "SII EEPROM data")
SII_DATA_LOW = Register[bytes](0x0508, "4s", "SII EEPROM data, 4 bytes")

# MII management interface
MII_CONTROL_STATUS = Register[int](0x0510, "<H", "MII management control/status")
PHY_ADDRESS = Register[int](0x0512, "<B", "PHY address")
PHY_REGISTER_ADDRESS = Register[int](0x0513, "<B", "PHY register address")
PHY_DATA = Register[int](0x0514, "<H", "PHY data")
MII_ECAT_ACCESS = Register[int](0x0516, "<B", "MII management ECAT access state")
MII_PDI_ACCESS = Register[int](0x0517, "<B", "MII management PDI access state")

# Distributed clocks: time loop (clock.py)
RECEIVE_TIMES = Register[bytes](0x0900, "16s", "receive times of ports 0 to 3")
RECEIVE_TIME_LATCH = Register[int](0x0900, "<I", "receive time port 0")  # a write latches all ports
SYSTEM_TIME = Register[int](0x0910, "<Q", "system time")
SYSTEM_TIME_LOW = Register[int](0x0910, "<I", "system time, low half")
RECEIVE_TIME_PROCESSING_UNIT = Register[int](0x0918, "<Q", "receive time ECAT processing unit")
SYSTEM_TIME_OFFSET = Register[int](0x0920, "<Q", "system time offset")
SYSTEM_TIME_OFFSET_LOW = Register[int](0x0920, "<I", "system time offset, low half")
SYSTEM_TIME_DELAY = Register[int](0x0928, "<I", "system time delay")
SYSTEM_TIME_DIFFERENCE = Register[int](0x092C, "<I", "system time difference")  # sign-magnitude
SPEED_COUNTER_START = Register[int](0x0930, "<H", "speed counter start")
SPEED_COUNTER_DIFFERENCE = Register[int](0x0932, "<h", "speed counter difference")
SYSTEM_TIME_DIFFERENCE_FILTER = Register[int](0x0934, "<B", "system time difference filter depth")
SPEED_COUNTER_FILTER = Register[int](0x0935, "<B", "speed counter filter depth")
RECEIVE_TIME_LATCH_MODE = Register[int](0x0936, "<B", "receive time latch mode")
CLOCK_BLOCK = Register[bytes](0x0900, "56s", "distributed clock time loop")  # 0x0900 to 0x0937

# Distributed clocks: SYNC and LATCH unit
CYCLIC_UNIT_CONTROL = Register[int](0x0980, "<B", "cyclic unit control")
ASSIGN_ACTIVATE = Register[bytes](0x0980, "2s", "cyclic unit control and SYNC activation")
ACTIVATION = Register[int](0x0981, "<B", "SYNC activation")
SYNC_PULSE_LENGTH = Register[int](0x0982, "<H", "pulse length of SYNC signals")
ACTIVATION_STATUS = Register[int](0x0984, "<B", "SYNC activation status")
SYNC0_STATUS = Register[int](0x098E, "<B", "SYNC0 status")
SYNC1_STATUS = Register[int](0x098F, "<B", "SYNC1 status")
SYNC0_START_TIME = Register[int](0x0990, "<Q", "start time cyclic operation, next SYNC0 pulse")
SYNC0_START_TIME_LOW = Register[int](0x0990, "<I", "start time cyclic operation, low half")
NEXT_SYNC1_PULSE = Register[int](0x0998, "<Q", "next SYNC1 pulse")
SYNC_CYCLE_TIMES = Register[bytes](0x09A0, "8s", "SYNC0 and SYNC1 cycle times")
SYNC0_CYCLE_TIME = Register[int](0x09A0, "<I", "SYNC0 cycle time")
SYNC1_CYCLE_TIME = Register[int](0x09A4, "<I", "SYNC1 cycle time")
LATCH0_CONTROL = Register[int](0x09A8, "<B", "LATCH0 control")
LATCH1_CONTROL = Register[int](0x09A9, "<B", "LATCH1 control")
LATCH0_STATUS = Register[int](0x09AE, "<B", "LATCH0 status")
LATCH1_STATUS = Register[int](0x09AF, "<B", "LATCH1 status")
LATCH0_TIME_POSITIVE = Register[int](0x09B0, "<Q", "LATCH0 time, positive edge")
LATCH0_TIME_NEGATIVE = Register[int](0x09B8, "<Q", "LATCH0 time, negative edge")
LATCH1_TIME_POSITIVE = Register[int](0x09C0, "<Q", "LATCH1 time, positive edge")
LATCH1_TIME_NEGATIVE = Register[int](0x09C8, "<Q", "LATCH1 time, negative edge")
ECAT_BUFFER_CHANGE_TIME = Register[int](0x09F0, "<I", "EtherCAT buffer change event time")
PDI_BUFFER_START_TIME = Register[int](0x09F8, "<I", "PDI buffer start event time")
PDI_BUFFER_CHANGE_TIME = Register[int](0x09FC, "<I", "PDI buffer change event time")

# Registers that only some controllers have
PRODUCT_ID = Register[int](0x0E00, "<Q", "product ID")
VENDOR_ID = Register[int](0x0E08, "<Q", "vendor ID")
DIGITAL_OUTPUTS = Register[int](0x0F00, "<I", "digital I/O output data")
GENERAL_PURPOSE_OUTPUTS = Register[int](0x0F10, "<Q", "general purpose outputs")
GENERAL_PURPOSE_INPUTS = Register[int](0x0F18, "<Q", "general purpose inputs")


def watchdog_unit_ns(divider: int) -> int:
    """Return the unit [ns] of the watchdog times (0x0410, 0x0420) for a `divider` (0x0400)."""
    return (divider + 2) * 40


def rx_error_counter(port: int) -> Register[int]:
    """Return the RX error counter register of a port.

    The low byte counts invalid frames, the high byte PHY RX errors.
    """
    return Register(0x0300 + 2 * _checked(port, PORT_COUNT), "<H", f"RX error counter port {port}")


def forwarded_rx_error_counter(port: int) -> Register[int]:
    """Return the register that counts frames already marked as broken by an earlier device."""
    address = 0x0308 + _checked(port, PORT_COUNT)
    return Register(address, "<B", f"forwarded RX error counter port {port}")


def lost_link_counter(port: int) -> Register[int]:
    """Return the lost link counter register of a port."""
    return Register(0x0310 + _checked(port, PORT_COUNT), "<B", f"lost link counter port {port}")


def phy_port_status(port: int) -> Register[int]:
    """Return the PHY status register of a port (MII management)."""
    return Register(0x0518 + _checked(port, PORT_COUNT), "<B", f"PHY port status {port}")


def fmmu(k: int) -> Register[bytes]:
    """Return the register block of FMMU `k`; see fmmu.py."""
    return Register(0x0600 + 16 * _checked(k, FMMU_COUNT), "16s", f"FMMU {k}")


def sync_manager(k: int) -> Register[bytes]:
    """Return the register block of SyncManager `k`; see sync_manager.py."""
    return Register(0x0800 + 8 * _checked(k, SYNC_MANAGER_COUNT), "8s", f"SyncManager {k}")


def sync_manager_control(k: int) -> Register[int]:
    """Return the control register of SyncManager `k`: mode, direction, interrupts, watchdog."""
    address = 0x0804 + 8 * _checked(k, SYNC_MANAGER_COUNT)
    return Register(address, "<B", f"SyncManager {k} control")


@cache  # read with every mailbox message
def sync_manager_status(k: int) -> Register[int]:
    """Return the status register of SyncManager `k`: mailbox full, buffers."""
    address = 0x0805 + 8 * _checked(k, SYNC_MANAGER_COUNT)
    return Register(address, "<B", f"SyncManager {k} status")


def sync_manager_activation(k: int) -> Register[int]:
    """Return the activation register of SyncManager `k`: enable, repeat request."""
    address = 0x0806 + 8 * _checked(k, SYNC_MANAGER_COUNT)
    return Register(address, "<B", f"SyncManager {k} activation")


def sync_manager_pdi_control(k: int) -> Register[int]:
    """Return the PDI control register of SyncManager `k`: deactivate, repeat acknowledge."""
    address = 0x0807 + 8 * _checked(k, SYNC_MANAGER_COUNT)
    return Register(address, "<B", f"SyncManager {k} PDI control")


def receive_time(port: int) -> Register[int]:
    """Return the receive time register of a port: local arrival time of the latching write [ns]."""
    return Register(0x0900 + 4 * _checked(port, PORT_COUNT), "<I", f"receive time port {port}")


def _checked(number: int, count: int) -> int:
    if not 0 <= number < count:
        raise ValueError(f"register index {number} is out of range; use 0 to {count - 1}")
    return number
