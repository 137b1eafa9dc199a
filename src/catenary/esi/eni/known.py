"""Elements of an ENI that the reader interprets (ETG.2100, EtherCATConfig.xsd)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias, Union

# Children by tag. An empty table: the text or the attributes only. None: everything below is known.
Known: TypeAlias = Mapping[str, Union["Known", None]]

NOTHING: Known = {}


def _leaves(*tags: str) -> dict[str, Known]:
    return dict.fromkeys(tags, NOTHING)


PDO: Known = {
    **_leaves("Index", "Name", "Exclude", "ExcludedSm"),
    "Entry": _leaves("Index", "SubIndex", "BitLen", "Name", "Comment", "DataType"),
}
VALIDATE: Known = _leaves("Data", "DataMask", "Timeout")
REGISTER_COMMANDS: Known = {
    "InitCmd": {
        **_leaves("Transition", "BeforeSlave", "Comment", "Requires", "Cmd", "Adp", "Ado"),
        **_leaves("Addr", "Data", "DataLength", "Cnt", "Retries", "Timeout"),
        "Validate": VALIDATE,
    }
}
MAILBOX_COMMANDS: Known = {
    "InitCmd": _leaves(
        *("Transition", "Comment", "Timeout", "Ccs", "Index", "SubIndex", "Data", "Disabled"),
        *("OpCode", "DriveNo", "IDN", "Elements", "Attribute"),
    )
}
PROTOCOLS = ("CoE", "EoE", "FoE", "SoE", "AoE", "VoE")
SYNC_MANAGER: Known = _leaves(
    *("Type", "MinSize", "MaxSize", "DefaultSize", "StartAddress", "ControlByte", "Enable", "Pdo"),
    "Virtual",
)
AREA: Known = _leaves("Start", "Length", "PollTime", "StatusBitAddr", "ShortSend")
SLAVE: Known = {
    "Info": _leaves(
        *("Name", "PhysAddr", "AutoIncAddr", "Physics", "VendorId", "ProductCode", "RevisionNo"),
        *("SerialNo", "ProductRevision"),
    ),
    "ProcessData": {
        **dict.fromkeys(("Send", "Recv"), _leaves("BitStart", "BitLength")),
        **{f"Sm{number}": SYNC_MANAGER for number in range(16)},
        **dict.fromkeys(("RxPdo", "TxPdo"), PDO),
    },
    "Mailbox": {
        **dict.fromkeys(("Send", "Recv"), AREA),
        "BootStrap": dict.fromkeys(("Send", "Recv"), AREA),
        "Bootstrap": dict.fromkeys(("Send", "Recv"), AREA),
        "Protocol": NOTHING,
        **{
            protocol: {
                "InitCmds": MAILBOX_COMMANDS,
                "Profile": {
                    "ChannelInfo": _leaves("ProfileNo", "AddInfo"),
                    **_leaves("ProfileNo", "AddInfo"),
                },
                "NetId": NOTHING,
            }
            for protocol in PROTOCOLS
        },
    },
    "InitCmds": REGISTER_COMMANDS,
    "PreviousPort": _leaves("Port", "PhysAddr"),
    "HotConnect": None,
    "DC": _leaves(
        *("PotentialReferenceClock", "ReferenceClock", "CycleTime0", "CycleTime1", "ShiftTime"),
        "DCInUse",
    ),
}
VARIABLES: Known = {
    "ByteSize": NOTHING,
    "Variable": _leaves("Name", "Comment", "DataType", "BitSize", "BitOffs", "Index", "SubIndex"),
}
CONFIG: Known = {
    "Master": {
        "Info": _leaves("Name", "Destination", "Source", "EtherType"),
        "MailboxStates": _leaves("StartAddr", "Count"),
        "EoE": _leaves("MaxPorts", "MaxFrames", "MaxMACs"),
        "InitCmds": REGISTER_COMMANDS,
    },
    "Slave": SLAVE,
    "Cyclic": {
        **_leaves("Comment", "CycleTime", "Priority", "TaskId"),
        "Frame": {
            "Comment": NOTHING,
            "Cmd": {
                **_leaves("State", "Comment", "Cmd", "Adp", "Ado", "Addr", "Data", "DataLength"),
                **_leaves("Cnt", "InputOffs", "OutputOffs"),
                "CopyInfos": None,
            },
        },
    },
    "ProcessImage": dict.fromkeys(("Inputs", "Outputs"), VARIABLES),
}
