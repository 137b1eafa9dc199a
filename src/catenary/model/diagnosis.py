"""From error counters to the cable or device at fault. Pure.

A controller that receives a broken frame counts it as an invalid frame of that port and marks it;
the devices behind then only count it as forwarded. So the fault lies on the way to the port that
has invalid frames: between it and its neighbour. Symbol errors are noise on that cable, also where
no frame was hit. Lost links are counted at both ends of a cable that was pulled, but only at the
neighbours of a device that lost its power, whose own counters begin again.

Sources: Beckhoff, ESC data sheet I, §14 "Error counters" (which counter counts what, and that one
error shows in several); Beckhoff, application note "ESC FAQ", §3.12.4 "Error counter interpretation
guide", figure 2 and table 1, whose cases are named where they are used; Beckhoff Infosys, EtherCAT
system documentation, "Error counters of the slaves".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from catenary.model.finding import Finding, Kind, Names
from catenary.model.topology import Cable, Topology
from catenary.wire.error_counters import FULL, ErrorCounters, PortErrors

WIDESPREAD = 3  # cables with noise, and at least half of all: no cable is to blame for that

_CABLE = "look at its plugs, bends and shield, and how near power cables are; exchange it"
_DEVICE = "exchange it; before that its supply, its earth and the plugs on both of its sides"
_POWER = (
    "look for a weak supply or a loose supply terminal; a cable of which one pair is broken looks "
    "much the same"
)
_EVERYWHERE = (
    "look for what all share: earthing and shields, cables beside those of motors and inverters, "
    "the supply"
)
_MAIN = (
    "no other program may use this network interface; then its driver, and ethtool -S for its own "
    "error counts"
)
_PDI = "the fault is inside: its firmware or the link between controller and processor; exchange it"
_NO_ERRORS = PortErrors()


@dataclass(frozen=True, slots=True)
class Observation:
    """What is to be judged: counts of one span of time, by position. None: nobody answered."""

    topology: Topology
    names: Names
    errors: tuple[ErrorCounters | None, ...]
    restarted: frozenset[int] = frozenset()  # devices whose counters began again
    lost_frames: int = 0  # that the MainDevice sent and did not get back whole

    def port(self, position: int | None, port: int | None) -> PortErrors:
        """What one end of a cable has counted; of the MainDevice nothing is known."""
        if position is None or port is None:
            return _NO_ERRORS
        errors = self.errors[position]
        return _NO_ERRORS if errors is None else errors.ports[port]

    def ends(self, cable: Cable) -> tuple[PortErrors, PortErrors]:
        """What both ends of a cable have counted, the upper one first."""
        return self.port(*cable[:2]), self.port(*cable[2:])


def judge(seen: Observation) -> tuple[Finding, ...]:
    """What is wrong, the likeliest cause of the most first. Empty: nothing is."""
    power, explained = _power(seen)
    explained |= _interrupted(seen)
    transport = [*power, *_links(seen, explained), *_noise(seen), *_stray_ports(seen)]
    transport = transport or [*_forwarded(seen), *_processing_units(seen)]
    transport = transport or [*_lost_frames(seen)]
    return (*transport, *_processors(seen))


# ---- links that went away


def _power(seen: Observation) -> tuple[list[Finding], set[Cable]]:
    """Devices whose neighbours all lost the link to them while they have counted none themselves:
    their counters began at 0 with their power. And the cables that this explains."""
    found: list[Finding] = []
    explained: set[Cable] = set()
    for position, errors in enumerate(seen.errors):
        cables = [cable for cable in seen.topology.cables if position in (cable.upper, cable.lower)]
        far = [_far_end(cable, position) for cable in cables]
        far = [end for end in far if end[0] is not None]
        lost = [end for end in far if seen.port(*end).lost_links]
        counted = errors is not None and any(port.lost_links for port in errors.ports)
        if errors is None or not lost or len(lost) < len(far):
            continue
        if counted and position not in seen.restarted:
            continue
        explained.update(cables)
        told = " and ".join(
            f"{seen.names.end(*end)} lost its link {_times(seen.port(*end).lost_links)}"
            for end in lost
        )
        where = f"the power of {seen.names.device(position)}"
        evidence = f"{told}, while it has counted none itself: its counters began again"
        found.append(Finding(Kind.POWER, where, evidence, _POWER, (position,)))
    return found, explained


def _interrupted(seen: Observation) -> set[Cable]:
    """The cables of devices that do not answer: of those `judge_silence` tells."""
    silent = {position for position, errors in enumerate(seen.errors) if errors is None}
    return {cable for cable in seen.topology.cables if silent & {cable.upper, cable.lower}}


def _far_end(cable: Cable, position: int) -> tuple[int | None, int | None]:
    return cable[:2] if cable.lower == position else cable[2:]


def _links(seen: Observation, explained: set[Cable]) -> Iterator[Finding]:
    """Cables whose link went away: cases 10 and 11 of the guide."""
    for cable in seen.topology.cables:
        ends = seen.ends(cable)
        if cable in explained or not any(end.lost_links for end in ends):
            continue
        yield _cable_finding(seen, cable)


# ---- frames broken on the way


def _noisy(seen: Observation, cable: Cable) -> int:
    return sum(end.invalid_frames + end.symbol_errors for end in seen.ends(cable))


def _noise(seen: Observation) -> Iterator[Finding]:
    """Cables on which frames broke: cases 7 to 10, 12 and 16. All of them: something shared. All
    of one device, and no other: that device."""
    noisy = [
        cable
        for cable in seen.topology.cables
        if _noisy(seen, cable) and not any(end.lost_links for end in seen.ends(cable))
    ]
    noisy.sort(key=lambda cable: -_noisy(seen, cable))
    if len(noisy) >= WIDESPREAD and 2 * len(noisy) >= len(seen.topology.cables):
        worst = seen.names.cable(noisy[0])
        evidence = (
            f"{len(noisy)} of {len(seen.topology.cables)} cables have broken frames or symbol "
            f"errors; the worst is {worst} with {_noisy(seen, noisy[0])}"
        )
        devices = tuple(sorted(cable.lower for cable in noisy))
        yield Finding(Kind.EVERYWHERE, "the whole segment", evidence, _EVERYWHERE, devices)
        return
    culprit = _common_device(seen.topology, noisy)
    if culprit is not None:
        evidence = "all its cables are noisy and no other is: " + "; ".join(
            _counted(seen, cable) for cable in noisy
        )
        where = seen.names.device(culprit)
        yield Finding(Kind.DEVICE, where, evidence, _DEVICE, (culprit,))
        return
    yield from (_cable_finding(seen, cable) for cable in noisy)


def _common_device(topology: Topology, noisy: Sequence[Cable]) -> int | None:
    """The one device whose cables are exactly these, two at least."""
    if len(noisy) < 2:
        return None
    for position in range(len(topology)):
        own = {cable for cable in topology.cables if position in (cable.upper, cable.lower)}
        if own == set(noisy):
            return position
    return None


def _cable_finding(seen: Observation, cable: Cable) -> Finding:
    devices = tuple(end for end in (cable.upper, cable.lower) if end is not None)
    where = seen.names.cable(cable)
    return Finding(Kind.CABLE, where, _counted(seen, cable), _CABLE, devices, cable)


def _counted(seen: Observation, cable: Cable) -> str:
    """What each end of a cable has counted, in words."""
    upper, lower = seen.ends(cable)
    parts = []
    for end, count in ((cable[:2], upper), (cable[2:], lower)):
        if words := _words(count):
            parts.append(f"{words} at {seen.names.end(*end)}")
    return "; ".join(parts)


def _words(count: PortErrors) -> str:
    numbers = (
        (count.invalid_frames, "broken frame"),
        (count.symbol_errors, "symbol error"),
        (count.lost_links, "lost link"),
    )
    return ", ".join(counted(number, what) for number, what in numbers if number)


def _stray_ports(seen: Observation) -> Iterator[Finding]:
    """Ports that count, and no device is behind them: a ring's second end, or something that is no
    EtherCAT device."""
    wired = {end for cable in seen.topology.cables for end in (cable[:2], cable[2:])}
    for position, errors in enumerate(seen.errors):
        for port, count in enumerate(errors.ports if errors is not None else ()):
            noisy = count.invalid_frames or count.symbol_errors or count.lost_links
            if not noisy or (position, port) in wired:
                continue
            second = (position, port) == seen.topology.second_end
            behind = (
                "the MainDevice's second interface" if second else "what is no device that answers"
            )
            end = seen.names.end(position, port)
            where = f"the cable between {end} and {behind}"
            evidence = f"{_words(count)} at {end}"
            yield Finding(Kind.CABLE, where, evidence, _CABLE, (position,))


# ---- what nobody owns up to


def _forwarded(seen: Observation) -> Iterator[Finding]:
    """Frames marked as broken by a device that has not counted them (it may lack the counter): the
    fault is before the device in front of the first that sees the mark. Cases 13 to 15."""
    path = seen.topology.path()
    first = next((at for at in path if seen.port(*at).forwarded), None)
    if first is None:
        return
    evidence = (
        f"{counted(seen.port(*first).forwarded, 'frame')} arrived at {seen.names.end(*first)} "
        "marked as broken, and no device has counted where they broke"
    )
    rank = path.index(first)
    if rank == 0:
        yield Finding(Kind.MAIN, "the MainDevice's side", evidence, _MAIN)
        return
    cable = seen.topology.cable_at(*path[rank - 1])
    if cable is not None:
        devices = tuple(end for end in (cable.upper, cable.lower) if end is not None)
        where = f"{seen.names.cable(cable)}, or one before it"
        yield Finding(Kind.CABLE, where, evidence, _CABLE, devices, cable)


def _processing_units(seen: Observation) -> Iterator[Finding]:
    """Frames that arrived whole and are no EtherCAT frames: the MainDevice's, or another program's
    (cases 1 and 2). From a later device on: the device before it spoils them inside."""
    for position, errors in enumerate(seen.errors):
        if errors is None or not errors.processing_unit:
            continue
        if errors.ports[0].invalid_frames or errors.ports[0].forwarded:
            continue  # broken frames are counted here as well
        evidence = (
            f"{counted(errors.processing_unit, 'frame')} arrived whole at "
            f"{seen.names.device(position)}, but as no valid EtherCAT"
        )
        parent = seen.topology.places[position].parent
        if parent is None:
            yield Finding(Kind.MAIN, "the MainDevice's side", evidence, _MAIN)
        else:
            where = f"{seen.names.device(parent)} or {seen.names.device(position)}"
            yield Finding(Kind.DEVICE, where, evidence, _DEVICE, (parent, position))
        return


def _lost_frames(seen: Observation) -> Iterator[Finding]:
    """Frames that came back broken or not at all, and no device has counted one: they were lost
    behind the last port that counts, on the way back to the MainDevice. Cases 5 and 6."""
    if not seen.lost_frames or None in seen.errors:
        return
    evidence = (
        f"{counted(seen.lost_frames, 'frame')} did not come back whole, and no device has seen a "
        "broken one"
    )
    where = f"the way back from {seen.names.device(0)} to the MainDevice, its port or its driver"
    advice = f"the cable to the first device: {_CABLE}; {_MAIN}"
    yield Finding(Kind.MAIN, where, evidence, advice, (0,), seen.topology.cables[0])


# ---- inside a device


def _processors(seen: Observation) -> Iterator[Finding]:
    for position, errors in enumerate(seen.errors):
        if errors is not None and errors.pdi:
            evidence = f"{counted(errors.pdi, 'error')} of the interface to its processor (PDI)"
            where = seen.names.device(position)
            yield Finding(Kind.DEVICE, where, evidence, _PDI, (position,))


def counted(count: int, what: str) -> str:
    """The count in words. A counter stops at 255."""
    if count == 1:
        return f"1 {what}"
    return f"{count} {what}s" if count < FULL else f"{FULL} or more {what}s"


def _times(count: int) -> str:
    return "once" if count == 1 else counted(count, "time")
