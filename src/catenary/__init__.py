"""Catenary: real-time EtherCAT for Python.

    import catenary as cat

    with cat.MainDevice("eth0") as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 0.1 * math.sin(cycle.time)

Names load when they are used: `import catenary` costs nothing and imports no NumPy, whose threads
would keep a process from entering a network namespace.
"""

TYPE_CHECKING = False  # of `typing`, which takes longer to import than all of this

if TYPE_CHECKING:
    from catenary import control, errors, realtime, share, types
    from catenary.bus import SubDevice
    from catenary.bus import event as events
    from catenary.drive import DistributedClock, Drives, Inputs, Outputs, Phase, Recovery
    from catenary.errors import (
        CatenaryError,
        ClockError,
        DriveError,
        LawError,
        LinkError,
        LoopError,
        StateError,
        WorkingCounterError,
    )
    from catenary.link.interfaces import interfaces
    from catenary.loop import ClockOptions, Cycle, Loop, Scheduling, StopPolicy, law
    from catenary.share import Share, attach
    from catenary.target import MainDevice
    from catenary.virtual import (
        AnalogInputs,
        Coupler,
        DigitalInputs,
        DigitalOutputs,
        Segment,
        Servo,
    )

__version__ = "0.1.0"

__all__ = [
    "AnalogInputs",
    "CatenaryError",
    "ClockError",
    "ClockOptions",
    "Coupler",
    "Cycle",
    "DigitalInputs",
    "DigitalOutputs",
    "DistributedClock",
    "DriveError",
    "Drives",
    "Inputs",
    "LawError",
    "LinkError",
    "Loop",
    "LoopError",
    "MainDevice",
    "Outputs",
    "Phase",
    "Recovery",
    "Scheduling",
    "Segment",
    "Servo",
    "Share",
    "StateError",
    "StopPolicy",
    "SubDevice",
    "WorkingCounterError",
    "attach",
    "control",
    "errors",
    "events",
    "interfaces",
    "law",
    "realtime",
    "share",
    "types",
]

_VIRTUAL = ("AnalogInputs", "Coupler", "DigitalInputs", "DigitalOutputs", "Segment", "Servo")
_ERRORS = (  # that a loop raises; the others are in catenary.errors
    "CatenaryError",
    "ClockError",
    "DriveError",
    "LawError",
    "LinkError",
    "LoopError",
    "StateError",
    "WorkingCounterError",
)
_HOMES = {
    **dict.fromkeys(_ERRORS, "catenary.errors"),
    "ClockOptions": "catenary.loop",
    "Cycle": "catenary.loop",
    "DistributedClock": "catenary.drive",
    "Drives": "catenary.drive",
    "Inputs": "catenary.drive",
    "Loop": "catenary.loop",
    "law": "catenary.loop",
    "MainDevice": "catenary.target",
    "Outputs": "catenary.drive",
    "Phase": "catenary.drive",
    "Recovery": "catenary.drive",
    "Share": "catenary.share",
    "Scheduling": "catenary.loop",
    "StopPolicy": "catenary.loop",
    "SubDevice": "catenary.bus",
    "attach": "catenary.share",
    "interfaces": "catenary.link.interfaces",
    **dict.fromkeys(_VIRTUAL, "catenary.virtual"),
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name in ("control", "errors", "realtime", "share", "types"):
        return import_module(f"catenary.{name}")
    if name == "events":
        return import_module("catenary.bus.event")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
