"""The cyclic loop: from process-data requests to `for cycle in loop`, and control laws."""

from catenary.core import Cycle
from catenary.loop.capture_options import CaptureOptions
from catenary.loop.external_clock import ExternalClock
from catenary.loop.laws.law import Law, Parameter, law
from catenary.loop.laws.run import LawRun
from catenary.loop.loop import Loop
from catenary.loop.network import Network
from catenary.loop.options import ClockOptions, Scheduling, StopPolicy
from catenary.loop.stream import Stream

__all__ = [
    "CaptureOptions",
    "ClockOptions",
    "Cycle",
    "ExternalClock",
    "Law",
    "LawRun",
    "Loop",
    "Network",
    "Parameter",
    "Scheduling",
    "StopPolicy",
    "Stream",
    "law",
]
