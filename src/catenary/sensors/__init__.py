"""Sensors beside the axes: samples with time, rate, age and validity, in a share of their own.

with sensors.attach("arm.wrist") as wrist:        # in the loop's program, or any other
    now = wrist.read()                            # now.valid, now.age, now["force"]
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.sensors.can import Can, CanBus, CanMessage, Signal
    from catenary.sensors.can_dbc import dbc_message
    from catenary.sensors.can_frame import CanFrame
    from catenary.sensors.gpio import GpioEdges, GpioLines, GpioOutput
    from catenary.sensors.mip import Mip
    from catenary.sensors.publisher import SensorShare
    from catenary.sensors.rdt import Rdt
    from catenary.sensors.reader import Reading, SensorReader, attach
    from catenary.sensors.runner import Options, Task, run
    from catenary.sensors.sensor import Channel, Connection, Counters, Sample, Sensor, Source
    from catenary.sensors.serial_port import SerialPort
    from catenary.sensors.text import Column, Text, TimeColumn
    from catenary.sensors.udp import Udp

__all__ = [
    "Can",
    "CanBus",
    "CanFrame",
    "CanMessage",
    "Channel",
    "Column",
    "Connection",
    "Counters",
    "GpioEdges",
    "GpioLines",
    "GpioOutput",
    "Mip",
    "Options",
    "Rdt",
    "Reading",
    "Sample",
    "Sensor",
    "SensorReader",
    "SensorShare",
    "SerialPort",
    "Signal",
    "Source",
    "Task",
    "Text",
    "TimeColumn",
    "Udp",
    "attach",
    "dbc_message",
    "run",
]

_MODULES = {
    "Can": "can",
    "CanBus": "can",
    "CanFrame": "can_frame",
    "CanMessage": "can",
    "Channel": "sensor",
    "Column": "text",
    "Connection": "sensor",
    "Counters": "sensor",
    "GpioEdges": "gpio",
    "GpioLines": "gpio",
    "GpioOutput": "gpio",
    "Mip": "mip",
    "Options": "runner",
    "Rdt": "rdt",
    "Reading": "reader",
    "Sample": "sensor",
    "Sensor": "sensor",
    "SensorReader": "reader",
    "SensorShare": "publisher",
    "SerialPort": "serial_port",
    "Signal": "can",
    "Source": "sensor",
    "Task": "runner",
    "Text": "text",
    "TimeColumn": "text",
    "Udp": "udp",
    "attach": "reader",
    "dbc_message": "can_dbc",
    "run": "runner",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
