"""Collection of a report: each part runs, and a part that fails does not end the others."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from catenary.cli.report_archive import FORMAT, Manifest, Part, write_archive
from catenary.cli.report_facts import machine_facts, versions
from catenary.cli.report_privacy import Redactor, redactor_of_this_machine
from catenary.cli.report_segment import Incomplete, Job, capture, scan, timing

CLONE_SECONDS = 300.0  # longest time for all devices
DEVICE_SECONDS = 120.0  # longest time for the objects of one device
CLONE = "clone"


def collect(
    target: str,
    path: Path,
    *,
    seconds: float,
    serials: bool = False,
    zero_outputs: bool = False,
    with_clone: bool = True,
) -> Manifest:
    """Run all parts, and write the archive.

    Args:
        target: Name of a segment.
        path: Path of the archive.
        seconds: Duration of the latency test and of the loop [s].
        serials: True to keep serial numbers.
        zero_outputs: True if outputs of 0 are safe for all devices.
        with_clone: True to clone the devices.

    Raises:
        ConfigurationError: The target is invalid.
        OSError: The archive cannot be written.
    """
    from catenary.target.parse import in_virtual_time

    redactor = redactor_of_this_machine()
    nics = network_interfaces(target)
    with tempfile.TemporaryDirectory(prefix="catenary-report-") as folder:
        job = Job(target, nics, seconds, serials, zero_outputs, redactor, Path(folder))
        parts = tuple(run_parts(job, with_clone=with_clone))
        manifest = Manifest(
            format=FORMAT,
            date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            target=redactor.text(target),
            virtual_time=in_virtual_time(target),
            serials=serials,
            machine=_redacted(redactor, machine_facts(nics)),
            versions=versions(),
            parts=parts,
            files={},
        )
        return write_archive(path, manifest, job.folder)


def _redacted(redactor: Redactor, facts: dict[str, object]) -> dict[str, object]:
    return {name: redactor.value(value) for name, value in facts.items()}


def network_interfaces(target: str) -> tuple[str, ...]:
    """Return the network interfaces of a target; none for a virtual one or an IgH master."""
    from catenary.link import Interface, Ring
    from catenary.target.parse import parse

    source = parse(target)
    ends = (source.first, source.second) if isinstance(source, Ring) else (source,)
    return tuple(end.name for end in ends if isinstance(end, Interface))


def run_parts(job: Job, *, with_clone: bool) -> Iterator[Part]:
    """Run each part, and yield its result."""
    for name, function in PARTS.items():
        if name == CLONE and not with_clone:
            yield Part(name, "skipped", 0.0, reason="--no-clone")
            continue
        if sys.stderr.isatty():
            print(f"{name} ...", file=sys.stderr)
        yield run_part(name, function, job)


def run_part(name: str, function: Callable[[Job], str], job: Job) -> Part:
    """Run a part. An error becomes its reason."""
    from catenary.cli.failure import describe

    start = time.monotonic()
    status, result, reason = "done", "", ""
    try:
        result = function(job)
    except Incomplete as error:
        status, reason = "incomplete", str(error)
    except Exception as error:  # the report exists to show it
        message, hint = describe(error)
        status, reason = "failed", f"{message} (hint: {hint})" if hint else message
    elapsed = round(time.monotonic() - start, 2)
    text = job.redactor.text
    return Part(name, status, elapsed, result=text(result), reason=text(reason))


def doctor(job: Job) -> str:
    """Write the checks of this machine. Return the number of each status as text."""
    import json
    from collections import Counter

    from catenary import doctor

    first, *others = job.nics or (None,)
    found = Counter[str]()
    for number, nic in enumerate((first, *others)):
        machine = doctor.this_machine(nic)
        if number == 0:
            machine, latency = doctor.watch(
                machine, job.seconds, cpu=doctor.obtainable_cpu(machine)
            )
            examination = doctor.examine(machine, latency)
        else:
            examination = doctor.examine(machine)
        name = f"doctor-{nic}" if number else "doctor"
        job.write_text(f"{name}.txt", doctor.as_text(examination))
        job.write_json(f"{name}.json", json.loads(doctor.as_json(examination)))
        found.update(check.status for check in examination.checks)
    return ", ".join(f"{count} {status}" for status, count in sorted(found.items()))


def clone(job: Job) -> str:
    """Write the clone folder. Return the number of devices as text."""
    from catenary.target import clone as clone_devices

    end = time.monotonic() + CLONE_SECONDS

    def check_time(text: str, done: int, total: int) -> None:
        if time.monotonic() > end:
            raise Incomplete(f"ended after {CLONE_SECONDS:g} s at {text}, {done} of {total}")

    line = clone_devices(
        job.target,
        job.folder / CLONE,
        pre_op=True,
        serials=job.serials,
        objects_timeout=DEVICE_SECONDS,
        progress=check_time,
    )
    reasons = [
        f"device {device.position} ({device.name}): {part}: {reason}"
        for device in line.devices
        for part, reason in device.missing.items()
    ]
    if reasons:
        raise Incomplete(f"{len(reasons)} parts are missing: {reasons[0]}")
    return f"{len(line.devices)} devices"


PARTS: dict[str, Callable[[Job], str]] = {
    "doctor": doctor,
    "scan": scan,
    CLONE: clone,
    "timing": timing,
    "capture": capture,
}
