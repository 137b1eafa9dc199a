"""Diagnosis of the whole segment: error counters, silent devices, AL errors, and their causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from catenary.bus.sub_device import SubDevice
from catenary.errors import DecodeError
from catenary.model.break_location import judge_silence
from catenary.model.diagnosis import Observation, judge
from catenary.model.finding import Finding, Kind, Names
from catenary.model.topology import Topology, make_topology
from catenary.procedure.al_status_poll import Answer, survey
from catenary.procedure.error_counters import counted_since, read_error_counters
from catenary.procedure.exchange import Procedure
from catenary.wire.al import ERROR_FLAG, AlStatus, status_code
from catenary.wire.error_counters import ErrorCounters


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of a diagnosis. `str()` returns it as text.

    `counters` holds the counts in the judged time span, by position; None for a silent device.
    `totals` holds the counts since power-up.
    """

    findings: tuple[Finding, ...]
    counters: tuple[ErrorCounters | None, ...]
    totals: tuple[ErrorCounters | None, ...]
    topology: Topology
    names: Names

    def __str__(self) -> str:
        if not self.findings:
            return f"no faults found in {len(self.topology)} devices"
        return "\n".join(map(str, self.findings))

    def __bool__(self) -> bool:
        """Return True if a fault was found."""
        return bool(self.findings)


def diagnose(
    subs: Sequence[SubDevice],
    *,
    since: Diagnosis | None = None,
    lost_frames: int = 0,
    ring: bool = False,
) -> Procedure[Diagnosis]:
    """Read the error counters and states of all devices in shared frames, and locate faults.

    A missing reply is not an error.

    Args:
        subs: Devices to read.
        since: Earlier diagnosis to count from. The counts are from power-up if this is None or has
            another number of devices, and for devices that were silent then.
        lost_frames: Number of frames lost or damaged in the same time span.
        ring: True if the segment is a ring.
    """
    stations = [sub.station for sub in subs]
    totals = yield from read_error_counters(stations)
    answers = yield from survey(stations)
    topology = make_topology([sub.description.open_ports for sub in subs], ring=ring)
    names = Names(tuple(sub.description.full_name for sub in subs))
    counters, restarted = totals, frozenset[int]()
    if since is not None and len(since.totals) == len(totals):
        counters, restarted = counted_since(totals, since.totals)
    seen = Observation(topology, names, counters, restarted, lost_frames)
    silent = [answer.station.position for answer in answers if answer.word is None]
    findings = (
        *judge_silence(topology, names, silent),
        *judge(seen),
        *_wiring(topology),
        *_state_errors(names, answers),
    )
    return Diagnosis(findings, counters, totals, topology, names)


def _wiring(topology: Topology) -> list[Finding]:
    return [
        Finding(Kind.WIRING, "the wiring", text, "catenary graph shows the tree that was found")
        for text in topology.contradictions
    ]


def _state_errors(names: Names, answers: Sequence[Answer]) -> list[Finding]:
    """Return a finding for each device whose AL status has the error flag."""
    found = []
    for answer in answers:
        if answer.word is None or not answer.word & ERROR_FLAG:
            continue
        position, code = answer.station.position, status_code(answer.code)
        try:
            state = str(AlStatus.from_word(answer.word).state)
        except DecodeError:
            state = f"state {answer.word & 0xF}"
        evidence = f"in {state} with an error, AL status code 0x{answer.code:04X}: {code.text}"
        advice = code.cause or "see its manual"
        found.append(Finding(Kind.DEVICE, names.device(position), evidence, advice, (position,)))
    return found
