"""Comparison of two captures of one segment: what each master did until OP.

Times, station addresses, logical addresses, propagation delays, clock offsets and the assignment
of the EEPROM differ from run to run. They are not compared, and neither are reads.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from catenary.capture.bring_up import BringUp, Outcome
from catenary.capture.compared_master import ComparedMaster, Side
from catenary.capture.device_pairs import out_of_place, pair_devices
from catenary.capture.difference import (
    DeviceComparison,
    DevicePair,
    Difference,
    Mark,
    Topic,
    level,
    mark_of,
    state_of,
)
from catenary.capture.events import UNKNOWN_STEP, Device
from catenary.capture.likely_cause import FirstDifference, find_first
from catenary.capture.object_diff import compare_objects
from catenary.capture.object_writes import objects_of
from catenary.capture.setting_diff import compare_settings
from catenary.capture.settings import settings_of
from catenary.capture.timeline import Timeline
from catenary.wire.al import AlState


@dataclass(frozen=True, slots=True)
class CaptureComparison:
    """All devices of two captures. `until` is the highest compared state."""

    a: Side
    b: Side
    devices: tuple[DeviceComparison, ...]
    until: AlState
    first: FirstDifference | None

    @property
    def equal(self) -> bool:
        """True if the comparison has 0 rows."""
        return not any(each.rows for each in self.devices)

    def count(self, mark: Mark, *, effect: bool | None = None) -> int:
        """Return the number of rows with a mark.

        Args:
            mark: The mark.
            effect: Count only rows with or without an effect; None counts both.
        """
        rows = (row for each in self.devices for row in each.rows)
        return sum(row.mark is mark and effect in (None, row.effect) for row in rows)


def compare(a: Timeline, b: Timeline) -> CaptureComparison:
    """Return the differences between the bring-ups in two captures.

    In a capture with several masters, the one with most devices is compared.

    Args:
        a: The first capture, for example of a master that works.
        b: The second capture.
    """
    left, right = ComparedMaster(a), ComparedMaster(b)
    pairs = pair_devices(left.devices, right.devices)
    devices = tuple(_device_rows(pairs, left, right))
    reached = [level(state) for state in (*left.states(), *right.states())]
    return CaptureComparison(
        left.side(),
        right.side(),
        devices,
        state_of(max(reached, default=0)),
        find_first(devices),
    )


def _device_rows(
    pairs: Sequence[DevicePair], a: ComparedMaster, b: ComparedMaster
) -> Iterator[DeviceComparison]:
    both = [pair for pair in pairs if pair.a and pair.b]
    ranks = {id(pair): place for place, pair in enumerate(both)}
    by_b = sorted(both, key=lambda pair: _position(pair.b))
    places = {id(pair): place for place, pair in enumerate(by_b)}
    moved = out_of_place([places[id(pair)] for pair in both])
    for pair in pairs:
        if pair.a is None or pair.b is None:
            yield DeviceComparison(pair, (_missing(pair),))
        else:
            is_moved = ranks[id(pair)] in moved
            yield _compare_device(pair, a.bring_up(pair.a), b.bring_up(pair.b), moved=is_moved)


def _compare_device(pair: DevicePair, a: BringUp, b: BringUp, *, moved: bool) -> DeviceComparison:
    limit = min(a.highest, b.highest)
    settings = settings_of(a.events, limit), settings_of(b.events, limit)
    objects = objects_of(a, limit), objects_of(b, limit)
    rows = [
        *_identity_rows(pair, moved=moved),
        *sorted(
            (
                *compare_objects(*objects),
                *compare_settings(*settings),
                *_results(a.outcomes, b.outcomes),
            ),
            key=_step_order,
        ),
    ]
    return DeviceComparison(
        pair, tuple(rows), len(settings[0]), len(objects[0].writes), a.error, b.error
    )


def _step_order(row: Difference) -> tuple[int, int, bool]:
    step = row.step
    return level(step.before), level(step.after), row.mark is Mark.RESULT


def _identity_rows(pair: DevicePair, *, moved: bool) -> Iterator[Difference]:
    a, b = pair.a, pair.b
    assert a is not None
    assert b is not None
    if moved:
        yield Difference(
            *(Mark.ORDER, Topic.DEVICE, "position", UNKNOWN_STEP),
            *(f"position {a.position}", f"position {b.position}"),
            effect=False,
        )
    for name, left, right in (
        ("revision", a.revision, b.revision),
        ("serial number", a.serial, b.serial),
    ):
        if left and right and left != right:
            yield Difference(
                *(Mark.DIFFERS, Topic.DEVICE, name, UNKNOWN_STEP),
                *(f"{name} 0x{left:08X}", f"{name} 0x{right:08X}"),
                effect=False,
                note="another device",
            )


def _missing(pair: DevicePair) -> Difference:
    a, b = (str(each) if each else "" for each in (pair.a, pair.b))
    mark = mark_of(pair.a, pair.b)
    return Difference(mark, Topic.DEVICE, "device", UNKNOWN_STEP, a, b)


def _results(a: Sequence[Outcome], b: Sequence[Outcome]) -> Iterator[Difference]:
    """Yield the transitions with different results. Later ones follow from the first."""
    for left, right in zip(a, b, strict=True):
        left_ends, right_ends = _ends(left, a), _ends(right, b)
        if _result(left, left_ends) == _result(right, right_ends):
            continue
        stops = [
            name
            for name, each, ends in (("A", left, left_ends), ("B", right, right_ends))
            if ends or each.error is not None
        ]
        yield Difference(
            *(Mark.RESULT, Topic.STATE, str(left.step.after), left.step),
            *(_text(left, left_ends), _text(right, right_ends)),
            note=_note(left, right, stops),
            packet_a=_packet(left),
            packet_b=_packet(right),
        )
        if left_ends or right_ends:
            return


def _result(outcome: Outcome, ends: bool) -> tuple[object, ...]:
    """Return what is compared of a transition. `ends` is the result of `_ends`."""
    return ends, outcome.codes, outcome.is_known or not ends


def _text(outcome: Outcome, ends: bool) -> str:
    return str(outcome) or ("" if ends else "not in the capture")


def _note(a: Outcome, b: Outcome, stops: Sequence[str]) -> str:
    if len(stops) != 1:
        return "another result"
    outcome = a if stops[0] == "A" else b
    return f"{stops[0]} stops here" if outcome.is_known else f"not requested in {stops[0]}"


def _ends(outcome: Outcome, outcomes: Sequence[Outcome]) -> bool:
    """Return True if a bring-up does not continue after a transition that it did not complete.

    A capture may lack the transition itself, for example if it begins later.
    """
    later = outcomes[outcomes.index(outcome) :]
    return not any(each.reached is not None for each in later)


def _packet(outcome: Outcome) -> int | None:
    found = outcome.error or outcome.reached
    return found.packet if found else None


def _position(device: Device | None) -> tuple[int, int]:
    assert device is not None
    return (0x10000 if device.position is None else device.position), device.number
