"""Benchmarks of Catenary: `python -m benchmarks COMMAND`, from the repository's root.

They compare the loop with C, PySOEM and published figures, and expose it to random faults.
`results/` holds the figures of docs/explanation/benchmarks.md. The wheel contains none of this.

`catenary.bench.enter_private_network` must be called first. It may restart the program, which
fails after NumPy has started its threads. Imports are therefore inside the functions.
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
        drives: Number of drives.
        rate: Rate of the loops [Hz].
        seconds: Run time of every peer [s].
        peers: Names of peers in addition to ours.
        body: "sine" or "pd".
        spin: True to run a busy Python thread next to every loop.
        rounds: Rounds of every peer; None for rounds of at most one second.
        busy_wait: Busy-wait of our loops and of `c-busy` before each cycle start [s].
        file: File for the figures.

    Raises:
        ValueError: A peer is unknown, or the busy-wait is not less than the period.
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
    """Print the phases of the cycle with and without an SDO storm, and the time of a large upload.

    The upload runs on an idle bus, with Catenary and with PySOEM.

    Args:
        drives: Number of drives.
        rate: Rate of the loops [Hz].
        seconds: Run time of every variant [s].
        file: File for the figures.
    """
    from benchmarks import storm

    storm.measure(drives=drives, rate=rate, seconds=seconds, file=file)


def measure_foe(*, size: int, rounds: int, file: Path | None = None) -> None:
    """Print the rate of file transfers: on an idle bus next to PySOEM, and next to a loop.

    Args:
        size: Size of the file [bytes].
        rounds: Rounds in which the programs take turns.
        file: File for the figures.
    """
    from benchmarks import foe

    foe.measure(size=size, rounds=rounds, file=file)


def measure_eoe(*, seconds: float, rounds: int, file: Path | None = None) -> None:
    """Print the rate of a web page through EoE, and the lost cycles of a loop without and with it.

    Args:
        seconds: Run time of every run [s].
        rounds: Rounds in which the runs take turns.
        file: File for the figures.
    """
    from benchmarks import eoe

    eoe.measure(seconds=seconds, rounds=rounds, file=file)


def measure_share(*, drives: int, rate: int, seconds: float, file: Path | None = None) -> None:
    """Print the time to read a cycle from a share, and the cost of readers for the loop.

    Args:
        drives: Number of drives.
        rate: Rate of the loops [Hz].
        seconds: Run time of every variant [s].
        file: File for the figures.
    """
    from benchmarks import share

    share.measure(drives=drives, rate=rate, seconds=seconds, file=file)


def measure_remote(*, drives: int, rate: int, seconds: float, file: Path | None = None) -> None:
    """Print the cost of 200 remote requests per second for the loop.

    Args:
        drives: Number of drives.
        rate: Rate of the loops [Hz].
        seconds: Run time of every variant [s].
        file: File for the figures.
    """
    from benchmarks import remote_load

    remote_load.measure(drives=drives, rate=rate, seconds=seconds, file=file)


def measure_cost(*, seconds: float, file: Path | None = None) -> None:
    """Print the cost of a cycle as a + b·axes + c·bytes.

    Args:
        seconds: Run time of every segment [s].
        file: File for the figures.
    """
    from benchmarks import cost

    cost.measure(seconds=seconds, file=file)


def measure_scan(*, drives: int, file: Path | None = None) -> None:
    """Print the number of frames and the time to PRE-OP, for Catenary and PySOEM.

    Args:
        drives: Number of drives.
        file: File for the figures.
    """
    from benchmarks import scan

    scan.measure(drives=drives, file=file)


def measure_virtual(
    *, drives: int, seconds: float, file: Path | None = None, config: Path | None = None
) -> None:
    """Print how much faster than real time a virtual segment runs in this process.

    Args:
        drives: Number of drives.
        seconds: Virtual time [s].
        file: File for the figures.
        config: Segment file; None for a segment of `drives` drives.
    """
    from benchmarks import virtual_time

    virtual_time.measure(drives=drives, seconds=seconds, file=file, config=config)


def measure_tasks(*, seconds: float, file: Path | None = None) -> None:
    """Print the response time of a task next to a busy one, as processes and as threads.

    Args:
        seconds: Run time of every variant [s].
        file: File for the figures.
    """
    from benchmarks import tasks

    tasks.measure(seconds=seconds, file=file)


def measure_law(*, axes: int, file: Path | None = None) -> None:
    """Print the time of one call of a compiled law.

    Args:
        axes: Number of axes of the law.
        file: File for the figures.
    """
    from benchmarks import law_call

    law_call.measure(axes=axes, file=file)


def measure_ros2(*, axes: int, file: Path | None = None) -> None:
    """Print the time to encode and to publish one JointState.

    Args:
        axes: Number of joints of the message.
        file: File for the figures.
    """
    from benchmarks import ros2_publish

    ros2_publish.measure(axes=axes, file=file)


def measure_everything(*, minutes: float, wire: bool, seed: int, file: Path | None = None) -> bool:
    """Run all parts of Catenary together, and print the results and the memory of all processes.

    Args:
        minutes: Duration of the loop [min].
        wire: True for network interfaces, real time and load; False for virtual time.
        seed: Seed of the places where the ring is cut.
        file: File for the figures.

    Returns:
        True if nothing failed or grew.
    """
    from catenary.bench import enter_private_network

    enter_private_network()
    from benchmarks.together import run

    return run.measure(minutes=minutes, wire=wire, seed=seed, file=file)


def measure_soak(
    *,
    minutes: float,
    seed: int,
    wiring: str | None = None,
    clocks: bool | None = None,
    mode: str | None = None,
    file: Path | None = None,
) -> bool:
    """Run a loop under random faults in virtual time, and print the results.

    Args:
        minutes: Virtual time [min].
        seed: Seed of the first minute.
        wiring: "line" or "ring"; None for both in turn.
        clocks: True for drives with distributed clocks; None for with and without in turn.
        mode: "csp", "csv" or "cst"; None for all in turn.
        file: File for the figures.

    Returns:
        True if all invariants held.
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
    """Print how fast clocks synchronise, and whether they stay within 1 us.

    Args:
        devices: Numbers of drives, one segment each.
        minutes: Virtual time [min].
        jitter: Jitter of a time stamp [s].
        seed: Seed of the random numbers.
        file: File for the figures.

    Returns:
        True if all clocks stayed within 1 us.
    """
    from benchmarks import clocks

    return clocks.measure(devices=devices, minutes=minutes, jitter=jitter, seed=seed, file=file)


def measure_igh(*, library: Path | None, file: Path | None = None) -> None:
    """Print the time of a cycle over libethercat, for Catenary, C and separate calls from Python.

    Args:
        library: Path of libethercat; None to search for it.
        file: File for the figures.
    """
    from benchmarks import igh

    igh.measure(library=library, file=file)


def measure_networks(
    *, rates: Sequence[int], seconds: float, rounds: int, file: Path | None = None
) -> None:
    """Print the losses of a loop with 18 + 15 axes on two networks, and those of C programs.

    Args:
        rates: Rates of the loops [Hz].
        seconds: Run time of each [s].
        rounds: Number of rounds in which the programs take turns.
        file: File for the figures.
    """
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

    An option that is None takes the value of the table. Parts that this machine cannot run are
    omitted and named in the output. `python -m benchmarks table --help` describes the options.

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
