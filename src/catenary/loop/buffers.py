"""Private buffers of the engine, divided into one view per process-data request."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields

import numpy as np

from catenary.plan.cycle import Bank
from catenary.plan.request import Mover, ProcessDataRequest, RequestTables, Views

COLUMN_BUFFERS: dict[tuple[bool, Bank], str] = {
    (False, Bank.REAL): "input_reals",
    (False, Bank.INTEGER): "input_integers",
    (False, Bank.BIT): "input_bits",
    (True, Bank.REAL): "output_reals",
    (True, Bank.INTEGER): "output_integers",
    (True, Bank.BIT): "output_bits",
}
PART_BUFFERS = (*COLUMN_BUFFERS.values(), "input_bytes", "output_bytes")
OTHERS = (*PART_BUFFERS, "unit_valid", "movers", "is_open", "is_led", "system_time")
AXIS_BUFFERS = tuple(each.name for each in fields(Views) if each.name not in OTHERS)


def bind_requests(
    requests: Sequence[ProcessDataRequest],
    tables: Sequence[RequestTables],
    buffers: Mapping[str, memoryview],
    is_open: Callable[[], bool],
    is_led: Callable[[], bool] = lambda: False,
    system_time: Callable[[], int | None] = lambda: None,
) -> Views:
    """Bind every request to its part of the buffers, in the order of the plan.

    Args:
        requests: Process-data requests.
        tables: Tables of the plan, one per request.
        buffers: Private buffers of the engine by name.
        is_open: Returns True while the loop runs.
        is_led: Returns True while a law or a stream sets the targets.
        system_time: Returns the system time at the start of the present cycle [ns]; None without
            distributed clocks.

    Returns:
        Views of the whole buffers.
    """
    arrays = {name: np.asarray(buffers[name]) for name in (*AXIS_BUFFERS, *PART_BUFFERS)}
    unit_valid = np.asarray(buffers["unit_valid"])
    movers: list[Mover] = []
    used = dict.fromkeys(("axes", *PART_BUFFERS), 0)
    for request, table in zip(requests, tables, strict=True):
        sizes = dict.fromkeys(AXIS_BUFFERS, len(table.axes)) | part_sizes(table)
        starts = {name: used.get(name, used["axes"]) for name in sizes}
        parts = {name: arrays[name][starts[name] :][: sizes[name]] for name in sizes}
        request.bind(
            Views(
                **parts,
                unit_valid=unit_valid,
                movers=movers,
                is_open=is_open,
                is_led=is_led,
                system_time=system_time,
            )
        )
        used["axes"] += len(table.axes)
        for name in PART_BUFFERS:
            used[name] += sizes[name]
    return Views(
        **arrays,
        unit_valid=unit_valid,
        movers=movers,
        is_open=is_open,
        is_led=is_led,
        system_time=system_time,
    )


def part_sizes(table: RequestTables) -> dict[str, int]:
    """Return the size of each part of a request: columns of a bank, or bytes of all areas."""
    sizes = dict.fromkeys(PART_BUFFERS, 0)
    for output, columns in ((False, table.input_columns), (True, table.output_columns)):
        for column in columns:
            sizes[COLUMN_BUFFERS[output, column.bank]] += 1
    sizes["input_bytes"] = sum(area.size for area in table.input_areas)
    sizes["output_bytes"] = sum(area.size for area in table.output_areas)
    return sizes
