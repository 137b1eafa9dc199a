"""CiA 402 axes and I/O as wishes: objects, units, arrays."""

from catenary.drive.drives import Drives
from catenary.drive.homing import HomingMethod
from catenary.drive.io import Inputs, Outputs
from catenary.drive.recovery import Phase, Recovery, Stop
from catenary.plan.wish import DistributedClock

__all__ = [
    "DistributedClock",
    "Drives",
    "HomingMethod",
    "Inputs",
    "Outputs",
    "Phase",
    "Recovery",
    "Stop",
]
