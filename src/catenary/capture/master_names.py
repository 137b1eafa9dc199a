"""Names of masters by the addresses of their frames."""

from __future__ import annotations

from catenary.wire.frame import DEFAULT_SOURCE, Frame

# The library's source addresses: SOEM nicdrv.c (priMAC, secMAC)
_BY_SOURCE = {b"\x01" * 6: "SOEM", b"\x05" + b"\x04" * 5: "SOEM", b"\x04" * 6: "SOEM"}
# Beckhoff's masters send to a multicast address
_BY_DESTINATION = {b"\x01\x01\x05\x01\x00\x00": "TwinCAT"}
_FIRST_PROCEDURE_INDEX = 0x80  # Catenary's datagrams outside of the cycle


def master_name(frame: Frame) -> str:
    """Return the name of the program that sent a frame; empty if the addresses do not show it.

    Catenary and ethercrab have the same source address. The index of Catenary's first datagram is
    0x80 or more.
    """
    if frame.sender == DEFAULT_SOURCE:
        first = frame.datagrams[0].index
        return "Catenary" if first >= _FIRST_PROCEDURE_INDEX else "ethercrab"
    known = _BY_SOURCE.get(frame.sender)
    return known or _BY_DESTINATION.get(frame.destination, "")
