"""MainDevice and SubDevice, and the runners of procedures."""

from catenary.bus.acyclic_runner import AcyclicQueue, AcyclicRunner
from catenary.bus.external_master import Carrier, CycleClock
from catenary.bus.foe import Foe
from catenary.bus.main_device import MainDevice
from catenary.bus.pending import Pending
from catenary.bus.runner import BlockingRunner, FrameCounts, Runner
from catenary.bus.sdo import Sdo
from catenary.bus.soe import Soe
from catenary.bus.sub_device import SubDevice
from catenary.bus.sub_devices import SubDevices
from catenary.wire.sdo_information import ListType

__all__ = [
    "AcyclicQueue",
    "AcyclicRunner",
    "BlockingRunner",
    "Carrier",
    "CycleClock",
    "Foe",
    "FrameCounts",
    "ListType",
    "MainDevice",
    "Pending",
    "Runner",
    "Sdo",
    "Soe",
    "SubDevice",
    "SubDevices",
]
