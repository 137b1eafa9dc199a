"""Benchmarks of Catenary: `python -m benchmarks COMMAND`, from the repository's root.

They compare the loop with C and PySOEM and with published figures, and let random faults happen to
it. `results/` holds the figures of docs/explanation/benchmarks.md. The wheel has none of this.

`catenary.bench.enter_private_network` comes first: it may run the program again, which NumPy's
threads would spoil. So nothing here imports anything before it is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def measure_loop(
    *,
    drives: int,
    rate: int,
    seconds: float,
    peers: Sequence[str],
    body: str = "sine",
    spin: bool = False,
    rounds: int | None = None,
    busy_wait: float = 0.0,
    file: Path | None = None,
) -> None:
    """Print the timing of every peer, and write it to `file` as JSON.

    Args:
        drives: number of drives.
        rate: of the loops [Hz].
        seconds: of every peer.
        peers: names of peers in addition to ours.
        body: "sine" or "pd".
        spin: a Python thread spins next to every loop.
        rounds: of every peer; None: as many as keep a round below a second.
        busy_wait: of our loops and of `c-busy` before each cycle start [s].
        file: of the figures.

    Raises:
        ValueError: unknown peer, or a busy-wait that is not less than the period.
    """
    from benchmarks import loop
    from catenary.bench.setting import Setting

    setting = Setting(
        drives=drives,
        rate=rate,
        seconds=seconds,
        body=body,
        spin=spin,
        rounds=rounds,
        busy_wait=busy_wait,
    )
    loop.measure(setting, peers, file)


def measure_storm(*, drives: int, rate: int, seconds: float, file: Path | None = None) -> None:
    """Prints the phases of the cycle with and without a storm of SDOs, and what a large object
    takes on an idle bus, beside PySOEM's."""
    from benchmarks import storm

    storm.measure(drives=drives, rate=rate, seconds=seconds, file=file)


def measure_share(*, drives: int, rate: int, seconds: float, file: Path | None = None) -> None:
    """Prints what reading a cycle takes, and what readers cost the loop that shares it."""
    from benchmarks import share

    share.measure(drives=drives, rate=rate, seconds=seconds, file=file)


def measure_cost(*, seconds: float, file: Path | None = None) -> None:
    """Prints what a cycle costs as a + b·axes + c·bytes."""
    from benchmarks import cost

    cost.measure(seconds=seconds, file=file)


def measure_scan(*, drives: int, file: Path | None = None) -> None:
    """Prints frames and time from nothing to PRE-OP, beside PySOEM's."""
    from benchmarks import scan

    scan.measure(drives=drives, file=file)


def measure_virtual(
    *, drives: int, seconds: float, file: Path | None = None, config: Path | None = None
) -> None:
    """Prints how much faster than real time a segment in this process runs: so many drives, or
    those of a file."""
    from benchmarks import virtual_time

    virtual_time.measure(drives=drives, seconds=seconds, file=file, config=config)


def measure_tasks(*, seconds: float, file: Path | None = None) -> None:
    """Prints the response of a task beside a busy one, as processes and as threads."""
    from benchmarks import tasks

    tasks.measure(seconds=seconds, file=file)


def measure_law(*, axes: int, file: Path | None = None) -> None:
    """Prints what one call of a compiled law on so many axes takes."""
    from benchmarks import law_call

    law_call.measure(axes=axes, file=file)


def measure_soak(
    *,
    minutes: float,
    seed: int,
    wiring: str | None = None,
    clocks: bool | None = None,
    mode: str | None = None,
    file: Path | None = None,
) -> bool:
    """Print what random faults in virtual time did to a loop; return True if all invariants held.

    Args:
        minutes: of virtual time.
        seed: of the first minute.
        wiring: "line" or "ring"; None: both, in turn.
        clocks: drives with distributed clocks; None: with and without, in turn.
        mode: "csp", "csv" or "cst"; None: all, in turn.
        file: of the figures.
    """
    from benchmarks.soak import run
    from benchmarks.soak.setting import settings

    choices = [
        setting
        for setting in settings()
        if wiring in (None, setting.wiring)
        and clocks in (None, setting.clocks)
        and mode in (None, setting.mode)
    ]
    return run.measure(minutes=minutes, seed=seed, choices=choices, file=file)


def measure_clocks(
    *,
    devices: Sequence[int],
    minutes: float,
    jitter: float,
    seed: int,
    file: Path | None = None,
) -> bool:
    """Prints how soon clocks come together, and how long they stay within 1 us. Whether all did."""
    from benchmarks import clocks

    return clocks.measure(devices=devices, minutes=minutes, jitter=jitter, seed=seed, file=file)


def measure_igh(*, library: Path | None, file: Path | None = None) -> None:
    """Prints what a cycle over libethercat takes, beside C and beside one call after the other."""
    from benchmarks import igh

    igh.measure(library=library, file=file)


def measure_networks(
    *, rates: Sequence[int], seconds: float, rounds: int, file: Path | None = None
) -> None:
    """Prints what 18 + 15 axes on two networks lose, beside C programs under the same load."""
    from benchmarks import networks

    networks.measure(rates=rates, seconds=seconds, rounds=rounds, file=file)


def measure_table(
    name: str,
    *,
    seconds: float | None = None,
    rounds: int | None = None,
    rates: Sequence[int] | None = None,
    peers: Sequence[str] | None = None,
    ring: bool = False,
    axes: Sequence[int] | None = None,
    busy_wait: float = 0.0,
    example: Path | None = None,
    realtime: bool = False,
    stretch: float | None = None,
    short: bool = False,
    file: Path | None = None,
) -> None:
    """Print a published table next to our figures.

    An option that is None has the value of the table. Parts that this machine cannot run are left
    out, and the output names them.

    Raises:
        ValueError: There is no such table.
    """
    from benchmarks import tables

    tables.check(name)
    refused = ""
    if tables.TABLES[name].wires:
        from catenary.realtime import private_network

        state = private_network.enter()
        refused = state.reason if isinstance(state, private_network.Refused) else ""
    from benchmarks.tables import sheet

    options = sheet.Options(
        seconds=seconds,
        rounds=rounds,
        rates=None if rates is None else tuple(rates),
        peers=None if peers is None else tuple(peers),
        ring=ring,
        axes=None if axes is None else tuple(axes),
        busy_wait=busy_wait,
        example=example,
        realtime=realtime,
        stretch=stretch,
        short=short,
        refused=refused,
    )
    made = tables.measure(name, options)
    print(sheet.show(made))
    if file is not None:
        file.write_text(sheet.as_json(name, made) + "\n")
        print(f"wrote {file}")
