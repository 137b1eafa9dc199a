"""`python -m benchmarks igh`: time of a cycle over libethercat.

Three variants take turns on one activated master: our step, the same calls hand-written in C, and
one ctypes call for each function, as in PyIgH.
"""

from __future__ import annotations

import ctypes
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.compiler import compile_library
from catenary import igh
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.errors import ConfigurationError
from catenary.igh.configure import Domain
from catenary.pyigh import MasterBase, SlaveServo
from catenary.target import MainDevice

CYCLES = 2000
ROUNDS = 51
WARM_UP = 1000
CALLS = (
    *("ecrt_master_receive", "ecrt_master_send", "ecrt_domain_process", "ecrt_domain_queue"),
    *("ecrt_domain_state", "ecrt_master_state"),
)


class Peer(ctypes.Structure):
    """`struct igh_peer` of peers/igh_peer.c."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in CALLS),
        *((name, ctypes.c_void_p) for name in ("master", "domain", "data", "outputs", "inputs")),
        *((name, ctypes.c_uint32) for name in ("output_count", "input_count")),
        *((name, ctypes.c_void_p) for name in ("output_copies", "input_copies")),
    )


def measure(*, library: str | os.PathLike[str] | None, file: Path | None) -> None:
    figures = cycle_times(library)
    medians = {name: statistics.median(each) for name, each in figures.items()}
    print(f"{machine()}\n{CYCLES} cycles, {ROUNDS} times, in turns; ns a cycle")
    for name, each in figures.items():
        ratio = medians[name] / medians["c"]
        print(f"  {name:9} median {medians[name]:8.1f}  lowest {min(each):8.1f}  {ratio:.3f} of C")
    pairs = [ours / c for ours, c in zip(figures["catenary"], figures["c"], strict=True)]
    print(f"  catenary / c, round by round: median {statistics.median(pairs):.3f}")
    rounded = {name: [round(ns, 1) for ns in each] for name, each in figures.items()}
    write(file, {"machine": machine(), "catenary_to_c": statistics.median(pairs), **rounded})


def cycle_times(library: str | os.PathLike[str] | None) -> dict[str, list[float]]:
    """Return the time per cycle [ns] of each variant, in each round."""
    with (
        tempfile.TemporaryDirectory() as folder,
        MainDevice(igh.Master(library=library)) as main,
        MasterBase(main) as master,
    ):
        servos = [SlaveServo(sub.position) for sub in main.subs.drives]
        for servo in servos:
            master.ecat_init_slave(servo)
        master.ecat_activate_domain()
        master.ecat_activate_master()
        kernel = main.master
        assert isinstance(kernel, igh.KernelMaster)
        exchange = kernel.configuration.exchange
        [domain] = kernel.configuration.domains
        peer, kept = _peer(kernel, domain)
        native = ctypes.CDLL(str(compile_library("igh_peer", Path(folder)))).igh_peer_cycles
        native.argtypes = [ctypes.c_void_p, ctypes.c_uint64]
        ways: dict[str, Callable[[], object]] = {
            "catenary": lambda: exchange.steps(CYCLES),
            "c": lambda: native(ctypes.addressof(peer), CYCLES),
            "ctypes": lambda: _published(master, servos),
        }
        exchange.steps(WARM_UP)
        if not master.ecat_domain_process():
            raise ConfigurationError(
                "not all devices answer", hint="ethercat slaves shows their states"
            )
        times: dict[str, list[float]] = {name: [] for name in ways}
        for name, way in _in_turns(ways):
            begun = time.perf_counter_ns()
            way()
            times[name].append((time.perf_counter_ns() - begun) / CYCLES)
        del kept
        return times


def _in_turns(ways: dict[str, Callable[[], object]]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield each variant once per round. Each round starts with a different one."""
    names = list(ways)
    for number in range(ROUNDS):
        first = number % len(names)
        for name in names[first:] + names[:first]:
            yield name, ways[name]


def _published(master: MasterBase, servos: list[SlaveServo]) -> None:
    for _ in range(CYCLES):
        master.ecat_master_receive()
        master.ecat_domain_process()
        for servo in servos:
            servo.set_position(servo.read_position())
        master.ecat_domain_queue()
        master.ecat_master_send()


def _peer(kernel: igh.KernelMaster, domain: Domain) -> tuple[Peer, list[object]]:
    """Return the structure of the C program, and the objects that must outlive it."""
    library = kernel.reservation.library
    sides = [
        (ctypes.c_uint32 * (3 * len(copies)))(*(number for copy in copies for number in copy))
        for copies in (domain.outputs, domain.inputs)
    ]
    images = [ctypes.create_string_buffer(domain.size + 16) for _ in sides]
    peer = Peer(
        *(library.addresses[name] for name in CALLS),
        *(kernel.reservation.handle, domain.domain, domain.data),
        *(ctypes.addressof(image) for image in images),
        *(len(domain.outputs), len(domain.inputs)),
        *(ctypes.addressof(side) for side in sides),
    )
    return peer, [*sides, *images]
