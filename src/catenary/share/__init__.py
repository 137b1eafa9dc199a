"""Shared memory: cycles of a loop for other processes, commands from them, and a mutex.

with cat.Share("arm") as share, cat.Loop(arm, sink=share) as loop: ...      # one process
with cat.attach("arm") as arm: ...                                          # any other process
"""

from catenary.share.choice import Choice
from catenary.share.command_table import Reason
from catenary.share.commands import AxisCommand, LeaseEnd
from catenary.share.events import SharedEvent
from catenary.share.include import include_folder
from catenary.share.jog import Jog, JogStatus, RequestStatus, StateRequest
from catenary.share.layout import ShareField, ShareLayout
from catenary.share.lease import Lease
from catenary.share.mutex import Mutex
from catenary.share.operator_request import OperatorRequest
from catenary.share.process import Process
from catenary.share.reader import Reader, attach
from catenary.share.sweep import Sweep
from catenary.share.trigger import TriggerReceiver, TriggerSender

__all__ = [
    "AxisCommand",
    "Choice",
    "Jog",
    "JogStatus",
    "Lease",
    "LeaseEnd",
    "Mutex",
    "OperatorRequest",
    "Process",
    "Reader",
    "Reason",
    "RequestStatus",
    "ShareField",
    "ShareLayout",
    "SharedEvent",
    "StateRequest",
    "Sweep",
    "TriggerReceiver",
    "TriggerSender",
    "attach",
    "include_folder",
]
