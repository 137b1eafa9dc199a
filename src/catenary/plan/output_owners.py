"""Owners of the output bytes: each byte belongs to one request.

Two requests that write the same byte are an error. An object that the core writes for an axis
cannot also be a column, because the column would bypass enabling and all limits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, Direction
from catenary.plan.cycle import AxisPlan, Number
from catenary.plan.layout import Layout
from catenary.plan.request import ProcessDataRequest, RequestTables

AXIS_OUTPUTS = (
    *("controlword", "mode_target", "target_position", "target_velocity", "target_torque"),
    "velocity_offset",
)
SHARED = "velocity_offset"  # a column of the application; the core writes it during a fallback


class Owned(NamedTuple):
    """Bytes of the image of outputs that a request writes."""

    request: int  # rank of the request
    what: str
    bytes: range
    by_axis: bool = False  # True if the core writes them for an axis


def check_owners(
    devices: Sequence[DeviceDescription],
    requests: Sequence[ProcessDataRequest],
    tables: Sequence[RequestTables],
    layout: Layout,
) -> None:
    """Check that no byte of the outputs is written by two requests, or by an axis and a column.

    An axis and a column of one request may share the velocity offset.

    Raises:
        ConfigurationError: A byte has two writers. The error names them.
    """
    owners: dict[int, Owned] = {}
    for rank, table in enumerate(tables):
        for owned in _owned(rank, table):
            for byte in owned.bytes:
                other = owners.setdefault(byte, owned)
                if other.request != rank:
                    raise _conflict(devices, requests, layout, other, owned, byte)
                if other.by_axis and not owned.by_axis and other.what != SHARED:
                    raise _column_of_axis(requests, other, owned)


def _owned(rank: int, table: RequestTables) -> Iterator[Owned]:
    for axis in table.axes:
        for name, number in _axis_outputs(axis):
            yield Owned(rank, name, _bytes(number), by_axis=True)
    for column in table.output_columns:
        yield Owned(rank, column.name, _bytes(column.number))
    for area in table.output_areas:
        yield Owned(rank, "", range(area.image_offset, area.image_offset + area.size))
    for copy in table.copies:
        yield Owned(rank, f"copy {copy.name}", _byte_range(copy.output_bit, copy.bit_length))


def _axis_outputs(axis: AxisPlan) -> Iterator[tuple[str, Number]]:
    for name in AXIS_OUTPUTS:
        number: Number | None = getattr(axis, name)
        if number is not None:
            yield name, number


def _bytes(number: Number) -> range:
    return _byte_range(number.bit_offset, number.bit_length)


def _byte_range(bit: int, length: int) -> range:
    """Return the bytes that contain some bits."""
    return range(bit // 8, (bit + length - 1) // 8 + 1)


def _column_of_axis(
    requests: Sequence[ProcessDataRequest], axis: Owned, column: Owned
) -> ConfigurationError:
    return ConfigurationError(
        f"{requests[axis.request]!r}: column {column.what!r} would overwrite {axis.what}, which "
        "Catenary writes for the axis",
        hint="write target.position, velocity, torque or mode instead; these respect the limits "
        "and the enabling sequence",
    )


def _conflict(
    devices: Sequence[DeviceDescription],
    requests: Sequence[ProcessDataRequest],
    layout: Layout,
    first: Owned,
    second: Owned,
    byte: int,
) -> ConfigurationError:
    places = (layout.byte_range(device.position, Direction.OUTPUT) for device in devices)
    [(device, start)] = [
        (device, place.start)
        for device, place in zip(devices, places, strict=True)
        if byte in place
    ]
    writers = " and ".join(
        f"{requests[owned.request]!r}" + (f" ({owned.what})" if owned.what else "")
        for owned in (first, second)
    )
    return ConfigurationError(
        f"{device}: two requests write byte {byte - start} of its outputs: {writers}",
        hint="let one of them write it; ProcessData(sub, outputs={}) only reads, and "
        "Outputs(sub, channels=...) writes only the objects it names",
    )
