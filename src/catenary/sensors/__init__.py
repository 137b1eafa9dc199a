"""Sensors beside the axes: samples with time, rate, age and validity, in a share of their own.

with sensors.attach("arm.wrist") as wrist:        # in the loop's program, or any other
    now = wrist.read()                            # now.valid, now.age, now["force"]
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.sensors.publisher import SensorShare
    from catenary.sensors.rdt import Rdt
    from catenary.sensors.reader import Reading, SensorReader, attach
    from catenary.sensors.runner import Options, Task, run
    from catenary.sensors.sensor import Channel, Connection, Counters, Sample, Sensor, Source
    from catenary.sensors.udp import Udp

__all__ = [
    "Channel",
    "Connection",
    "Counters",
    "Options",
    "Rdt",
    "Reading",
    "Sample",
    "Sensor",
    "SensorReader",
    "SensorShare",
    "Source",
    "Task",
    "Udp",
    "attach",
    "run",
]

_MODULES = {
    "Channel": "sensor",
    "Connection": "sensor",
    "Counters": "sensor",
    "Options": "runner",
    "Rdt": "rdt",
    "Reading": "reader",
    "Sample": "sensor",
    "Sensor": "sensor",
    "SensorReader": "reader",
    "SensorShare": "publisher",
    "Source": "sensor",
    "Task": "runner",
    "Udp": "udp",
    "attach": "reader",
    "run": "runner",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
