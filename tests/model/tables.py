"""Hand-written segments and tables of error counters."""

from __future__ import annotations

from catenary.model.diagnosis import Observation
from catenary.model.finding import Names
from catenary.model.topology import Ports, make_topology
from catenary.wire.error_counters import ErrorCounters, PortErrors

LINE: Ports = (True, True, False, False)
END: Ports = (True, False, False, False)
STAR: Ports = (True, True, True, True)
NOTHING = PortErrors()


def line(count: int) -> list[Ports]:
    return [LINE] * (count - 1) + [END]


def counted(
    *,
    processing_unit: int = 0,
    pdi: int = 0,
    p0: PortErrors = NOTHING,
    p1: PortErrors = NOTHING,
    p2: PortErrors = NOTHING,
    p3: PortErrors = NOTHING,
) -> ErrorCounters:
    return ErrorCounters((p0, p1, p2, p3), processing_unit, pdi)


def seen(
    ports: list[Ports],
    errors: dict[int, ErrorCounters],
    *,
    restarted: frozenset[int] = frozenset(),
    lost_frames: int = 0,
    ring: bool = False,
) -> Observation:
    topology = make_topology(ports, ring=ring)
    names = Names(tuple(f"d{n}" for n in range(len(ports))))
    clean = ErrorCounters()
    table = tuple(errors.get(n, clean) for n in range(len(ports)))
    return Observation(topology, names, table, restarted, lost_frames)
