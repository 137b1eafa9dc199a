"""DL control and DL status: frame forwarding, port loops and links, ETG.1000.4 §6.2."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

PORTS = range(4)


class Loop(IntEnum):
    """Loop setting of a port: its behaviour when the link comes up or goes down."""

    AUTO = 0  # open while the link is up
    AUTO_CLOSE = 1  # closes when the link goes down; only a write opens it again
    OPEN = 2
    CLOSED = 3


_AUTO = (Loop.AUTO, Loop.AUTO, Loop.AUTO, Loop.AUTO)


@dataclass(frozen=True, slots=True)
class DlControl:
    """The DL control register (0x0100)."""

    destroy_alien_frames: bool = True  # non-EtherCAT frames; if False, they are forwarded
    temporary: bool = False  # the settings are valid for about one second
    loops: tuple[Loop, Loop, Loop, Loop] = _AUTO
    receive_fifo: int = 7  # 0 to 7; a smaller FIFO has less delay
    low_jitter: bool = False
    alias_enabled: bool = False  # the device also accepts its alias in FPxx commands

    @property
    def word(self) -> int:
        """Value of the register. Raises ValueError if the FIFO size does not fit."""
        if not 0 <= self.receive_fifo <= 7:
            raise ValueError(f"DL control: receive FIFO must be 0 to 7, got {self.receive_fifo}")
        word = self.destroy_alien_frames | self.temporary << 1
        for port in PORTS:
            word |= self.loops[port] << 8 + 2 * port
        return word | self.receive_fifo << 16 | self.low_jitter << 19 | self.alias_enabled << 24

    @classmethod
    def from_word(cls, word: int) -> DlControl:
        """Return the decoded register. Reserved bits are ignored."""
        loop_0, loop_1, loop_2, loop_3 = (Loop(word >> 8 + 2 * port & 3) for port in PORTS)
        return cls(
            bool(word & 1),
            bool(word & 2),
            (loop_0, loop_1, loop_2, loop_3),
            word >> 16 & 7,
            bool(word & 1 << 19),
            bool(word & 1 << 24),
        )


@dataclass(frozen=True, slots=True)
class Port:
    """DL status of one port."""

    link: bool = False  # the PHY detects a signal
    loop_closed: bool = True  # frames turn back at this port
    communication: bool = False  # the connection is stable


_CLOSED = Port()


@dataclass(frozen=True, slots=True)
class DlStatus:
    """The DL status register (0x0110)."""

    pdi_operational: bool  # the EEPROM is loaded and the PDI is active
    pdi_watchdog: bool  # the PDI watchdog has not expired
    enhanced_link_detection: bool = False
    ports: tuple[Port, Port, Port, Port] = (_CLOSED, _CLOSED, _CLOSED, _CLOSED)

    @property
    def word(self) -> int:
        """Value of the register."""
        word = self.pdi_operational | self.pdi_watchdog << 1 | self.enhanced_link_detection << 2
        for i, port in enumerate(self.ports):
            word |= port.link << 4 + i
            word |= port.loop_closed << 8 + 2 * i | port.communication << 9 + 2 * i
        return word

    @classmethod
    def from_word(cls, word: int) -> DlStatus:
        """Return the decoded register. Bit 3 is reserved and ignored."""
        port_0, port_1, port_2, port_3 = (_port(word, i) for i in PORTS)
        return cls(bool(word & 1), bool(word & 2), bool(word & 4), (port_0, port_1, port_2, port_3))


def _port(word: int, i: int) -> Port:
    return Port(bool(word & 1 << 4 + i), bool(word & 1 << 8 + 2 * i), bool(word & 1 << 9 + 2 * i))
