"""Sensors beside the axes: samples with time, rate, age and validity, in a share of their own.

with sensors.attach("arm.wrist") as wrist:        # in the loop's program, or any other
    now = wrist.read()                            # now.valid, now.age, now["force"]
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.sensors.analog import analog_wrench
    from catenary.sensors.calibration import Calibration
    from catenary.sensors.ethercat import EtherCat, Field, LoopSource
    from catenary.sensors.frame import Frame
    from catenary.sensors.low_pass import LowPass
    from catenary.sensors.processing import Calibrate, Filter, Processed, Step, Transform
    from catenary.sensors.publisher import SensorShare
    from catenary.sensors.rdt import Rdt
    from catenary.sensors.reader import Reading, SensorReader, attach
    from catenary.sensors.runner import Options, Task, run
    from catenary.sensors.sensor import Channel, Connection, Counters, Sample, Sensor, Source
    from catenary.sensors.udp import Udp

_MODULES = {
    "Calibrate": "processing",
    "Calibration": "calibration",
    "Channel": "sensor",
    "Connection": "sensor",
    "Counters": "sensor",
    "EtherCat": "ethercat",
    "Field": "ethercat",
    "Filter": "processing",
    "Frame": "frame",
    "LoopSource": "ethercat",
    "LowPass": "low_pass",
    "Options": "runner",
    "Processed": "processing",
    "Rdt": "rdt",
    "Reading": "reader",
    "Sample": "sensor",
    "Sensor": "sensor",
    "SensorReader": "reader",
    "SensorShare": "publisher",
    "Source": "sensor",
    "Step": "processing",
    "Task": "runner",
    "Transform": "processing",
    "Udp": "udp",
    "analog_wrench": "analog",
    "attach": "reader",
    "run": "runner",
}

__all__ = [
    "Calibrate",
    "Calibration",
    "Channel",
    "Connection",
    "Counters",
    "EtherCat",
    "Field",
    "Filter",
    "Frame",
    "LoopSource",
    "LowPass",
    "Options",
    "Processed",
    "Rdt",
    "Reading",
    "Sample",
    "Sensor",
    "SensorReader",
    "SensorShare",
    "Source",
    "Step",
    "Task",
    "Transform",
    "Udp",
    "analog_wrench",
    "attach",
    "run",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
