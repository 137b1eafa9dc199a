"""EtherCAT Network Information (ENI, ETG.2100): configuration of a bus, written by a configurator.

`read_eni` reads such a file. `read_start_up_list` reads the start-up list of one device, as TwinCAT
exports it.
"""

from __future__ import annotations

from catenary.esi.eni.reader import is_eni, read_eni
from catenary.esi.eni.start_up_list import read_start_up_list
from catenary.esi.eni.values import (
    EniClock,
    EniCyclicCommand,
    EniDevice,
    EniFile,
    EniMailbox,
    EniSyncManager,
    ImagePart,
    MailboxCommand,
    RegisterCommand,
    Validation,
    Variable,
)

__all__ = [
    "EniClock",
    "EniCyclicCommand",
    "EniDevice",
    "EniFile",
    "EniMailbox",
    "EniSyncManager",
    "ImagePart",
    "MailboxCommand",
    "RegisterCommand",
    "Validation",
    "Variable",
    "is_eni",
    "read_eni",
    "read_start_up_list",
]
