"""Parts of a report that use the segment: scan, timing of a loop without motion, and a capture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.report_privacy import Redactor

if TYPE_CHECKING:
    from catenary.bus import MainDevice, SubDevice
    from catenary.loop import Loop
    from catenary.model.device import DeviceDescription

CAPTURE_SECONDS = 1.0  # of cycles, after the bring-up
PERIOD = 1e-3  # [s]
AXIS_OBJECTS = 0x6000  # first object of axis 0


class Incomplete(Exception):
    """Files of a part that are not complete. The message is the reason."""


@dataclass(frozen=True, slots=True)
class Job:
    """Options of a report, and the folder of its files."""

    target: str
    nics: tuple[str, ...]  # network interfaces of the target
    seconds: float  # of the latency test and of the loop
    serials: bool
    zero_outputs: bool  # True if outputs of 0 are safe for all devices
    redactor: Redactor
    folder: Path

    def write_text(self, name: str, text: str) -> None:
        (self.folder / name).write_text(f"{self.redactor.text(text)}\n", encoding="utf-8")

    def write_json(self, name: str, value: object) -> None:
        text = json.dumps(self.redactor.value(value), indent=2)
        (self.folder / name).write_text(f"{text}\n", encoding="utf-8")


def scan(job: Job) -> str:
    """Write the list of devices. Return their number as text."""
    from catenary.cli.devices import as_json
    from catenary.target import MainDevice

    with MainDevice(job.target) as main:
        subs = main.scan(strict=False)
        devices = json.loads(as_json(subs))
        errors = [sub.error.message for sub in subs if sub.error is not None]
        notes = list(main.notes)
    if not job.serials:
        for device in devices:
            device["serial"] = None
    job.write_json("scan.json", {"devices": devices, "notes": notes})
    if errors:
        raise Incomplete(f"{len(errors)} of {len(devices)} devices failed: {errors[0]}")
    return f"{len(devices)} devices"


def timing(job: Job) -> str:
    """Run a loop without motion, and write its timing. Return its counters as text."""
    from catenary.loop.timing import counts
    from catenary.target import MainDevice

    with MainDevice(job.target) as main:
        loop = _run(job, main, job.seconds)
    return counts(loop.timing.counters)


def capture(job: Job) -> str:
    """Write the frames of a bring-up and of a short loop. Return their number as text."""
    from catenary.link import Recorder
    from catenary.target import MainDevice

    with MainDevice(job.target) as main:
        if not job.serials:  # the scan reads serial numbers from the EEPROMs
            main.scan(strict=False)
        recorder = Recorder(main.link, job.folder / "capture.pcapng")
        main.replace_link(recorder)
        _run(job, main, min(CAPTURE_SECONDS, job.seconds), name="")
        recorded, dropped = recorder.recorded, recorder.dropped
    if dropped:
        raise Incomplete(f"{dropped} frames were dropped, and {recorded} recorded")
    return f"{recorded} frames"


def _run(job: Job, main: MainDevice, seconds: float, name: str = "timing") -> Loop:
    """Run a loop in which all drives stay disabled. Return it after its end.

    Args:
        job: The report.
        main: The open MainDevice.
        seconds: Duration [s].
        name: Name of the written files; "" to write none.
    """
    from catenary.errors import ConfigurationError
    from catenary.loop import Loop, StopPolicy
    from catenary.operate.devices import make_requests

    scanned = main.subs or main.scan(strict=False)
    subs = [sub for sub in scanned if sub.error is None]
    requests, notes = make_requests(subs)
    if not requests:
        raise ConfigurationError("no device has process data")
    main.read_mappings(*requests, period=PERIOD)  # the SII may describe another mapping
    if not job.zero_outputs:
        require_safe_outputs(subs)
    policy = StopPolicy(on_axis_stopped="event", raise_faults=False)
    loop = Loop(*requests, period=PERIOD, enable=False, stop=policy)
    opened = False
    try:
        with loop:
            opened = True
            for cycle in loop:
                if cycle.time >= seconds:
                    break
    finally:
        if opened and name:
            _write_timing(job, name, loop, notes)
    return loop


def require_safe_outputs(subs: Sequence[SubDevice]) -> None:
    """Raise Incomplete if an output of 0 may be a command for a device.

    A loop sends 0 to all devices of a segment. An axis stays disabled. A digital output is off, as
    without power.
    """
    unknown = [sub for sub in subs if has_unknown_outputs(sub.description)]
    if unknown:
        names = ", ".join(f"{sub.position} ({sub.name})" for sub in unknown)
        raise Incomplete(
            f"not run: a loop sends outputs of 0 to device {names}; add --zero-outputs if this is "
            "safe"
        )


def has_unknown_outputs(device: DeviceDescription) -> bool:
    """Return True if a device has outputs other than single bits and objects of its axes.

    All PDOs count, assigned or not. Of a drive, only the assigned ones count: others that a loop
    needs contain objects of its axes.
    """
    from catenary.model.process_data import mapped_pdos

    pdos = mapped_pdos(device.outputs) if device.slots else device.output_pdos
    entries = [entry for pdo in pdos for entry in pdo.entries if entry.index]
    known = [entry.bit_length == 1 or is_of_axis(device, entry.index) for entry in entries]
    return not all(known) or bool(device.outputs and not entries)


def is_of_axis(device: DeviceDescription, index: int) -> bool:
    """Return True for an object of the profile CiA 402 of an axis of the device."""
    from catenary.wire.cia402 import SLOT_OFFSET

    return (index - AXIS_OBJECTS) // SLOT_OFFSET in device.slots


def _write_timing(job: Job, name: str, loop: Loop, notes: list[str]) -> None:
    """Write the timing as far as the loop ran."""
    timing = loop.timing
    job.write_text(f"{name}.txt", "\n".join([str(timing), "", *notes, "", str(loop.plan)]))
    job.write_json(
        f"{name}.json",
        {
            "period": timing.period,
            "scheduling": timing.scheduling,
            "counters": timing.counters,
            "phases": {phase: dict(figures) for phase, figures in timing.items()},
            "notes": notes,
        },
    )
