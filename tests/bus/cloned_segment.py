"""A segment for the tests of clones: states, registers, and the frames that were sent."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import catenary as cat
from catenary.wire.al import AlState
from catenary.wire.datagram import Datagram
from catenary.wire.frame import decode_frame, is_alien
from catenary.wire.pcapng import decode_pcapng

COUPLER, SERVO, OUTPUTS, WRIST = range(4)


def make_segment() -> cat.Segment:
    """Return a coupler, a servo, outputs and another servo."""
    return cat.Segment(
        [
            cat.virtual.Coupler(),
            cat.virtual.Servo(alias=10, serial=5),
            cat.virtual.DigitalOutputs(),
            cat.virtual.Servo(name="wrist", serial=7),
        ]
    )


def bring(segment: cat.Segment, **states: AlState) -> None:
    """Bring devices to states, named by their constants. They stay in them."""
    with cat.MainDevice(segment) as main:
        for name, state in states.items():
            found = main.request_states(main.passive_scan(), [globals()[name]], state)
            for outcome in found.values():
                assert not isinstance(outcome, Exception), outcome


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def memory(segment: cat.Segment, position: int) -> dict[int, bytes]:
    """Return the registers of a device that do not change by themselves, by 16 bytes."""
    core = segment.core
    found = {start: core.peek(position, start, 16) for start in range(0, 0x900, 16)}
    del found[0x0500]  # data and status of the SII interface
    found[0x0500] = core.peek(position, 0x0500, 1)
    return found


def sent(path: Path) -> Iterator[Datagram]:
    """Yield the datagrams that a recorder saw."""
    for packet in decode_pcapng(path.read_bytes()).packets:
        if not is_alien(packet.data):
            yield from decode_frame(packet.data).datagrams


def written(path: Path) -> Iterator[Datagram]:
    return (each for each in sent(path) if each.command.writes)
