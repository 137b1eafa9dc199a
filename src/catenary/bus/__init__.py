"""MainDevice and SubDevice, and the runners of procedures."""

from catenary.bus.lane_runner import Lane, LaneRunner
from catenary.bus.main_device import MainDevice, SubDevices
from catenary.bus.runner import BlockingRunner, FrameCounts, Runner
from catenary.bus.sub_device import Sdo, SubDevice

__all__ = [
    "BlockingRunner",
    "FrameCounts",
    "Lane",
    "LaneRunner",
    "MainDevice",
    "Runner",
    "Sdo",
    "SubDevice",
    "SubDevices",
]
