"""Advice for an event: the next step of the operator."""

from __future__ import annotations

from collections.abc import Mapping

from catenary.loop.stop_error import ADVICE as STOPS
from catenary.plan.stop_reason import StopReason
from catenary.share.events import SharedEvent

ADVICE: Mapping[str, str] = {
    "Emergency": "look up the error code in the manual of the device, remove the cause, and reset",
    "DeviceLost": "check the power of the device and the cable before it",
    "DeviceReplaced": "install the expected device, or allow this one with loop.restore(sub)",
    "DeviceHeld": "remove the cause, then bring the device to OP",
    "StateLost": "check the AL status code, its supply and its watchdog; then bring it to OP",
    "LinkLost": "check the cable and the connectors between these devices",
    "FaultFound": "replace the cable or device that the message names",
    "DuplicateFrames": "look for a loop in the wiring or a second master",
    "ClockUnlocked": "check the load of the machine (`catenary doctor`) and the named device",
    "ExternalClockChanged": "check ptp4l and phc2sys (`catenary doctor`)",
    "TriggerChanged": "check the program that sends the trigger; both periods must be the same",
    "ModeRefused": "check that the drive supports the mode (0x6502)",
    "WorkingCounterError": "check the power and the cable of the named devices, then restart",
    "StateError": "check the AL status code of the device, then restart the program",
    "DriveError": "reset the fault after removing its cause, then enable the axis again",
    "LawError": "correct the law, then restart it",
    "LinkError": "check the cable of the network interface and other programs that use it",
}


def advice_for(event: SharedEvent) -> str:
    """Return advice for an event; empty if no action is needed."""
    if event.kind != "AxisStopped":
        return ADVICE.get(event.kind, "")
    try:
        reason = StopReason(int(str(event.details["reason"])))
    except (KeyError, ValueError):  # written by another version
        return ""
    return STOPS.get(reason, "")
