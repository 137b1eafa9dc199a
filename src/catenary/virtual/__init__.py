"""A virtual EtherCAT segment at register level: in this process, in virtual time, or on a NIC."""

from catenary.virtual.crystal import Crystal
from catenary.virtual.devices import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Servo,
)
from catenary.virtual.segment import FrameCounters, Segment, demo_segment
from catenary.virtual.server import Server, serve

__all__ = [
    "AnalogInputs",
    "Coupler",
    "Crystal",
    "Device",
    "DigitalInputs",
    "DigitalOutputs",
    "FrameCounters",
    "Segment",
    "Server",
    "Servo",
    "demo_segment",
    "serve",
]
