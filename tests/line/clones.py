"""Random clones, and one clone with every field."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypothesis import strategies as st

from catenary.line import (
    ClonedAssignment,
    ClonedDevice,
    ClonedEntry,
    ClonedObject,
    ClonedPdo,
    Line,
    MappedEntry,
)
from catenary.model.device import Identity, MailboxLayout
from catenary.wire import register
from catenary.wire.sdo_information import Access
from catenary.wire.sii import MailboxProtocol

REGISTERS = (
    *(register.INFORMATION, register.DL_STATUS, register.ERROR_COUNTERS, register.fmmu(0)),
    *(register.sync_manager(0), register.sync_manager(1), register.SYNC_CYCLE_TIMES),
)
LAYOUT = MailboxLayout(0x1000, 128, 0x1080, 128, MailboxProtocol.COE | MailboxProtocol.FOE)


def one_device(position: int = 0, **changes: Any) -> ClonedDevice:
    """Return a device with a value in every field."""
    entries = (
        ClonedEntry(0x1018, 0, 5, 8, Access(7), "count", b"\x04"),
        ClonedEntry(0x1018, 1, 7, 32, Access(7), "vendor", b"\x02\x00\x00\x00"),
        ClonedEntry(0x1018, 2, 7, 32, Access(7), "product", None, 0x0602_0000),
        ClonedEntry(0x1018, 3, 0x0801, 32, Access(0x3F), "a\tb\\\n", None, None, "no answer"),
        ClonedEntry(0x1018, 4, 7, 32, Access(0), "", b""),
    )
    device = ClonedDevice(
        position=position,
        name=f"Axis {position}",
        identity=Identity(2, 3, 4, 5),
        station_address=0x1001 + position,
        alias=7,
        al_status=2,
        al_status_code=0,
        registers={each.address: bytes(each.size) for each in REGISTERS},
        order="AX",
        group="Drive",
        parent=position - 1 if position else None,
        parent_port=1 if position else None,
        raised=True,
        mailbox=LAYOUT,
        assignments=(ClonedAssignment(2, (ClonedPdo(0x1600, (MappedEntry(0x6040, 0, 16),)),)),),
        mapping_source="CoE",
        sii=bytes(range(128)),
        objects=(
            ClonedObject(0x1000, 0, 0, 0, reason="refused"),
            ClonedObject(0x1018, 9, 0x23, 4, "Identity", entries),
        ),
        notes=("a note",),
    )
    return replace(device, **changes)


words = st.integers(0, 0xFFFF)
names = st.text(max_size=12)
reasons = names.filter(lambda text: not text.startswith("0x"))


@st.composite
def objects(draw: st.DrawFn, index: int) -> ClonedObject:
    subindices = sorted(draw(st.sets(st.integers(0, 255), max_size=4)))
    entries = []
    for subindex in subindices:
        value = draw(st.none() | st.binary(max_size=20))
        abort = draw(st.none() | st.integers(0, 0xFFFF_FFFF))
        reason = "" if abort is not None else draw(reasons)
        access = Access(draw(words))
        entries.append(
            ClonedEntry(
                *(index, subindex, draw(words), draw(words), access),
                *(draw(names), value, abort, reason),
            )
        )
    code, subindex = draw(st.integers(0, 255)), draw(st.integers(0, 255))
    return ClonedObject(
        index, code, draw(words), subindex, draw(names), tuple(entries), draw(reasons)
    )


@st.composite
def devices(draw: st.DrawFn, position: int) -> ClonedDevice:
    indices = sorted(draw(st.sets(words, min_size=1, max_size=3)))
    changes: dict[str, object] = {
        "name": draw(names),
        "order": draw(names),
        "identity": draw(st.none() | st.just(Identity(1, 2, 3, 0xFFFF_FFFF))),
        "objects": tuple(draw(objects(index)) for index in indices),
        "notes": tuple(draw(st.lists(names, max_size=2))),
        "sii": draw(st.none() | st.binary(max_size=64)),
        "registers": {each.address: draw(_block(each.size)) for each in REGISTERS},
        "alias": draw(words),
    }
    if changes["sii"] is None:
        changes["missing"] = {"sii": draw(names)}
    return one_device(position, **changes)


def _block(size: int) -> st.SearchStrategy[bytes]:
    return st.binary(min_size=size, max_size=size)


@st.composite
def lines(draw: st.DrawFn) -> Line:
    count = draw(st.integers(1, 3))
    found = tuple(draw(devices(position)) for position in range(count))
    return Line(found, draw(st.booleans()), tuple(draw(st.lists(names, max_size=2))))
