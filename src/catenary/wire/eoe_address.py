"""Addresses and address filters of EoE, ETG.1000.6 §5.7.4 and §5.7.5.

Each field of an address has a fixed place, as in IgH (fsm_eoe.c), the SSC (ecateoe.h) and
Wireshark. SOEM and SOES send present fields without gaps, and no more bytes than needed. The two
forms are equal if no field is missing before a present one. Numbers are little-endian.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from ipaddress import IPv4Address

from catenary.errors import DecodeError

FLAGS_SIZE, MAC_SIZE, IP_SIZE, NAME_SIZE = 4, 6, 4, 32
# Fields in the order of their flags, from bit 0 on.
FIELDS = (
    ("mac", MAC_SIZE),
    ("ip", IP_SIZE),
    ("mask", IP_SIZE),
    ("gateway", IP_SIZE),
    ("dns", IP_SIZE),
    ("name", NAME_SIZE),
)
FIXED_SIZE = sum(size for _, size in FIELDS)
APPEND_TIME = 1 << 16  # flag: the device appends time stamps to its frames
FILTERS_MAX, MASKS_MAX = 15, 3  # largest values of the two counts
FILTER_PLACES, MASK_PLACES = 16, 4
NO_BROADCASTS = 0x0080
_FLAGS = struct.Struct("<I")
_FILTER_FLAGS = struct.Struct("<H")
FILTER_SIZE = _FILTER_FLAGS.size + (FILTER_PLACES + MASK_PLACES) * MAC_SIZE


@dataclass(frozen=True, slots=True)
class EthernetAddress:
    """Addresses of a device's Ethernet port. None stands for a field that is not present."""

    mac: bytes | None = None  # 6 bytes
    ip: IPv4Address | None = None
    mask: IPv4Address | None = None
    gateway: IPv4Address | None = None
    dns: IPv4Address | None = None
    name: str | None = None
    append_time: bool = False  # request to append time stamps

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        flags, fields = APPEND_TIME if self.append_time else 0, b""
        for bit, (name, size) in enumerate(FIELDS):
            value = getattr(self, name)
            flags |= (value is not None) << bit
            fields += bytes(size) if value is None else _encoded(name, value, size)
        return _FLAGS.pack(flags) + fields

    @property
    def has_gap(self) -> bool:
        """True if a field is missing before a present one."""
        present = [getattr(self, name) is not None for name, _ in FIELDS]
        return present != sorted(present, reverse=True)


def _encoded(name: str, value: bytes | IPv4Address | str, size: int) -> bytes:
    if isinstance(value, IPv4Address):
        return value.packed[::-1]
    if isinstance(value, bytes):
        data = value
    else:
        try:
            data = value.encode("ascii").ljust(size, b"\0")
        except UnicodeEncodeError:
            raise ValueError(f"EoE: the name {value!r} is not ASCII") from None
    if len(data) != size:
        raise ValueError(f"EoE: the {name} {value!r} has {len(data)} bytes instead of {size}")
    return data


def decode_address(data: bytes) -> EthernetAddress:
    """Decode the parameters of a request or of an answer, in one of the two forms."""
    if len(data) < FLAGS_SIZE:
        raise DecodeError(f"EoE address: needs {FLAGS_SIZE} bytes, received {len(data)}")
    [flags] = _FLAGS.unpack_from(data)
    rest = data[FLAGS_SIZE:]
    fixed = len(rest) >= FIXED_SIZE
    values: dict[str, bytes] = {}
    for bit, (name, size) in enumerate(FIELDS):
        present = bool(flags >> bit & 1)
        if present:
            values[name] = _field(name, rest, size)
        if present or fixed:
            rest = rest[size:]
    return EthernetAddress(
        mac=values.get("mac"),
        ip=_ip(values.get("ip")),
        mask=_ip(values.get("mask")),
        gateway=_ip(values.get("gateway")),
        dns=_ip(values.get("dns")),
        name=_name(values.get("name")),
        append_time=bool(flags & APPEND_TIME),
    )


def _field(name: str, rest: bytes, size: int) -> bytes:
    # A name may be shorter than its place: the SSC and SOES accept one byte.
    if len(rest) < (1 if name == "name" else size):
        raise DecodeError(f"EoE address: {name} needs {size} bytes, received {len(rest)}")
    return bytes(rest[:size])


def _ip(data: bytes | None) -> IPv4Address | None:
    return None if data is None else IPv4Address(data[::-1])


def _name(data: bytes | None) -> str | None:
    """Return the name before the first zero byte; other characters than ASCII become "?"."""
    if data is None:
        return None
    return data.split(b"\0", 1)[0].decode("ascii", "replace").replace("\ufffd", "?")


@dataclass(frozen=True, slots=True)
class MacFilter:
    """Destination addresses that a device lets pass, with masks; up to 15 and 3."""

    addresses: tuple[bytes, ...] = ()
    masks: tuple[bytes, ...] = ()
    no_broadcasts: bool = False

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if len(self.addresses) > FILTERS_MAX or len(self.masks) > MASKS_MAX:
            raise ValueError(f"EoE filter: at most {FILTERS_MAX} addresses and {MASKS_MAX} masks")
        for each in (*self.addresses, *self.masks):
            if len(each) != MAC_SIZE:
                raise ValueError(f"EoE filter: {each.hex(':')} has not {MAC_SIZE} bytes")
        flags = len(self.addresses) | len(self.masks) << 4 | NO_BROADCASTS * self.no_broadcasts
        addresses = b"".join(self.addresses).ljust(FILTER_PLACES * MAC_SIZE, b"\0")
        masks = b"".join(self.masks).ljust(MASK_PLACES * MAC_SIZE, b"\0")
        return _FILTER_FLAGS.pack(flags) + addresses + masks


def decode_filter(data: bytes) -> MacFilter:
    """Decode the parameters of a request or of an answer."""
    if len(data) < FILTER_SIZE:
        raise DecodeError(f"EoE filter: needs {FILTER_SIZE} bytes, received {len(data)}")
    [flags] = _FILTER_FLAGS.unpack_from(data)
    start = _FILTER_FLAGS.size
    places = [bytes(data[at : at + MAC_SIZE]) for at in range(start, FILTER_SIZE, MAC_SIZE)]
    addresses, masks = places[: flags & 0x0F], places[FILTER_PLACES:][: flags >> 4 & 3]
    return MacFilter(tuple(addresses), tuple(masks), bool(flags & NO_BROADCASTS))
