"""Publishing of a loop to a sink: the blocks of the core with names and units, and the events."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from itertools import groupby

import numpy as np

from catenary.bus import MainDevice
from catenary.bus.event_types import Event
from catenary.core import RECORD_FIELDS, Engine
from catenary.plan.cycle import Bank, Column, ImageArea
from catenary.plan.planner import Plan
from catenary.plan.sink import Block, Incident, Sink, SinkField, SinkLayout

Places = dict[str, tuple[int, str, int | None]]  # name → offset, format, count

BANKS = {Bank.REAL: "reals", Bank.INTEGER: "integers", Bank.BIT: "bits"}
LEFT_OUT = ("reserved", "bytes", *BANKS.values())
PER_UNIT = ("unit_valid",)
UNITS = {"position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "torque": ("N·m", "N")}
EVENT_FIELDS = {field.name for field in fields(Event)}


class Publisher:
    """Connection of a loop to its sink, from `open` to `close`."""

    def __init__(self, sink: Sink, main: MainDevice, engine: Engine, plan: Plan) -> None:
        self._sink = sink
        self._engine = engine
        self._main = main
        self._ended = False
        capsule = sink.open(sink_layout(engine, plan))
        try:
            engine.set_sink(capsule)
        except BaseException:
            sink.close()
            raise
        self._forget: Callable[[], None] = main.events.listen(self._on_event)

    def report_end(self, error: BaseException) -> None:
        """Publish the error that ends the loop."""
        self._report(type(error).__name__, str(error), self._engine.now() * 1e-9, None, {})

    def close(self) -> None:
        """Close the sink. Call this after the engine has stopped."""
        if self._ended:
            return
        self._ended = True
        self._forget()
        self._engine.set_sink(None)
        self._sink.close()

    def _on_event(self, event: Event) -> None:
        position = None if event.sub is None else event.sub.position
        details = {
            field.name: plain(getattr(event, field.name))
            for field in fields(event)
            if field.name not in EVENT_FIELDS
        }
        self._report(type(event).__name__, event.message, event.time, position, details)

    def _report(
        self,
        kind: str,
        message: str,
        when: float,
        position: int | None,
        details: dict[str, object],
    ) -> None:
        self._sink.report(Incident(kind, message, when, position, details))


def plain(value: object) -> object:
    """Return a value that JSON can represent. Numbers and texts are unchanged."""
    if isinstance(value, bytes):
        return value.hex(" ")
    if isinstance(value, tuple):
        return [plain(each) for each in value]
    return value if isinstance(value, (int, float, str, type(None))) else str(value)


def sink_layout(engine: Engine, plan: Plan) -> SinkLayout:
    """Return the layout of the data that the loop publishes in every cycle.

    Args:
        engine: Engine with the blocks.
        plan: Plan of the loop.
    """
    actual, target = engine.sink_fields()
    kinds = sorted({axis.linear for axis in plan.cycle.axes})  # linear axes after rotary ones
    own = [
        *of_record(),
        *of_block("actual", actual, kinds),
        *of_block("target", target, kinds),
    ]
    taken = {each.name for each in own}
    columns = [
        *columns_of("actual", actual, (table.input_columns for table in plan.tables)),
        *columns_of("target", target, (table.output_columns for table in plan.tables)),
        *areas_of("actual", "input_bytes", actual, plan.cycle.input_areas),
        *areas_of("target", "output_bytes", target, plan.cycle.output_areas),
    ]
    record_size, actual_size, target_size = engine.sink_sizes
    return SinkLayout(
        period=plan.cycle.period_ns * 1e-9,
        axes=tuple(axis.name for axis in plan.cycle.axes),
        fields=(*own, *with_own_names(columns, taken)),
        record_size=record_size,
        actual_size=actual_size,
        target_size=target_size,
        utc_offset_ns=time.time_ns() - engine.now(),
        virtual_time=engine.scheduling == "virtual time",
    )


def of_record() -> Iterator[SinkField]:
    """Yield the times and flags of the cycle."""
    places = np.dtype(RECORD_FIELDS).fields
    assert places is not None
    for name, (kind, offset, *_) in places.items():
        if name not in LEFT_OUT:
            yield SinkField(name, "record", offset, kind.str, None, unit_of(name))


def of_block(block: Block, places: Places, kinds: Sequence[bool] = ()) -> Iterator[SinkField]:
    """Yield the fields that every loop has; empty arrays are omitted.

    Args:
        block: Block of the core.
        places: Fields of the block by name.
        kinds: Kinds of axes: see `unit_of`.
    """
    for name, (offset, code, count) in places.items():
        if name in LEFT_OUT or count == 0:
            continue
        per_axis = count is not None and name not in PER_UNIT
        yield SinkField(name, block, offset, code, count, unit_of(name, kinds), per_axis)


def unit_of(name: str, kinds: Sequence[bool] = ()) -> str:
    """Return the unit of a field. For a position: "rad", "m", or "rad or m" for both kinds.

    Empty if the field has no unit.

    Args:
        name: Name of the field.
        kinds: Kinds of axes of the loop; True: linear.
    """
    if name.endswith("_ns"):
        return "ns"
    units = UNITS.get(name.rpartition("_")[2])
    return "" if units is None else " or ".join(units[kind] for kind in kinds or (False,))


def columns_of(
    block: Block, places: Places, columns: Iterable[Sequence[Column]]
) -> Iterator[tuple[SinkField, int]]:
    """Yield every column and its device: a group as one array, a single column as a number.

    Args:
        block: Block of the core.
        places: Fields of the block by name.
        columns: Columns of each request.
    """
    used = dict.fromkeys(Bank, 0)
    for of_request in columns:
        for (group, bank), members in groupby(of_request, key=lambda c: (c.group, c.bank)):
            here = list(members)
            for part in [here] if group else [[column] for column in here]:
                start, code, _ = places[BANKS[bank]]
                offset = start + used[bank] * np.dtype(code).itemsize
                used[bank] += len(part)
                name, count = (group, len(part)) if group else (part[0].name, None)
                yield SinkField(name, block, offset, code, count), part[0].device


def areas_of(
    block: Block, name: str, places: Places, areas: Iterable[ImageArea]
) -> Iterator[tuple[SinkField, int]]:
    """Yield the bytes of each area as one array, and its device.

    Args:
        block: Block of the core.
        name: Name of the field, unless an area has its own.
        places: Fields of the block by name.
        areas: Areas of the block.
    """
    offset, code, _ = places["bytes"]
    for area in areas:
        yield SinkField(area.field or name, block, offset, code, area.size), area.device
        offset += area.size


def with_own_names(
    columns: Sequence[tuple[SinkField, int]], taken: set[str]
) -> Iterator[SinkField]:
    """Yield the columns with unique names.

    A name that is not unique gets the suffix " of device N", and a number if that is not enough.

    Args:
        columns: Columns and their devices.
        taken: Names in use. The yielded names are added to it.
    """
    often = Counter(each.name for each, _ in columns)
    for each, device in columns:
        name = each.name
        if often[name] > 1 or name in taken:
            name = f"{name} of device {device}"
        base, more = name, 2
        while name in taken:
            name, more = f"{base} ({more})", more + 1
        taken.add(name)
        yield SinkField(name, each.block, each.offset, each.format, each.count)


def one_sink_each(sinks: Sink | Sequence[Sink] | None, networks: int) -> list[Sink | None]:
    """Return the sink of every network.

    Args:
        sinks: One sink, or one for each network; None: no sinks.
        networks: Number of networks.

    Raises:
        ValueError: The number of sinks is not the number of networks.
    """
    if sinks is None:
        return [None] * networks
    given = list(sinks) if isinstance(sinks, Sequence) else [sinks]
    if len(given) != networks:
        raise ValueError(
            f"sink: {len(given)} given for {networks} networks; give each network its own: "
            "sink=[cat.Share('upper'), cat.Share('lower')]"
        )
    return list(given)
