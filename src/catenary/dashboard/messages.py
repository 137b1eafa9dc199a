"""Messages of the WebSocket as frozen values; web/src/protocol.ts has the same names."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec

SIGNALS_MAX = 256  # signals of a subscription
RATE_MAX = 60.0  # frames per second

Id = Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)]
Number = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
Name = Annotated[str, msgspec.Meta(max_length=200)]
TokenText = Annotated[str, msgspec.Meta(pattern="^[0-9]{1,15}$")]
StateName = Literal["enable", "disable", "reset", "quick_stop"]


class Subscribe(msgspec.Struct, frozen=True, tag_field="op", tag="subscribe"):
    """Request for frames with the values of signals."""

    id: Id
    signals: Annotated[list[Name], msgspec.Meta(min_length=1, max_length=SIGNALS_MAX)]
    full: bool
    rate: Annotated[float, msgspec.Meta(ge=1.0, le=RATE_MAX)] = RATE_MAX


class Unsubscribe(msgspec.Struct, frozen=True, tag_field="op", tag="unsubscribe"):
    """End of a subscription."""

    id: Id


class SweepValues(msgspec.Struct, frozen=True):
    """Sine of changing frequency: the fields of `catenary.share.Sweep`, not checked."""

    start: float  # [Hz]
    end: float  # [Hz]
    duration: float  # [s]


class Press(msgspec.Struct, frozen=True, tag_field="op", tag="press"):
    """Start of a jog. Without a distance or a sweep, it lasts until the release."""

    axis: Number
    velocity: float  # signed [rad/s or m/s]
    token: TokenText
    press: Number
    distance: float | None = None  # [rad or m]
    acceleration: float | None = None  # [rad/s² or m/s²]
    sweep: SweepValues | None = None


class Beat(msgspec.Struct, frozen=True, tag_field="op", tag="beat"):
    """Heartbeat of a jog, with the newest token that the client has received."""

    axis: Number
    press: Number
    token: TokenText


class Release(msgspec.Struct, frozen=True, tag_field="op", tag="release"):
    """End of a jog."""

    axis: Number
    press: Number


class Stop(msgspec.Struct, frozen=True, tag_field="op", tag="stop"):
    """Quick stop of all axes."""


class Request(msgspec.Struct, frozen=True, tag_field="op", tag="request"):
    """Request for a state of axes; `axes` None: all.

    `run`: run of the loop whose axes the page shows; another run refuses the request.
    """

    state: StateName
    axes: list[Number] | None = None
    run: Name | None = None


class Poses(msgspec.Struct, frozen=True, tag_field="op", tag="poses"):
    """Request for the poses of the 3D scene, or their end."""

    on: bool


class Ping(msgspec.Struct, frozen=True, tag_field="op", tag="ping"):
    """Request for a pong with the same `t`."""

    t: float


ClientMessage: TypeAlias = (
    Subscribe | Unsubscribe | Press | Beat | Release | Stop | Request | Poses | Ping
)
OPERATOR_ONLY = (Press, Beat, Release, Stop, Request)

_decoder: msgspec.json.Decoder[ClientMessage] = msgspec.json.Decoder(ClientMessage)


def decode_message(text: str | bytes) -> ClientMessage:
    """Decode a message of a client. Raises msgspec.MsgspecError if it is not valid."""
    return _decoder.decode(text)


def encode_message(op: str, **content: object) -> str:
    """Encode a message to a client. NaN and infinity become null.

    Args:
        op: kind of the message.
        content: its other fields.
    """
    return msgspec.json.encode({"op": op, **content}).decode()


def op_of(message: ClientMessage) -> str:
    """Return the `op` of a message."""
    return str(type(message).__struct_config__.tag)
