"""Layout of a shared segment. The segment begins with a description of itself.

0   8 bytes  "CATSHARE"
8   u32      version of the format
12  u32      bytes of the description
16  u64      bytes of the segment
24           description: a ShareLayout as JSON
...          ring of cycles and ring of events (ring.h), at the offsets in the description
...          u8   number of the operating mode in the description, counted from 1; 0: none
"""

from __future__ import annotations

import math
import mmap
import struct
import uuid
from typing import Literal

import msgspec
import numpy as np

from catenary.errors import ShareError
from catenary.plan.sink import SinkField, SinkLayout
from catenary.share import _rows
from catenary.share.choice import Choice
from catenary.share.operation import NO_MODE, Operation
from catenary.share.process import Process

MAGIC = b"CATSHARE"
VERSION = 3
HEADER = struct.Struct("<8sIIQ")
ALIGNMENT = 4096
EVENT_SIZE = 1024  # bytes of an event
EVENT_COUNT = 256
ROWS_MIN = 64
NUMBERS = frozenset("biuf")  # kinds of NumPy types
# Errors of msgspec and NumPy for an invalid description.
DAMAGE = (
    msgspec.MsgspecError,
    MemoryError,
    OverflowError,
    RecursionError,
    SyntaxError,
    TypeError,
    ValueError,
)

Clock = Literal["monotonic", "virtual"]


class ShareField(msgspec.Struct, frozen=True):
    """Field of the record of a cycle."""

    name: str
    dtype: str  # NumPy type of one number: "<f8"
    shape: tuple[int, ...]  # (): a scalar
    unit: str  # "rad", "rad/s", "N·m", "ns"; "": a count, a code, or a unit of the device
    offset: int  # offset in the row [bytes]
    per_axis: bool  # True if the field has one number for each axis of the layout


class RingPlace(msgspec.Struct, frozen=True):
    """Location of a ring in the segment."""

    offset: int  # [bytes]
    count: int  # number of rows
    size: int  # size of a row [bytes]


class ShareLayout(msgspec.Struct, frozen=True):
    """Description of the data that one run of a loop shares."""

    name: str
    version: int
    run: str  # unique identifier of this run of a loop
    period: float  # [s]
    axes: tuple[str, ...]  # names, in the order of the per-axis fields
    fields: tuple[ShareField, ...]
    clock: Clock  # clock of scheduled_ns and wake_ns
    utc_offset_ns: int  # UTC minus that clock
    opened: float  # time at which the share was opened, UTC [s]
    writer: Process
    rows: RingPlace
    events: RingPlace
    jog: bool = False  # True if the core accepts jogs
    modes: tuple[Choice, ...] = ()  # operating modes of the program
    presets: tuple[Choice, ...] = ()  # presets of the program

    @property
    def mode_offset(self) -> int:
        """Offset of the byte with the number of the operating mode [bytes]."""
        return self.events.offset + _rows.memory_size(self.events.count, self.events.size)

    @property
    def dtype(self) -> np.dtype[np.void]:
        """NumPy type of the record of a cycle."""
        return np.dtype(
            {
                "names": [field.name for field in self.fields],
                "formats": [(field.dtype, field.shape) for field in self.fields],
                "offsets": [field.offset for field in self.fields],
                "itemsize": self.rows.size,
            }
        )

    @property
    def size(self) -> int:
        """Size of the segment [bytes]."""
        return self.mode_offset + (1 if self.modes else 0)


def make_layout(
    name: str,
    sink: SinkLayout,
    *,
    history: float,
    opened: float,
    writer: Process,
    jog: bool = False,
    operation: Operation | None = None,
) -> ShareLayout:
    """Return the layout of a segment for a loop.

    Args:
        name: name of the share.
        sink: description of the data of the loop.
        history: time span of the cycles that the ring keeps [s].
        opened: time at which the share was opened, UTC [s].
        writer: process of the loop.
        jog: True if the core accepts jogs.
        operation: operating modes and presets; None: none.
    """
    offered = operation or Operation()
    blocks = (sink.record_size, sink.actual_size, sink.target_size)
    *starts, row_size = _rows.row_parts(*blocks)
    places = dict(zip(("record", "actual", "target"), starts, strict=True))
    run = uuid.uuid4().hex
    count = power_of_two(max(round(history / sink.period), ROWS_MIN))

    def made(description: int) -> ShareLayout:
        rows_at = aligned(HEADER.size + description)
        events_at = aligned(rows_at + _rows.memory_size(count, row_size))
        return ShareLayout(
            name=name,
            version=VERSION,
            run=run,
            period=sink.period,
            axes=sink.axes,
            fields=tuple(make_field(each, places[each.block]) for each in sink.fields),
            clock="virtual" if sink.virtual_time else "monotonic",
            utc_offset_ns=sink.utc_offset_ns,
            opened=opened,
            writer=writer,
            rows=RingPlace(rows_at, count, row_size),
            events=RingPlace(events_at, EVENT_COUNT, EVENT_SIZE),
            jog=jog,
            modes=offered.modes,
            presets=offered.presets,
        )

    return made(len(msgspec.json.encode(made(0))) + ALIGNMENT)


def decode_mode(memory: mmap.mmap, layout: ShareLayout) -> str | None:
    """Return the operating mode in a segment; None if the program has set none.

    Args:
        memory: memory of the segment.
        layout: layout of the segment.

    Raises:
        ShareError: the number of the mode is invalid.
    """
    number = memory[layout.mode_offset] if layout.modes else NO_MODE
    if number > len(layout.modes):
        raise ShareError(
            f"the share {layout.name!r} is damaged: mode {number} of {len(layout.modes)}"
        )
    return None if number == NO_MODE else layout.modes[number - 1].name


def make_field(field: SinkField, start: int) -> ShareField:
    """Return the description of a field whose block begins at byte `start` of the row."""
    shape = () if field.count is None else (field.count,)
    return ShareField(
        field.name, field.format, shape, field.unit, start + field.offset, field.per_axis
    )


def aligned(offset: int) -> int:
    return -(-offset // ALIGNMENT) * ALIGNMENT


def power_of_two(least: int) -> int:
    return 1 << (least - 1).bit_length()


def encode_head(layout: ShareLayout) -> bytes:
    """Return the first bytes of a segment: the header and the description."""
    description = msgspec.json.encode(layout)
    return HEADER.pack(MAGIC, layout.version, len(description), layout.size) + description


def decode_head(memory: mmap.mmap | bytes, size: int) -> ShareLayout:
    """Return the layout of a segment of `size` bytes.

    Raises ShareError if the segment is not a share, is damaged, or has another version.
    """
    head = memory[: HEADER.size]
    if len(head) < HEADER.size or not head.startswith(MAGIC):
        raise ShareError("not a Catenary share (bad magic number)")
    _, version, length, whole = HEADER.unpack(head)
    if version != VERSION:
        raise ShareError(
            f"its layout has version {version}, but this program reads version {VERSION}",
            hint="use the same release of Catenary in both programs",
        )
    if whole > size or HEADER.size + length > size:
        raise ShareError(f"it is truncated to {size} of {whole} bytes")
    try:
        layout = msgspec.json.decode(memory[HEADER.size : HEADER.size + length], type=ShareLayout)
        fits = layout.size <= size and layout.dtype.itemsize == layout.rows.size
        plain = {np.dtype(field.dtype).kind for field in layout.fields} <= NUMBERS
    except DAMAGE as error:
        raise ShareError(f"its description is invalid: {error}") from error
    if not fits:
        raise ShareError("its description does not match its size")
    if not plain or not 0.0 < layout.period < math.inf:
        raise ShareError(
            "its description is invalid: a field is not numeric, or the period is not positive"
        )
    return layout
