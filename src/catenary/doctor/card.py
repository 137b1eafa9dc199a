"""Card: the settings that a network driver reports. A value; `ethtool.read_card` makes it."""

from __future__ import annotations

from dataclasses import dataclass, field

SPEED_UNKNOWN = -1
ARPHRD_ETHER = 1  # linux/if_arp.h


@dataclass(frozen=True, slots=True)
class Coalescing:
    """Delay of the card's interrupts: `ethtool -c`."""

    rx_usecs: int
    rx_frames: int
    adaptive_rx: bool


@dataclass(frozen=True, slots=True)
class Eee:
    """Energy-efficient Ethernet: `ethtool --show-eee`."""

    enabled: bool
    active: bool  # agreed with the other end


@dataclass(frozen=True, slots=True)
class Link:
    """speed: [Mbit/s], or SPEED_UNKNOWN. full_duplex: None where it is not known."""

    speed: int
    full_duplex: bool | None


@dataclass(frozen=True, slots=True)
class Card:
    """A network card. None: the driver does not report the value; `refusals` has its error.

    index, hardware_type (ARPHRD_...), up, running: from the interface's own network namespace,
    which /sys may not show. running: there is a carrier.
    """

    name: str
    index: int = 0
    hardware_type: int = ARPHRD_ETHER
    up: bool = True
    running: bool = True
    driver: str = ""
    bus: str = ""
    link: Link | None = None
    coalescing: Coalescing | None = None
    eee: Eee | None = None
    gro: bool | None = None
    lro: bool | None = None
    refusals: dict[str, str] = field(default_factory=dict)
