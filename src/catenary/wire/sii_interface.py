"""Register interface to the SII EEPROM, 0x0500 to 0x050F, ETG.1000.4 §6.4."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from catenary.errors import DecodeError

CONFIGURATION_TO_PDI = 0x01  # bit of 0x0500: the device's processor owns the EEPROM
CONFIGURATION_FORCE = (
    0x02  # bit of 0x0500: assign the EEPROM to EtherCAT even while the PDI uses it
)
PDI_ACCESS_ACTIVE = 0x01  # bit of 0x0501


class SiiCommand(IntEnum):
    """Command to the EEPROM: bits 8 to 10 of control/status."""

    IDLE = 0  # writing it clears the error bits
    READ = 1
    WRITE = 2
    RELOAD = 4


@dataclass(frozen=True, slots=True)
class ControlStatus:
    """SII control/status (0x0502). Only `write_enable` and `command` can be written."""

    command: SiiCommand = SiiCommand.IDLE
    write_enable: bool = False  # valid only for the datagram that also writes the command
    emulation: bool = False  # the device's processor emulates the EEPROM
    eight_bytes: bool = False  # a read command returns 8 bytes instead of 4
    two_byte_address: bool = False  # EEPROMs larger than 16 kbit
    checksum_error: bool = False
    not_loaded: bool = False
    command_error: bool = False  # the EEPROM did not acknowledge, or the command is invalid
    write_enable_error: bool = False
    busy: bool = False

    @property
    def read_size(self) -> int:
        """Number of bytes per read command."""
        return 8 if self.eight_bytes else 4

    @property
    def failed(self) -> bool:
        """True if the last command failed. Write IDLE to clear the error."""
        return self.command_error or self.write_enable_error

    @property
    def word(self) -> int:
        """Value of the register."""
        return (
            self.write_enable
            | self.emulation << 5
            | self.eight_bytes << 6
            | self.two_byte_address << 7
            | self.command << 8
            | self.checksum_error << 11
            | self.not_loaded << 12
            | self.command_error << 13
            | self.write_enable_error << 14
            | self.busy << 15
        )

    @classmethod
    def from_word(cls, word: int) -> ControlStatus:
        """Return the decoded register. Raises DecodeError if the command is invalid."""
        try:
            command = SiiCommand(word >> 8 & 7)
        except ValueError:
            raise DecodeError(
                f"SII control/status 0x{word:04X}: invalid command {word >> 8 & 7}"
            ) from None
        return cls(
            command,
            *(bool(word >> bit & 1) for bit in (0, 5, 6, 7, 11, 12, 13, 14, 15)),
        )
