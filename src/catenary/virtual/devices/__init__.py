"""Types of virtual devices, with one file for each."""

from catenary.virtual.devices.analog_inputs import AnalogInputs
from catenary.virtual.devices.coupler import Coupler
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.digital_inputs import DigitalInputs
from catenary.virtual.devices.digital_outputs import DigitalOutputs
from catenary.virtual.devices.junction import Junction
from catenary.virtual.devices.model_sensor import ModelSensor
from catenary.virtual.devices.oversampling import OversamplingTerminal
from catenary.virtual.devices.servo import Servo

__all__ = [
    "AnalogInputs",
    "Coupler",
    "Device",
    "DigitalInputs",
    "DigitalOutputs",
    "Junction",
    "ModelSensor",
    "OversamplingTerminal",
    "Servo",
]
