"""ADS data of a virtual device, and its behaviour when they are read and written.

In TOML: `ads = { areas = { "0x4020" = 64 }, port = 0x1001 }`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import msgspec

AREA_MAX = 1 << 22  # [bytes]


class AdsOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Data and behaviour of an ADS device. Areas start with their contents after power-on."""

    # Memory by index group: the number of bytes (zeros), bytes, or text. In TOML, a key is text.
    areas: Mapping[Any, Any] = {}
    read_only: tuple[int, ...] = ()  # index groups
    port: int = 0xFFFF  # the only port; 0xFFFF is that of the device itself (SSC, aoeappl.c)
    name: str = "Catenary virtual"  # at most 16 characters
    version: tuple[int, int, int] = (1, 2, 3)  # version, revision, build
    objects: bool = True  # index group 0xF302 reads and writes the objects of CoE

    # Invoke ID of responses. "wrong": that of another request. No such device has been reported.
    invoke_id: Literal["returned", "wrong"] = "returned"

    # Length in the header, relative to the data. No such device has been reported.
    length: Literal["right", "long", "short"] = "right"

    # Number of responses to a request. "endless": 200 messages that answer other requests.
    responses: Literal["one", "none", "endless"] = "one"

    # Fragments of a long response. "acknowledged": the device waits for the acknowledgement of
    # each. "repeated": each is sent twice. "missing": the second is not sent. "empty": the second
    # has no data.
    fragments: Literal["sent", "acknowledged", "repeated", "missing", "empty"] = "sent"

    def __post_init__(self) -> None:
        for group, content in self.areas.items():
            group_of(group)
            if len(content_of(content)) > AREA_MAX:
                raise ValueError(f"area {group!r} exceeds {AREA_MAX} bytes")
        if not 0 <= self.port <= 0xFFFF:
            raise ValueError(f"port must be 0 to 0xFFFF, not {self.port}")
        if len(self.name) > 16 or not self.name.isascii():
            raise ValueError(f"name must have at most 16 ASCII characters, not {self.name!r}")


def group_of(key: object) -> int:
    """Return the index group of a key of `areas`: a number, or text such as "0x4020"."""
    number = int(key, 0) if isinstance(key, str) else key
    if not isinstance(number, int) or not 0 <= number <= 0xFFFF_FFFF:
        raise ValueError(f"areas: {key!r} is not an index group of 32 bits")
    return number


def content_of(content: object) -> bytearray:
    """Return the contents of an area: a number of zero bytes, bytes or text."""
    if isinstance(content, str):
        return bytearray(content.encode())
    if isinstance(content, int) and not isinstance(content, bool) and 0 <= content <= AREA_MAX:
        return bytearray(content)
    if isinstance(content, bytes):
        return bytearray(content)
    raise ValueError(f"areas: {content!r} is not a number of bytes (at most {AREA_MAX}), or bytes")
