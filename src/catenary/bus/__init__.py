"""MainDevice and SubDevice, and the runners of procedures."""

from catenary.bus.acyclic_runner import AcyclicQueue, AcyclicRunner
from catenary.bus.ads_notifications import AdsNotifications
from catenary.bus.aoe import Aoe
from catenary.bus.eoe import Eoe
from catenary.bus.ethernet_bridge import EthernetBridge
from catenary.bus.ethernet_port import EthernetCounts
from catenary.bus.external_master import Carrier, CycleClock
from catenary.bus.foe import Foe
from catenary.bus.latch import Latch, LatchEvent
from catenary.bus.main_device import MainDevice
from catenary.bus.pending import Pending
from catenary.bus.runner import BlockingRunner, FrameCounts, Runner
from catenary.bus.sdo import Sdo
from catenary.bus.segment_eoe import SegmentEoe
from catenary.bus.sub_device import SubDevice
from catenary.bus.sub_devices import SubDevices
from catenary.bus.voe import Voe
from catenary.wire.sdo_information import ListType

__all__ = [
    "AcyclicQueue",
    "AcyclicRunner",
    "AdsNotifications",
    "Aoe",
    "BlockingRunner",
    "Carrier",
    "CycleClock",
    "Eoe",
    "EthernetBridge",
    "EthernetCounts",
    "Foe",
    "FrameCounts",
    "Latch",
    "LatchEvent",
    "ListType",
    "MainDevice",
    "Pending",
    "Runner",
    "Sdo",
    "SegmentEoe",
    "SubDevice",
    "SubDevices",
    "Voe",
]
