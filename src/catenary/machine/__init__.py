"""Machine files, which describe devices, drives, process data, loop and clocks of a machine."""

from catenary.machine.comparison import (
    HARMLESS,
    Comparison,
    address,
    compare,
    expected_identity,
)
from catenary.machine.machine import Machine
from catenary.machine.read import read_machine

__all__ = [
    "HARMLESS",
    "Comparison",
    "Machine",
    "address",
    "compare",
    "expected_identity",
    "read_machine",
]
