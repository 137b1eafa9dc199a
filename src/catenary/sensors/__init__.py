"""Sensors beside the axes: samples with time, rate, age and validity, in a share of their own.

Submodules contain the decoders and sources of devices.

    with sensors.attach("arm.wrist") as wrist:  # in the loop's program, or any other
        now = wrist.read()                      # now.valid, now.age, now["force"]
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.sensors.analog import analog_wrench
    from catenary.sensors.calibration import Calibration
    from catenary.sensors.can import Can, CanBus, CanMessage, CanSignal
    from catenary.sensors.can_dbc import dbc_message
    from catenary.sensors.can_frame import CanFrame
    from catenary.sensors.ethercat import EtherCat, Field, LoopSource
    from catenary.sensors.frame import Frame
    from catenary.sensors.gpio import GpioEdges, GpioLines, GpioOutput
    from catenary.sensors.low_pass import LowPass
    from catenary.sensors.mip import Mip
    from catenary.sensors.processing import Bias, Calibrate, Filter, Processed, Step, Transform
    from catenary.sensors.publisher import SensorShare
    from catenary.sensors.rdt import Rdt
    from catenary.sensors.reader import Reading, SensorReader, attach
    from catenary.sensors.runner import Options, Task, run
    from catenary.sensors.sensor import Channel, Connection, Counters, DataSource, Sample, Sensor
    from catenary.sensors.serial_port import SerialPort
    from catenary.sensors.text import Column, Text, TimeColumn
    from catenary.sensors.udp import Udp

_MODULES = {
    "Bias": "processing",
    "Calibrate": "processing",
    "Calibration": "calibration",
    "Can": "can",
    "CanBus": "can",
    "CanFrame": "can_frame",
    "CanMessage": "can",
    "CanSignal": "can",
    "Channel": "sensor",
    "Column": "text",
    "Connection": "sensor",
    "Counters": "sensor",
    "DataSource": "sensor",
    "EtherCat": "ethercat",
    "Field": "ethercat",
    "Filter": "processing",
    "Frame": "frame",
    "GpioEdges": "gpio",
    "GpioLines": "gpio",
    "GpioOutput": "gpio",
    "LoopSource": "ethercat",
    "LowPass": "low_pass",
    "Mip": "mip",
    "Options": "runner",
    "Processed": "processing",
    "Rdt": "rdt",
    "Reading": "reader",
    "Sample": "sensor",
    "Sensor": "sensor",
    "SensorReader": "reader",
    "SensorShare": "publisher",
    "SerialPort": "serial_port",
    "Step": "processing",
    "Task": "runner",
    "Text": "text",
    "TimeColumn": "text",
    "Transform": "processing",
    "Udp": "udp",
    "analog_wrench": "analog",
    "attach": "reader",
    "dbc_message": "can_dbc",
    "run": "runner",
}

__all__ = [
    "Bias",
    "Calibrate",
    "Calibration",
    "Can",
    "CanBus",
    "CanFrame",
    "CanMessage",
    "CanSignal",
    "Channel",
    "Column",
    "Connection",
    "Counters",
    "DataSource",
    "EtherCat",
    "Field",
    "Filter",
    "Frame",
    "GpioEdges",
    "GpioLines",
    "GpioOutput",
    "LoopSource",
    "LowPass",
    "Mip",
    "Options",
    "Processed",
    "Rdt",
    "Reading",
    "Sample",
    "Sensor",
    "SensorReader",
    "SensorShare",
    "SerialPort",
    "Step",
    "Task",
    "Text",
    "TimeColumn",
    "Transform",
    "Udp",
    "analog_wrench",
    "attach",
    "dbc_message",
    "run",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
