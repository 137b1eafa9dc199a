"""`catenary check --against`: compare the devices of a segment with their ESIs."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from catenary.bus import MainDevice, SubDevice
from catenary.bus.esi_check import Comparison, Depth, check_device
from catenary.cli import check_machine
from catenary.cli.check_descriptions import Descriptions
from catenary.cli.devices import device_at
from catenary.cli.failure import one_line
from catenary.cli.parsers import note_other_masters
from catenary.cli.progress import Progress
from catenary.cli.text import escaped
from catenary.errors import CatenaryError
from catenary.esi.device import EsiDevice
from catenary.esi.difference import Difference, Severity

WIDTH = len("warning")


@dataclass(frozen=True, slots=True)
class Result:
    """Result of one device. `problem` is the reason if it could not be compared."""

    sub: SubDevice
    esi: EsiDevice | None = None
    rule: str = ""  # rule by which the description was chosen
    found: Comparison | None = None
    problem: str = ""
    required: bool = True  # False if a missing description is not an error

    @property
    def failed(self) -> bool:
        """True if the device differs from its ESI by an error, or could not be compared."""
        if self.found is None:
            return self.required
        return any(each.severity is Severity.ERROR for each in self.found.differences)


def run(arguments: argparse.Namespace) -> int:
    """Compare the devices with their ESIs, and with a machine file if one is given."""
    from catenary.machine import compare
    from catenary.machine.esi_files import esi_places
    from catenary.target import MainDevice

    source, expected = check_machine.source_and_machine(arguments.file, arguments.target)
    places = None if expected is None else esi_places(expected)
    with (
        Descriptions.of(arguments.against, places) as descriptions,
        MainDevice(source, force=True) as main,
    ):
        note_other_masters(main)
        subs = main.passive_scan()
        machine = None if expected is None else compare(expected.tables.device, subs)
        chosen = subs
        if arguments.position is not None:
            chosen = type(subs)([device_at(subs, arguments.position)])
        depth = _depth(arguments, main)
        single = len(chosen) == 1
        results = [_result(main, sub, descriptions, depth, single=single) for sub in chosen]
    if arguments.json:
        values = None if machine is None else check_machine.as_values(machine)
        print(json.dumps({"machine": values, "devices": [*map(_values, results)]}, indent=2))
    else:
        if machine is not None:
            print(check_machine.as_table(machine))
        print("\n".join(_lines(results)))
    status = check_machine.SAME if machine is None else check_machine.status_of(machine)
    return max(status, check_machine.DIFFERENT if _failed(results) else check_machine.SAME)


def _failed(results: Sequence[Result]) -> bool:
    """Return True if a device differs by an error, or no device could be compared."""
    return any(each.failed for each in results) or all(each.found is None for each in results)


def _depth(arguments: argparse.Namespace, main: MainDevice) -> Depth:
    if arguments.passive:
        return Depth(coe=False, reason="--passive")
    others = main.other_masters
    if others:
        return Depth(coe=False, reason=f"another master uses the segment ({others[0]})")
    return Depth(objects=arguments.objects)


def _result(
    main: MainDevice, sub: SubDevice, descriptions: Descriptions, depth: Depth, *, single: bool
) -> Result:
    """Compare one device. An error becomes its result, so that the others are compared."""
    identity = sub.identity
    if not any(identity):
        notes = "".join(f": {note}" for note in sub.description.notes)
        return Result(sub, problem=f"its EEPROM has no identity{notes}")
    try:
        chosen = descriptions.find(sub, single=single)
        if chosen is None:
            return Result(sub, problem=descriptions.missing(sub, single=single), required=single)
        with Progress(f"device {sub.position}", "objects") as progress:
            found = check_device(main, sub.description, chosen.esi, depth, progress)
        found = replace(found, notes=(*chosen.notes, *found.notes))
        return Result(sub, chosen.esi, chosen.rule, found)
    except CatenaryError as error:
        hint = f" ({error.hint})" if error.hint else ""
        return Result(sub, problem=f"{error.message}{hint}")


def _lines(results: Sequence[Result]) -> Iterator[str]:
    for each in results:
        yield escaped(f"{each.sub.description}: {_headline(each)}")
        if each.found is not None:
            for difference in each.found.differences:
                yield from _difference_lines(difference)
            for note in each.found.notes:
                yield f"  {'note':{WIDTH}}  {one_line(note)}"
    yield _summary(results)


def _headline(result: Result) -> str:
    if result.esi is None:
        return one_line(result.problem)
    if result.found is None:
        return f"{result.esi.source}: {one_line(result.problem)}"
    same = "" if result.found.differences else ": no difference"
    return f"{result.esi.source}, {result.rule}{same}"


def _difference_lines(difference: Difference) -> Iterator[str]:
    yield f"  {difference.severity.value:{WIDTH}}  {one_line(str(difference))}"
    text = "; ".join(each for each in (difference.reason, difference.advice) if each)
    if text:
        yield f"  {'':{WIDTH}}  {one_line(text)}"


def _summary(results: Sequence[Result]) -> str:
    compared = [each.found for each in results if each.found is not None]
    counts = Counter(d.severity for found in compared for d in found.differences)
    total = ", ".join(_counted(counts[severity], severity.value) for severity in Severity)
    return f"{_counted(len(compared), 'device')} of {len(results)} compared: {total}"


def _counted(number: int, noun: str) -> str:
    plural = "" if number == 1 or noun == "info" else "s"
    return f"{number} {noun}{plural}"


def _values(result: Result) -> dict[str, object]:
    found, esi = result.found, result.esi
    return {
        "position": result.sub.position,
        "name": result.sub.name,
        "identity": str(result.sub.identity),
        "esi": None
        if esi is None
        else {
            "type": esi.type,
            "key": str(esi.key),
            "file": esi.source.file,
            "line": esi.source.line,
            "rule": result.rule,
        },
        "problem": result.problem,
        "notes": [] if found is None else list(found.notes),
        "differences": [] if found is None else [_difference(d) for d in found.differences],
    }


def _difference(difference: Difference) -> dict[str, object]:
    return {
        "severity": difference.severity.value,
        "subject": difference.subject.value,
        "what": difference.what,
        "device": difference.device,
        "esi": difference.sides.esi,
        "sii": difference.sides.sii,
        "coe": difference.sides.coe,
        "follows": difference.follows,
        "file": difference.source.file,
        "line": difference.source.line,
        "reason": difference.reason,
        "advice": difference.advice,
    }
