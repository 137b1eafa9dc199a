"""`python -m benchmarks remote`: cost of a client at the rate limit of the service for the loop.

The loop runs with a share and a client that sends 200 requests per second, and with one that sends
nothing. The rounds are interleaved.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.peers import modules_of
from catenary.bench.job import Body
from catenary.bench.loop import run_all, write
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.segment import served
from catenary.bench.statistics import Run

ORDERS = ("catenary-inline", "catenary-threaded")
REQUESTS, IDLE = "-requests", "-idle"
NAMES = tuple(f"{order}{way}" for order in ORDERS for way in (IDLE, REQUESTS))
LIMIT = 1.05  # ratio of the medians with requests to those without


def measure(*, drives: int, rate: int, seconds: float, file: Path | None) -> None:
    with served(drives) as segment:
        runs = run_all(
            modules_of(NAMES), segment, rate=rate, seconds=seconds, body=Body.SINE, spin=False
        )
    quotients = request_ratios(runs)
    print(f"{machine()}\n{drives} drives at {rate} Hz: an idle client, and 200 requests/s\n")
    print(as_text(runs, quotients))
    print(f"\n{as_aims(quotients)}")
    setting: dict[str, object] = {"drives": drives, "rate": rate, "seconds": seconds}
    write(file, as_json(runs, quotients, setting))


def request_ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Return the ratios of the medians of in_controller, with requests to without."""
    medians = {run.name: run.timing_us["in_controller"]["p50"] for run in runs}
    return {
        f"in_controller: {order}{REQUESTS} / {order}{IDLE}": round(
            medians[f"{order}{REQUESTS}"] / max(medians[f"{order}{IDLE}"], 1e-3), 3
        )
        for order in ORDERS
    }


def as_aims(quotients: dict[str, float]) -> str:
    """Return one line per limit, with the measured value."""
    return "\n".join(
        f"  {name}: {found:.3f}, limit {LIMIT:g}: "
        + ("reached" if found <= LIMIT else "NOT REACHED")
        for name, found in quotients.items()
    )
