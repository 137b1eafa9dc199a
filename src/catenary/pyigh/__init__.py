"""The published interface of PyIgH: a loop of single calls, one for each step of a cycle.

    master = MasterBase("igh:0")
    servo = SlaveServo(0)
    master.ecat_init_slave(servo)
    master.ecat_activate_domain()
    master.ecat_activate_master()

Over the IgH kernel master every `ecat_*` is one call of libethercat, the GIL held by whoever calls;
over any other MainDevice ("virtual", a `Segment`, "eth0") the same program runs by our own frames.
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
