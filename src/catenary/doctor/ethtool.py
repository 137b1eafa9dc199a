"""Requests to a network driver (linux/ethtool.h), without the ethtool program.

Reading needs no privilege. To change coalescing or EEE, read the whole structure, change one field
and write it back, as ethtool does.
"""

from __future__ import annotations

import array
import fcntl
import os
import socket
import struct
from collections.abc import Callable
from typing import TypeVar

from catenary.doctor.card import SPEED_UNKNOWN, Card, Coalescing, Eee, Link

SIOCGIFFLAGS, SIOCGIFHWADDR, SIOCETHTOOL = 0x8913, 0x8927, 0x8946  # linux/sockios.h
IFF_UP, IFF_RUNNING = 1 << 0, 1 << 6  # linux/if.h
GDRVINFO, GCOALESCE, SCOALESCE = 0x03, 0x0E, 0x0F
GFLAGS, GGRO, GEEE, SEEE, GLINKSETTINGS = 0x25, 0x2B, 0x44, 0x45, 0x4C
DRVINFO_SIZE, COALESCE_SIZE, EEE_SIZE = 196, 23 * 4, 10 * 4
LINK_SETTINGS_SIZE = 48  # three masks of link modes follow
MODE_WORDS_AT = 15  # link_mode_masks_nwords, a signed byte
FLAG_LRO = 1 << 15
DUPLEX = {0: False, 1: True}  # 0xFF: unknown

SETTINGS = {  # (command to read, command to write, size of the structure, offset of the field)
    "rx-usecs": (GCOALESCE, SCOALESCE, COALESCE_SIZE, 4),
    "adaptive-rx": (GCOALESCE, SCOALESCE, COALESCE_SIZE, 40),
    "eee": (GEEE, SEEE, EEE_SIZE, 20),
}

Answer = TypeVar("Answer")


def request(name: str, command: int, size: int, start: bytes = b"") -> bytes:
    """Send a request to the driver, and return its answer.

    Args:
        name: network interface.
        command: ETHTOOL_... command.
        size: size of the structure [bytes].
        start: content of the structure after the command.

    Raises:
        OSError: the driver does not support the request, or refuses it.
    """
    buffer = array.array("B", (struct.pack("=I", command) + start).ljust(size, b"\0"))
    interface = struct.pack("16sP16x", name.encode(), buffer.buffer_info()[0])  # struct ifreq
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        fcntl.ioctl(control, SIOCETHTOOL, interface)
    return buffer.tobytes()


def read_card(name: str) -> Card:
    """Return all settings that the driver of an interface reports, and its errors."""
    refusals: dict[str, str] = {}

    def attempt(what: str, read: Callable[[str], Answer]) -> Answer | None:
        try:
            return read(name)
        except OSError as error:
            refusals[what] = refusal(error)
            return None

    driver, bus = attempt("driver", read_driver) or ("", "")
    flags = interface_word(name, SIOCGIFFLAGS)
    return Card(
        name,
        index=socket.if_nametoindex(name),
        hardware_type=interface_word(name, SIOCGIFHWADDR),
        up=bool(flags & IFF_UP),
        running=bool(flags & IFF_RUNNING),
        driver=driver,
        bus=bus,
        link=attempt("link", read_link),
        coalescing=attempt("coalescing", read_coalescing),
        eee=attempt("eee", read_eee),
        gro=attempt("gro", lambda name: flag(request(name, GGRO, 8), 1)),
        lro=attempt("lro", lambda name: flag(request(name, GFLAGS, 8), FLAG_LRO)),
        refusals=refusals,
    )


def interface_word(name: str, command: int) -> int:
    """Return the first 16 bits of the answer to a SIOCGIF* request (`struct ifreq`)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        answer = fcntl.ioctl(control, command, struct.pack("16s24x", name.encode()))
    return int(struct.unpack_from("=H", answer, 16)[0])


def refusal(error: OSError) -> str:
    number = error.errno or 0
    return "Operation not supported" if number == 524 else os.strerror(number)  # 524: ENOTSUPP


def read_driver(name: str) -> tuple[str, str]:
    """Return the driver's name and the card's bus address: `struct ethtool_drvinfo`."""
    answer = request(name, GDRVINFO, DRVINFO_SIZE)
    return c_string(answer, 4), c_string(answer, 100)


def c_string(answer: bytes, at: int) -> str:
    return answer[at : at + 32].partition(b"\0")[0].decode(errors="replace")


def read_link(name: str) -> Link:
    """Read `struct ethtool_link_settings`. The first request returns the length of its masks."""
    first = request(name, GLINKSETTINGS, LINK_SETTINGS_SIZE)
    words = abs(struct.unpack_from("b", first, MODE_WORDS_AT)[0])
    start = bytes(MODE_WORDS_AT - 4) + struct.pack("b", words)
    return decode_link(request(name, GLINKSETTINGS, LINK_SETTINGS_SIZE + 12 * words, start))


def decode_link(answer: bytes) -> Link:
    speed, duplex = struct.unpack_from("=iB", answer, 4)
    return Link(speed if speed > 0 else SPEED_UNKNOWN, DUPLEX.get(duplex))


def read_coalescing(name: str) -> Coalescing:
    return decode_coalescing(request(name, GCOALESCE, COALESCE_SIZE))


def decode_coalescing(answer: bytes) -> Coalescing:
    fields = struct.unpack_from("=23I", answer)
    return Coalescing(rx_usecs=fields[1], rx_frames=fields[2], adaptive_rx=bool(fields[10]))


def read_eee(name: str) -> Eee:
    return decode_eee(request(name, GEEE, EEE_SIZE))


def decode_eee(answer: bytes) -> Eee:
    fields = struct.unpack_from("=10I", answer)
    return Eee(enabled=bool(fields[5]), active=bool(fields[4]))


def flag(answer: bytes, mask: int) -> bool:
    """Return True if a flag of `struct ethtool_value` is set."""
    return bool(struct.unpack_from("=2I", answer)[1] & mask)


def read_setting(name: str, setting: str) -> int:
    read, _, size, at = SETTINGS[setting]
    return int(struct.unpack_from("=I", request(name, read, size), at)[0])


def write_setting(name: str, setting: str, value: int) -> None:
    """Change one setting of the driver. Raises OSError if the driver refuses."""
    read, write, size, at = SETTINGS[setting]
    answer = bytearray(request(name, read, size))
    struct.pack_into("=I", answer, at, value)
    request(name, write, size, bytes(answer[4:]))
