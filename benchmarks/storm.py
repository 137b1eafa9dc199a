"""`python -m benchmarks storm`: a loop with and without an SDO storm, and the upload throughput.

In a storm, other threads of the program read objects of all devices without a pause. The throughput
is that of a large object on an idle bus, for Catenary and PySOEM.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.needed import need
from benchmarks.peers import modules_of
from benchmarks.upload import Upload
from benchmarks.upload import measure as measure_uploads
from catenary.bench.job import Body
from catenary.bench.loop import run_all, write
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.segment import served
from catenary.bench.statistics import Run

NAMES = (
    "catenary-inline",
    "catenary-inline-sdo",
    "catenary-threaded",
    "catenary-threaded-sdo",
)


def measure(*, drives: int, rate: int, seconds: float, file: Path | None) -> None:
    need("pysoem")
    with served(drives) as segment:
        runs = run_all(
            modules_of(NAMES), segment, rate=rate, seconds=seconds, body=Body.SINE, spin=False
        )
        uploads = measure_uploads(segment.interface, segment.drives[0])
    quotients = storm_ratios(runs)
    print(f"{machine()}\n{drives} drives at {rate} Hz, with and without an SDO storm\n")
    print(as_text(runs, quotients))
    for run in runs:
        if run.answers:
            print(f"  {run.name}: {run.answers * rate / run.cycles:.0f} answers per second")
    print("\na large object, idle bus")
    for upload in uploads:
        print(f"  {upload}")
    setting: dict[str, object] = {"drives": drives, "rate": rate, "seconds": seconds}
    figures = as_json(runs, quotients, setting)
    write(file, {**figures, "uploads": [_as_dict(upload) for upload in uploads]})


def storm_ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Return the ratios of the medians with the storm to those without."""
    timing = {run.name: run.timing_us for run in runs}
    return {
        f"{phase}: {name}-sdo / {name}": round(
            timing[f"{name}-sdo"][phase]["p50"] / max(timing[name][phase]["p50"], 1e-3), 3
        )
        for name in NAMES[::2]
        for phase in ("in_controller", "post_processing")
    }


def _as_dict(upload: Upload) -> dict[str, object]:
    return {
        "name": upload.name,
        "bytes": upload.size,
        "seconds": round(upload.seconds, 6),
        "kilobytes_per_second": round(upload.kilobytes_per_second, 1),
    }
