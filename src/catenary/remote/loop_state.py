"""Methods about the loop: identity, axes, timing, clocks, plan and events."""

from __future__ import annotations

import math

from catenary.loop.timing import verdict
from catenary.plan.cycle import AxisPlan
from catenary.remote import messages
from catenary.remote.advice import advice_for
from catenary.remote.program import Program, Work
from catenary.target import segment_of

BUCKETS = 128  # of a histogram in a message
QUANTILES = {"median": "p50", "p99": "p99", "p999": "p999", "max": "max"}


def hello(program: Program) -> messages.Hello:
    """Return the identity of the program, and what it allows."""
    layout, session = program.share.layout, program.network.session
    return messages.Hello(
        version=program.version,
        pid=layout.writer.pid,
        program=layout.writer.command,
        share=layout.name,
        period=layout.period,
        networks=program.network.count,
        jog=layout.jog,
        virtual=segment_of(program.network.main.source) is not None,
        started=layout.opened,
        execution=session.plan.cycle.execution,
        background=session.in_background,
    )


def axes(program: Program) -> list[messages.Axis]:
    """Return the axes of the loop, in the order of the share."""
    network = program.network
    return [_axis(axis, network.number) for axis in network.plan.cycle.axes]


def _axis(axis: AxisPlan, network: int) -> messages.Axis:
    return messages.Axis(
        name=axis.name,
        network=network,
        device=axis.device,
        unit="m" if axis.linear else "rad",
        mode=axis.mode,
        position_min=finite(axis.limits.position_min),
        position_max=finite(axis.limits.position_max),
        velocity_limit=finite(axis.limits.velocity),
        torque_limit=finite(axis.limits.torque),
        acceleration=finite(axis.acceleration),
        deceleration=finite(axis.deceleration),
    )


def finite(value: float | None) -> float | None:
    """Return the value; None if it is infinite or NaN, which JSON cannot represent."""
    return value if value is not None and math.isfinite(value) else None


def timing(program: Program, histograms: bool = False) -> Work[messages.Timing]:
    """Return the timing of the loop since it was opened; see `Client.timing`."""
    found = program.network.timing
    yield None
    figures = {
        phase: messages.Figures(
            **{ours: of[theirs] for ours, theirs in QUANTILES.items()}, count=int(of["count"])
        )
        for phase, of in found.items()
    }
    counted: dict[str, list[tuple[float, float, int]]] = {}
    for phase in figures if histograms else ():
        yield None
        counted[phase] = merged(program.network.histogram(phase))
    return messages.Timing(
        figures=figures,
        counters=found.counters,
        verdict=list(verdict(found)),
        scheduling=found.scheduling,
        histograms=counted,
    )


def merged(buckets: list[tuple[float, float, int]]) -> list[tuple[float, float, int]]:
    """Return a histogram of at most BUCKETS buckets; merge neighbours if there are more."""
    size = -(-len(buckets) // BUCKETS) or 1
    groups = [buckets[at : at + size] for at in range(0, len(buckets), size)]
    return [(group[0][0], group[-1][1], sum(each[2] for each in group)) for group in groups]


def clocks(program: Program) -> messages.Clocks:
    """Return the differences of the distributed clocks from the reference clock."""
    found = program.network.session.clocks
    if found is None:
        return messages.Clocks(clocks=[], locked=False, text="")
    subs, reference = program.network.main.subs, found.reference
    entries = {reference.position: 0.0, **found.differences}
    return messages.Clocks(
        clocks=[
            messages.ClockEntry(
                position=position,
                name=subs[position].name,
                reference=position == reference.position,
                difference=finite(difference),
            )
            for position, difference in sorted(entries.items())
        ],
        locked=found.locked,
        text=str(found),
    )


def plan(program: Program) -> messages.Text:
    """Return the plan of the loop as text."""
    return messages.Text(text=program.plan_text)


def events(program: Program, after: int = 0) -> Work[messages.Events]:
    """Return the events after serial number `after`, oldest first, with advice."""
    found, lost = program.events(after)
    entries: list[messages.EventEntry] = []
    for each in found:
        entries.append(
            messages.EventEntry(
                serial=each.serial,
                number=each.number,
                kind=each.kind,
                message=each.message,
                time=each.time,
                position=each.position,
                details=dict(each.details),
                advice=advice_for(each),
            )
        )
        yield None
    return messages.Events(events=entries, lost=lost)
