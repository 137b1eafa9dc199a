"""FSoE connections between two devices, over which the cycle relays safety frames unchanged.

Catenary is the black channel of FSoE: it has no part in the safety protocol, and makes no safety
claim. The devices detect lost, repeated, swapped and changed frames themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from catenary.bus import SubDevice
from catenary.drive.copy_place import CopyPlace, place_text
from catenary.wire.fsoe import command_of, command_text, connection_id_of

Way = tuple[SubDevice, CopyPlace, SubDevice, CopyPlace]


@dataclass(frozen=True, slots=True)
class FsoeConnection:
    """Safety frames of one FSoE connection, which `Copies` relays in both directions.

        FsoeConnection(
            main=(logic, "FSoE main frame 1", "FSoE sub frame 1"),
            sub=(curtain, 0x1A00, 0x1600),
        )

    Args:
        main: Device with the FSoE MainInstance, the place of its frame in its inputs, and the place
            in its outputs for the frame of the SubInstance. A place is that of a `Copy`.
        sub: The same for the device with the SubInstance.

    Raises:
        TypeError: `main` or `sub` does not have three parts.
    """

    main: tuple[SubDevice, CopyPlace, CopyPlace]
    sub: tuple[SubDevice, CopyPlace, CopyPlace]

    def __post_init__(self) -> None:
        for name, given in (("main", self.main), ("sub", self.sub)):
            if not isinstance(given, tuple) or len(given) != 3:
                raise TypeError(
                    f"{name}={given!r}: give (device, place in its inputs, place in its outputs)"
                )

    @property
    def ways(self) -> tuple[Way, Way]:
        """Copies of the connection: main to sub, then sub to main."""
        main, sub = self.main, self.sub
        return (main[0], main[1], sub[0], sub[2]), (sub[0], sub[1], main[0], main[2])

    def __str__(self) -> str:
        ends = (f"{end[0].station}, {place_text(end[1])}" for end in (self.main, self.sub))
        return " ↔ ".join(ends)


class FsoeFrames(NamedTuple):
    """Frames of a connection that arrived last, for diagnosis. They are not checked."""

    connection: str
    main: bytes
    sub: bytes

    def __str__(self) -> str:
        ways = (("main", self.main), ("sub", self.sub))
        texts = [f"{name} {command_text(command_of(frame))}, connection ID "
                 f"{connection_id_of(frame)}" for name, frame in ways]  # fmt: skip
        return f"{self.connection}: {'; '.join(texts)}"


def fsoe_problems(frames: Sequence[FsoeFrames]) -> tuple[str, ...]:
    """Return contradictions between the connection IDs. An ID of 0 means that none is set yet.

    Args:
        frames: The present frames of all connections.
    """
    problems = []
    users: dict[int, str] = {}
    for each in frames:
        main, sub = connection_id_of(each.main), connection_id_of(each.sub)
        if main and sub and main != sub:
            problems.append(
                f"{each.connection}: main uses connection ID {main}, but sub uses {sub}; the "
                "relay may connect the wrong devices"
            )
        for number in {main, sub} - {0}:
            other = users.setdefault(number, each.connection)
            if other != each.connection:
                problems.append(f"connection ID {number} is used by {other} and {each.connection}")
    return tuple(problems)
