"""Captures of EtherCAT traffic: what a master did, as a timeline of events.

The stages are: `file` (frames of a file), `pairing` (sent and returned frames), `transaction`
(datagrams), `master_follower` and `device_follower` (state), `timeline` (events).
"""

from catenary.capture.events import Device, Event, Master, Step
from catenary.capture.file import FileCounts
from catenary.capture.timeline import EventStream, MasterSummary, Timeline, read_timeline

__all__ = [
    "Device",
    "Event",
    "EventStream",
    "FileCounts",
    "Master",
    "MasterSummary",
    "Step",
    "Timeline",
    "read_timeline",
]
