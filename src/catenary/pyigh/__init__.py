"""The published interface of PyIgH: a loop of separate calls, one for each step of a cycle.

    master = MasterBase("igh:0")
    servo = SlaveServo(0)
    master.ecat_init_slave(servo)
    master.ecat_activate_domain()
    master.ecat_activate_master()

On the IgH kernel master, every `ecat_*` is one call of libethercat that holds the GIL. On any other
target ("virtual", a `Segment`, "eth0"), Catenary itself sends the frames of the same program.
`Loop` and `Drives` do the same with less code, and without the GIL.
"""

from catenary.pyigh.master import MasterBase, MasterStatus, SlaveInfo, SlaveState
from catenary.pyigh.slaves import SlaveBase, SlaveIO, SlaveServo

__all__ = [
    "MasterBase",
    "MasterStatus",
    "SlaveBase",
    "SlaveIO",
    "SlaveInfo",
    "SlaveServo",
    "SlaveState",
]
