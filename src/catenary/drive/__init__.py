"""Process-data requests for CiA 402 axes, inputs and outputs, with SI units and arrays."""

from catenary.drive.channel import Channel
from catenary.drive.drives import Drives
from catenary.drive.homing import HomingMethod
from catenary.drive.io import Inputs, Outputs
from catenary.drive.move import Move
from catenary.drive.probe import Probe
from catenary.drive.probe_port import ProbeEvent
from catenary.drive.process_data import ProcessData
from catenary.drive.recovery import Phase, Recovery, Stop
from catenary.drive.start_up_list import read_start_up
from catenary.drive.touch_probe import TouchProbe
from catenary.plan.request import DistributedClock
from catenary.plan.start_up_object import StartUp

__all__ = [
    "Channel",
    "DistributedClock",
    "Drives",
    "HomingMethod",
    "Inputs",
    "Move",
    "Outputs",
    "Phase",
    "Probe",
    "ProbeEvent",
    "ProcessData",
    "Recovery",
    "StartUp",
    "Stop",
    "TouchProbe",
    "read_start_up",
]
