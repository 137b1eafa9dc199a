"""Reasons why a received packet is not used, and the advice for each."""

from __future__ import annotations

from enum import Enum


class Refusal(Enum):
    """Reason why a packet is not used."""

    FORMAT = "not a packet of this protocol"
    VERSION = "another version of the protocol"
    KEY = "wrong digest"
    AXES = "another number of axes"
    NOT_FINITE = "a value is not finite"
    REFLECTED = "a packet of this side"
    SESSION = "another session"
    REPLAYED = "a packet that was already received"
    LATE = "older than the newest packet"
    UNPROVEN = "the other side has not answered this session yet"
    DELAYED = "the sum of the delays is beyond the bound"


ADVICE = {
    Refusal.FORMAT: "another program sends to this port; compare the addresses of both sides",
    Refusal.VERSION: "install the same version of Catenary on both sides",
    Refusal.KEY: "give both sides the same key file; until then, no packet is used",
    Refusal.AXES: "give both peers the same number of axes",
    Refusal.NOT_FINITE: "look for a division by zero or a lost sensor in the other program",
    Refusal.REFLECTED: "the remote address leads back to this side; compare the addresses",
    Refusal.SESSION: "two programs send with this key, or recorded packets are sent again; "
    "a restarted program connects after this link is lost",
    Refusal.REPLAYED: "the network duplicates packets, or recorded packets are sent again",
}  # the others are ordinary on a network, and are only counted
