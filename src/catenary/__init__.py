"""Catenary: real-time EtherCAT for Python.

    import catenary as cat

    with cat.MainDevice("eth0") as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 0.1 * math.sin(cycle.time)

Names are imported on first use. `import catenary` is fast and does not import NumPy, whose threads
would prevent a process from entering a network namespace.
"""

# False at run time. Importing it from `typing` would take longer than the rest of this module. With
# the constant False, Jedi would not complete the names below.
TYPE_CHECKING = not __name__

if TYPE_CHECKING:
    from catenary import (
        control,
        drive,
        errors,
        esi,
        line,
        realtime,
        record,
        remote,
        sensors,
        share,
        types,
        virtual,
    )
    from catenary.bus import SubDevice
    from catenary.bus import event_types as events
    from catenary.drive import (
        Copies,
        Copy,
        DistributedClock,
        Drives,
        FsoeConnection,
        Inputs,
        Outputs,
        ProcessData,
        StartUp,
    )
    from catenary.errors import (
        CatenaryError,
        ClockError,
        DriveError,
        LawError,
        LinkError,
        LoopError,
        MoveError,
        StateError,
        WorkingCounterError,
    )
    from catenary.gateway import Gateway
    from catenary.link.interfaces import interfaces
    from catenary.loop import (
        CaptureOptions,
        ClockOptions,
        Cycle,
        ExternalClock,
        Loop,
        Parameter,
        Scheduling,
        StopPolicy,
        law,
    )
    from catenary.machine import Machine
    from catenary.remote import connect, connect_async
    from catenary.remote.share import Share
    from catenary.share import attach
    from catenary.target import MainDevice, clone
    from catenary.virtual import Segment

__version__ = "1.0.0rc1"

__all__ = [
    "CaptureOptions",
    "CatenaryError",
    "ClockError",
    "ClockOptions",
    "Copies",
    "Copy",
    "Cycle",
    "DistributedClock",
    "DriveError",
    "Drives",
    "ExternalClock",
    "FsoeConnection",
    "Gateway",
    "Inputs",
    "LawError",
    "LinkError",
    "Loop",
    "LoopError",
    "Machine",
    "MainDevice",
    "MoveError",
    "Outputs",
    "Parameter",
    "ProcessData",
    "Scheduling",
    "Segment",
    "Share",
    "StartUp",
    "StateError",
    "StopPolicy",
    "SubDevice",
    "WorkingCounterError",
    "attach",
    "clone",
    "connect",
    "connect_async",
    "control",
    "drive",
    "errors",
    "esi",
    "events",
    "interfaces",
    "law",
    "line",
    "realtime",
    "record",
    "remote",
    "sensors",
    "share",
    "types",
    "virtual",
]

_MODULES = (
    "control",
    "drive",
    "errors",
    "esi",
    "line",
    "realtime",
    "record",
    "remote",
    "sensors",
    "share",
    "types",
    "virtual",
)
_DRIVE = (
    "Copies",
    "Copy",
    "DistributedClock",
    "Drives",
    "FsoeConnection",
    "Inputs",
    "Outputs",
    "ProcessData",
    "StartUp",
)
_ERRORS = (  # errors that a loop raises; the others are in catenary.errors
    "CatenaryError",
    "ClockError",
    "DriveError",
    "LawError",
    "LinkError",
    "LoopError",
    "MoveError",
    "StateError",
    "WorkingCounterError",
)
_HOMES = {
    **dict.fromkeys(_ERRORS, "catenary.errors"),
    **dict.fromkeys(_DRIVE, "catenary.drive"),
    **dict.fromkeys(
        (
            "CaptureOptions",
            "ClockOptions",
            "Cycle",
            "ExternalClock",
            "Loop",
            "Parameter",
            "Scheduling",
            "StopPolicy",
            "law",
        ),
        "catenary.loop",
    ),
    "Gateway": "catenary.gateway",
    "Machine": "catenary.machine",
    "MainDevice": "catenary.target",
    "Segment": "catenary.virtual",
    "Share": "catenary.remote.share",
    "SubDevice": "catenary.bus",
    "attach": "catenary.share",
    "clone": "catenary.target",
    "connect": "catenary.remote",
    "connect_async": "catenary.remote",
    "interfaces": "catenary.link.interfaces",
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name in _MODULES:
        return import_module(f"catenary.{name}")
    if name == "events":
        return import_module("catenary.bus.event_types")
    if name not in _HOMES:
        from difflib import get_close_matches

        near = get_close_matches(name, __all__, n=1)
        guess = f"; did you mean {near[0]!r}?" if near and not name.startswith("_") else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{guess}", name=name)
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
