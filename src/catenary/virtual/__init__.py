"""A virtual EtherCAT segment at register level: in this process, in virtual time, or on a NIC."""

from catenary.virtual.devices import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Servo,
)
from catenary.virtual.server import Server, serve
from catenary.virtual.segment import FrameCounters, Segment, demo_segment

__all__ = [
    "AnalogInputs",
    "Coupler",
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
