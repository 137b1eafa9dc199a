"""Remarks on a capture: missing packets, other protocols, several masters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.capture.file import FileCounts
from catenary.capture.timeline import MasterSummary


def notes(counts: FileCounts, masters: Sequence[MasterSummary]) -> Iterator[str]:
    """Yield the remarks on a capture that was read to its end.

    Args:
        counts: Numbers of packets in the file.
        masters: The masters in the capture.
    """
    yield from _file_notes(counts)
    yield from _frame_notes(counts)
    if len(masters) > 1:
        sources = ", ".join(str(each.master) for each in masters)
        yield (
            f"{len(masters)} source addresses send EtherCAT frames: {sources}. One master has two "
            "if it uses two interfaces (redundancy). Two masters on one segment disturb each other"
        )
    for each in masters:
        yield from _master_notes(each)


def _file_notes(counts: FileCounts) -> Iterator[str]:
    if counts.damaged:
        yield f"the file is damaged {counts.damaged}; the rest is not shown"
    if counts.cut:
        yield (
            f"the file ends in the middle of a packet ({counts.cut} bytes): the program that "
            "recorded it was killed, or the disk was full"
        )
    if counts.dropped:
        yield (
            f"the recording program dropped {counts.dropped} packets: lost frames below may be "
            "missing in the file only. Record with a larger buffer: dumpcap -B 64"
        )


def _frame_notes(counts: FileCounts) -> Iterator[str]:
    if counts.other:
        yield f"{counts.other} packets of other protocols were skipped"
    if counts.unsupported:
        yield (
            f"{counts.unsupported} packets were skipped because their link type carries no "
            "Ethernet frames: capture on the network interface of the master"
        )
    if counts.shortened:
        yield (
            f"{counts.shortened} EtherCAT frames are shortened, so they were skipped: record "
            "complete packets (tcpdump -s 0)"
        )
    if counts.malformed:
        yield f"{counts.malformed} EtherCAT frames are invalid, first: {counts.first_malformed}"


def _master_notes(summary: MasterSummary) -> Iterator[str]:
    master = summary.master
    name = f"master {master.number}"
    if master.sent and not master.returned:
        yield (
            f"{name}: no frame returned. Either no device is connected, or the capture contains "
            "only the sent direction"
        )
    elif master.returned and not master.sent:
        yield f"{name}: the capture contains only returned frames, so latencies are unknown"
    if master.collisions:
        yield (
            f"{name}: {master.collisions} frames had the same index as another frame on its way: "
            "two programs may use this source address on one segment"
        )
    if master.sent and master.returned and master.lost:
        yield f"{name}: {master.lost} of {master.sent} frames did not return"
