"""Error codes of ADS, ETG.1020, as Beckhoff's SSC (ecataoe.h) and Wireshark (packet-ams.h) list."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class AdsMeaning(NamedTuple):
    """Meaning of an error code, and the next step."""

    text: str
    hint: str = ""


PLACE = "the manual of the device lists its index groups, offsets and ports"
SIZE = "read or write exactly the size that the manual states"
STATE = "read the state: sub.aoe.state(); the device may need another EtherCAT state"
AGAIN = "repeat the request later"
PROTOCOL = "its firmware does not offer this service: use another one, or CoE"

ERRORS: Mapping[int, AdsMeaning] = {
    0x0001: AdsMeaning("internal error"),
    0x0005: AdsMeaning("wrong receive header", PROTOCOL),
    0x0006: AdsMeaning("target port not found", PLACE),
    0x0007: AdsMeaning("target NetId not found", "assign the NetId first: sub.aoe.assign_net_id()"),
    0x0008: AdsMeaning("unknown command", PROTOCOL),
    0x000B: AdsMeaning("no memory", AGAIN),
    0x0012: AdsMeaning("port disabled", STATE),
    0x0700: AdsMeaning("device error"),
    0x0701: AdsMeaning("service not supported", PROTOCOL),
    0x0702: AdsMeaning("invalid index group", PLACE),
    0x0703: AdsMeaning("invalid index offset", PLACE),
    0x0704: AdsMeaning("reading or writing not permitted", "the place is read-only or write-only"),
    0x0705: AdsMeaning("wrong size", SIZE),
    0x0706: AdsMeaning("invalid value", "the manual of the device states the permitted values"),
    0x0707: AdsMeaning("device not ready", STATE),
    0x0708: AdsMeaning("device busy", AGAIN),
    0x0709: AdsMeaning("invalid context", STATE),
    0x070A: AdsMeaning("out of memory", "read or write fewer bytes at once"),
    0x070B: AdsMeaning("invalid parameter", PLACE),
    0x070C: AdsMeaning("not found", PLACE),
    0x070D: AdsMeaning("syntax error in a command or file"),
    0x070E: AdsMeaning("objects do not match"),
    0x070F: AdsMeaning("object already exists"),
    0x0710: AdsMeaning("symbol not found", PLACE),
    0x0711: AdsMeaning("symbol version invalid", "request the symbol again"),
    0x0712: AdsMeaning("invalid state", STATE),
    0x0713: AdsMeaning("transmission mode not supported", "use the other mode of a notification"),
    0x0714: AdsMeaning("notification handle invalid", "the device was restarted: subscribe again"),
    0x0716: AdsMeaning("no further notifications", "end a notification that is not needed"),
    0x0718: AdsMeaning("device not initialised", STATE),
    0x0719: AdsMeaning("timeout in the device", AGAIN),
}
UNKNOWN_ERROR = AdsMeaning("code of the vendor", "the manual of the device explains this code")


def ads_meaning(code: int) -> AdsMeaning:
    """Return the meaning of an error code; `UNKNOWN_ERROR` if it is not a standard one."""
    return ERRORS.get(code, UNKNOWN_ERROR)
