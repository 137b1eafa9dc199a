"""Virtual EtherCAT segments at register level: in virtual time, in real time, or on a NIC."""

from catenary.virtual import faults
from catenary.virtual.aoe.protocol import Ads
from catenary.virtual.coe.diagnosis_history import HistoryOptions
from catenary.virtual.coe.quirks import MailboxQuirks
from catenary.virtual.configuration import read_segment
from catenary.virtual.crystal import Crystal
from catenary.virtual.devices import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Junction,
    ModelSensor,
    OversamplingTerminal,
    Servo,
)
from catenary.virtual.devices.described import DescribedDevice, from_esi
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.servo_quirks import ServoQuirks
from catenary.virtual.devices.touch_probe import ProbeOptions
from catenary.virtual.devices.twin import Twin, TwinOptions
from catenary.virtual.eoe.ethernet import Ethernet
from catenary.virtual.fault_player import FaultEvent, Loss
from catenary.virtual.faults import Fault
from catenary.virtual.foe.firmware import make_firmware
from catenary.virtual.foe.options import DeviceFiles, DeviceFirmware
from catenary.virtual.joint import Joint
from catenary.virtual.mapping_quirks import MappingQuirks
from catenary.virtual.plant import Plant, PlantPart
from catenary.virtual.segment import FrameCounters, Segment, demo_segment
from catenary.virtual.server import Served, Server, serve, serve_all
from catenary.virtual.sii_quirks import SiiQuirks
from catenary.virtual.vendor_protocol import VendorEcho, VendorMessages

__all__ = [
    "Ads",
    "AnalogInputs",
    "Coupler",
    "Crystal",
    "DescribedDevice",
    "Device",
    "DeviceFiles",
    "DeviceFirmware",
    "DigitalInputs",
    "DigitalOutputs",
    "Ethernet",
    "Fault",
    "FaultEvent",
    "FrameCounters",
    "HistoryOptions",
    "Joint",
    "Junction",
    "Loss",
    "MailboxQuirks",
    "MappingQuirks",
    "ModelSensor",
    "Motor",
    "OversamplingTerminal",
    "Plant",
    "PlantPart",
    "ProbeOptions",
    "Segment",
    "Served",
    "Server",
    "Servo",
    "ServoQuirks",
    "SiiQuirks",
    "Twin",
    "TwinOptions",
    "VendorEcho",
    "VendorMessages",
    "demo_segment",
    "faults",
    "from_esi",
    "make_firmware",
    "read_segment",
    "serve",
    "serve_all",
]
