"""Public names of the package, each once: under the shortest name by which it can be imported."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TypeVar

EVENTS = "catenary.bus.event_types"  # `catenary.events`
MODULES = (
    *("capture", "control", "drive", "esi", "line", "realtime", "record", "remote", "sensors"),
    "share",
    "teleoperation",
    "virtual",
)
PLAIN = ("errors", "events", "types", "virtual.faults")  # no `__all__`: what they define
INTERNAL = {"catenary.events.emergency", "catenary.virtual.faults.number_of_state"}

# Types of what public methods return; programs do not import them.
PROTOCOLS = ("Foe", "Eoe", "Aoe", "AdsNotifications", "Voe")
RETURNED = {
    "catenary.wire.ads_response": ("DeviceInfo", "States", "Sample"),
    "catenary.wire.voe": ("VoeMessage",),
    "catenary.bus": (
        *("SubDevices", "Sdo", *PROTOCOLS, "Latch", "LatchEvent", "Pending", "ListType"),
        *("SegmentEoe", "EthernetBridge", "EthernetCounts"),
    ),
    "catenary.bus.device_diagnosis": ("DeviceDiagnosis",),
    "catenary.bus.diagnosis": ("Diagnosis",),
    "catenary.bus.event_queue": ("Events",),
    "catenary.drive.values": ("AxisValues",),
    "catenary.gateway": ("GatewayCounts",),
    "catenary.esi.eni": ("Variable",),
    "catenary.link.interfaces": ("NetworkInterface",),
    "catenary.log": ("Log",),
    "catenary.loop": ("Law", "LawRun", "Network", "Stream"),
    "catenary.loop.timing": ("Timing",),
    "catenary.loop.watches.external_clock": ("ExternalClockWatch",),
    "catenary.loop.watches.trigger": ("TriggerWatch",),
    "catenary.machine.variables": ("Variables",),
    "catenary.model.device": ("Identity",),
    "catenary.model.diagnosis_history": ("HistoryMessage", "SyncCounters", "SyncCounter"),
    "catenary.model.finding": ("Finding",),
    "catenary.plan.stop_reason": ("StopReason",),
    "catenary.procedure.al_state": ("DeviceState",),
    "catenary.remote.messages": (
        *("Hello", "Device", "Port", "Axis", "Objects", "ObjectEntry", "SdoValue", "State"),
        *(
            "DiagnosisResult",
            "Problem",
            "EmergencyEntry",
            "Events",
            "EventEntry",
            "Timing",
            "Figures",
        ),
        *("Clocks", "ClockEntry", "Text", "LawEntry", "Parameter", "Modes", "Done"),
    ),
    "catenary.wire.al": ("AlState",),
    "catenary.wire.cia402": ("AxisState",),
    "catenary.wire.eoe_address": ("EthernetAddress", "MacFilter"),
}


def public_names() -> set[str]:
    """Return the full names, such as `catenary.MainDevice` and `catenary.drive.Move`."""
    found: dict[int, str] = {}
    add(found, "catenary")
    for name in (*MODULES, *PLAIN):
        add(found, f"catenary.{name}")
    returned = {f"{module}.{name}" for module, names in RETURNED.items() for name in names}
    return (set(found.values()) - INTERNAL) | returned


def add(found: dict[int, str], name: str) -> None:
    """Add the names of a module whose objects are not known yet."""
    module = import_module(EVENTS if name == "catenary.events" else name)
    for each in getattr(module, "__all__", None) or own_names(module):
        value = getattr(module, each)
        if not isinstance(value, ModuleType):
            found.setdefault(id(value), f"{name}.{each}")


def own_names(module: ModuleType) -> list[str]:
    """Return the names that a module without `__all__` defines."""
    own = [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and not isinstance(value, TypeVar)
        and getattr(value, "__module__", None) == module.__name__
    ]
    # the function of a fault is its class under another name, which comes later
    words = {id(getattr(module, name)): name for name in own}
    return [name for name in own if words[id(getattr(module, name))] == name]
