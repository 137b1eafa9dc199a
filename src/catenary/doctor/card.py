"""Card: the settings that a network driver reports; `ethtool.read_card` reads them."""

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
    active: bool  # negotiated with the other end


@dataclass(frozen=True, slots=True)
class Link:
    """Speed of a link [Mbit/s] or SPEED_UNKNOWN, and its duplex mode; None if unknown."""

    speed: int
    full_duplex: bool | None


@dataclass(frozen=True, slots=True)
class Card:
    """A network card. A value is None if the driver does not report it; `refusals` has the error.

    index, hardware_type (ARPHRD_...), up and running (there is a carrier) come from the network
    namespace of the interface, which /sys may not show.
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
