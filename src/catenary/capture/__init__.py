"""Captures of EtherCAT traffic: what a master did, as a timeline of events.

The stages are: `file` (frames of a file), `pairing` (sent and returned frames), `transaction`
(datagrams), `master_follower` and `device_follower` (state), `timeline` (events).
"""

from catenary.capture.clocks import ClockStatistics, ReferenceStatistics
from catenary.capture.contents import (
    AddressAssigned,
    ClockDifference,
    CyclicStart,
    DeviceCount,
    DeviceSilent,
    FramesLost,
    IdentityRead,
    NameRead,
    StateReached,
    StateRefused,
    StateRequest,
    WorkingCounterBack,
    WorkingCounterDrop,
)
from catenary.capture.cycles import CycleStatistics, LogicalDatagram
from catenary.capture.events import Device, Event, Master, Step
from catenary.capture.file import FileCounts
from catenary.capture.mailbox_contents import (
    EmergencyReceived,
    MailboxFault,
    MailboxMessage,
    SdoInformationRead,
    SdoTransfer,
)
from catenary.capture.register_contents import (
    EepromAssigned,
    EepromWrite,
    FmmuWrite,
    RegisterWrite,
    SyncManagerWrite,
    SyncUnitWrite,
)
from catenary.capture.spread import Spread
from catenary.capture.timeline import EventStream, MasterSummary, Timeline, read_timeline

__all__ = [
    "AddressAssigned",
    "ClockDifference",
    "ClockStatistics",
    "CycleStatistics",
    "CyclicStart",
    "Device",
    "DeviceCount",
    "DeviceSilent",
    "EepromAssigned",
    "EepromWrite",
    "EmergencyReceived",
    "Event",
    "EventStream",
    "FileCounts",
    "FmmuWrite",
    "FramesLost",
    "IdentityRead",
    "LogicalDatagram",
    "MailboxFault",
    "MailboxMessage",
    "Master",
    "MasterSummary",
    "NameRead",
    "ReferenceStatistics",
    "RegisterWrite",
    "SdoInformationRead",
    "SdoTransfer",
    "Spread",
    "StateReached",
    "StateRefused",
    "StateRequest",
    "Step",
    "SyncManagerWrite",
    "SyncUnitWrite",
    "Timeline",
    "WorkingCounterBack",
    "WorkingCounterDrop",
    "read_timeline",
]
