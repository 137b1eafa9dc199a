"""Checks of `Drives.probe` before a probe is armed."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.drive.probe_port import ProbePort, ProbeRequest
from catenary.drive.touch_probe import EDGES, PROBES, SOURCE_BITS, TouchProbe
from catenary.errors import DriveError

CODES = range(-(1 << 15), 1 << 15)  # of 0x60D0


def chosen_axis(axis: int | None, names: Sequence[str]) -> int:
    """Return the number of the axis of a probe.

    Args:
        axis: number of the axis; None for the only one.
        names: names of the axes.

    Raises:
        ValueError: `axis` is None, and there are several axes.
        IndexError: The axis does not exist.
    """
    known = ", ".join(f"{i}: {name}" for i, name in enumerate(names))
    if axis is None and len(names) > 1:
        raise ValueError(f"probe() needs axis=, because there are several: {known}")
    chosen = 0 if axis is None else axis
    if not 0 <= chosen < len(names):
        raise IndexError(f"axis={axis!r}: no such axis; the axes are {known}")
    return chosen


def probe_request(
    option: TouchProbe | None, number: int, edge: str, source: str | int, continuous: bool
) -> ProbeRequest:
    """Return the settings of a probe.

    Raises:
        ValueError: The drives were made without this probe or edge, or an argument is not valid.
    """
    if option is None:
        raise ValueError("drives without touch probes: make them with Drives(touch_probe=True)")
    if number not in PROBES:
        raise ValueError(f"probe {number!r} does not exist; the probes of a drive are 1 and 2")
    edges = EDGES if edge == "both" else (edge,)
    if not set(edges) <= set(EDGES):
        raise ValueError(f"edge={edge!r}: must be 'rising', 'falling' or 'both'")
    if number not in option.probes or not set(edges) <= set(option.edges):
        probes = tuple(sorted({*option.probes, number}))
        both = tuple(each for each in EDGES if each in option.edges or each in edges)
        raise ValueError(
            f"the {' and '.join(edges)} edge of probe {number} is not exchanged; write "
            f"Drives(touch_probe=TouchProbe(probes={probes!r}, edges={both!r}))"
        )
    known = source in SOURCE_BITS if isinstance(source, str) else source in CODES
    if not known or isinstance(source, bool):
        names = ", ".join(map(repr, SOURCE_BITS))
        raise ValueError(f"source={source!r}: must be {names}, or a code for 0x60D0")
    return ProbeRequest(number, edges, source, continuous, option.toggles)


def check_probe(port: ProbePort, request: ProbeRequest) -> None:
    """Raise an error if a probe cannot be armed now.

    Args:
        port: interface to the probe.
        request: its settings.

    Raises:
        ValueError: The position of an edge is not in the process data.
        DriveError: A law or a stream sets the outputs.
    """
    for edge in request.edges:
        if port.lacks(edge):
            index = 0x60BA + 2 * (request.number - 1) + EDGES.index(edge)
            raise ValueError(
                f"{port.name}: the position of the {edge} edge of probe {request.number} "
                f"(0x{index:04X}) is not in the process data of all drives: a drive does not have "
                "the object, or pdos= does not contain it; use another edge or probe, or add the "
                "object to pdos="
            )
    if port.is_led:
        raise DriveError(
            f"{port.name}: a law or a stream sets the outputs, so 0x60B8 cannot be written",
            hint="end it first: stop() of the run that loop.start() returned, or stream.close()",
        )
