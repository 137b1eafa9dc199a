"""Checks of a machine for a real-time loop: `catenary doctor`, docs/how_to/doctor.md.

    machine = this_machine("eth0")              # reads the kernel's and the driver's settings
    machine, latency = watch(machine, 3.0, cpu=None)
    examination = examine(machine, latency)     # evaluates the settings; no I/O
    print(as_text(examination))

The checks send no frames. Only `apply` and `undo` change settings.
"""

from catenary.doctor.change import (
    Change,
    HostState,
    MachineGround,
    StateError,
    apply,
    open_state,
    undo,
)
from catenary.doctor.check import Check
from catenary.doctor.examination import Examination, examine, this_machine, watch
from catenary.doctor.latency import Latency, obtainable_cpu
from catenary.doctor.machine import Machine
from catenary.doctor.report import as_json, as_text, change_lines

__all__ = [
    "Change",
    "Check",
    "Examination",
    "HostState",
    "Latency",
    "Machine",
    "MachineGround",
    "StateError",
    "apply",
    "as_json",
    "as_text",
    "change_lines",
    "examine",
    "obtainable_cpu",
    "open_state",
    "this_machine",
    "undo",
    "watch",
]
