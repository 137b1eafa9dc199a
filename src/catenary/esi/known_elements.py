"""Elements that the ESI reader interprets, and the search for all others.

The table follows ETG.2000 (EtherCATInfo.xsd and EtherCATBase.xsd, for example in the repository
DiamondLightSource/ethercat, etc/xml).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias, Union

from catenary.esi.xml import Element

# Children by tag. An empty table: the text or the attributes only. None: everything below is known.
Known: TypeAlias = Mapping[str, Union["Known", None]]

NOTHING: Known = {}
IMAGES: Known = dict.fromkeys(("Image16x14", "ImageFile16x14", "ImageData16x14"))
UNKNOWN_MAX = 1000  # paths in one device

PDO: Known = {
    **dict.fromkeys(("Index", "Name", "Exclude", "ExcludedSm"), NOTHING),
    "Entry": dict.fromkeys(("Index", "SubIndex", "BitLen", "Name", "Comment", "DataType"), NOTHING),
}
FLAGS: Known = dict.fromkeys(("Access", "Category", "PdoMapping", "Backup", "Setting"), NOTHING)
VALUES: Known = dict.fromkeys(
    (
        *("DefaultString", "DefaultData", "DefaultValue", "MinData", "MaxData"),
        *("MinValue", "MaxValue", "Unit"),
    ),
    NOTHING,
)
DICTIONARY: Known = {
    "DataTypes": {
        "DataType": {
            **dict.fromkeys(("Name", "BaseType", "Comment", "BitSize", "Index"), NOTHING),
            "ArrayInfo": dict.fromkeys(("LBound", "Elements"), NOTHING),
            "SubItem": {
                **dict.fromkeys(
                    ("SubIdx", "Name", "Type", "Comment", "BitSize", "BitOffs"), NOTHING
                ),
                **VALUES,
                "Flags": FLAGS,
            },
            "EnumInfo": dict.fromkeys(("Text", "Enum", "Comment"), NOTHING),
        }
    },
    "Objects": {
        "Object": {
            **dict.fromkeys(("Index", "Name", "Comment", "Type", "BitSize"), NOTHING),
            "Info": {**VALUES, "SubItem": {"Name": NOTHING, "Info": VALUES}},
            "Flags": FLAGS,
        }
    },
}
PROFILE: Known = {
    **dict.fromkeys(("ProfileNo", "AddInfo", "ChannelCount", "DictionaryFile"), NOTHING),
    "ChannelInfo": dict.fromkeys(("ProfileNo", "AddInfo", "DisplayName"), NOTHING),
    "Dictionary": DICTIONARY,
    "DiagMessages": {"DiagMessage": dict.fromkeys(("TextId", "MessageText"), NOTHING)},
}
INIT_COMMAND: Known = dict.fromkeys(
    ("Transition", "Index", "SubIndex", "Data", "Comment", "Timeout"), NOTHING
)
IDN_COMMAND: Known = dict.fromkeys(("Transition", "IDN", "Data", "Comment", "Timeout"), NOTHING)
MAILBOX: Known = {
    "CoE": {"InitCmd": INIT_COMMAND},
    "SoE": {"InitCmd": IDN_COMMAND},
    **dict.fromkeys(("AoE", "EoE", "FoE", "VoE"), NOTHING),
}
MAPPINGS: Known = {
    "AlternativeSmMapping": {"Name": NOTHING, "Sm": {"Pdo": NOTHING}},
}
SHARED: Known = {
    **dict.fromkeys(("Type", "Name"), NOTHING),
    "RxPdo": PDO,
    "TxPdo": PDO,
    "Mailbox": MAILBOX,
    "Profile": PROFILE,
    **IMAGES,
}
MODULE: Known = SHARED
TIMES = ("CycleTimeSync0", "ShiftTimeSync0", "CycleTimeSync1", "ShiftTimeSync1")
STATE_TIMEOUTS = ("PreopTimeout", "SafeopOpTimeout", "BackToInitTimeout", "BackToSafeopTimeout")
DEVICE: Known = {
    **SHARED,
    **dict.fromkeys(("HideType", "AlternativeType", "SubDevice", "Comment", "URL"), NOTHING),
    **dict.fromkeys(("GroupType", "Fmmu", "Sm"), NOTHING),
    "Vendor": {**dict.fromkeys(("Id", "Name", "Comment", "URL"), NOTHING), **IMAGES},
    "Info": {
        "Electrical": {"EBusCurrent": NOTHING},
        "StateMachine": {"Timeout": dict.fromkeys(STATE_TIMEOUTS, NOTHING)},
        "Mailbox": {"Timeout": dict.fromkeys(("RequestTimeout", "ResponseTimeout"), NOTHING)},
        "EtherCATController": dict.fromkeys(("DpramSize", "SmCount", "FmmuCount"), NOTHING),
        "VendorSpecific": {"TwinCAT": MAPPINGS, **MAPPINGS},
        "IdentificationAdo": NOTHING,
        "IdentificationReg134": NOTHING,
    },
    "VendorSpecific": {"TwinCAT": MAPPINGS},
    "Dc": {
        "OpMode": {
            **dict.fromkeys(("Name", "Desc", "AssignActivate", *TIMES), NOTHING),
            "Sm": dict.fromkeys(("SyncType", "CycleTime", "ShiftTime", "Pdo"), NOTHING),
        }
    },
    "Slots": {
        "Slot": {
            **dict.fromkeys(("Name", "ModuleIdent"), NOTHING),
            "ModuleClass": {
                **dict.fromkeys(("Class", "VendorId", "Name"), NOTHING),
                **IMAGES,
            },
            **IMAGES,
        }
    },
    "ESC": dict.fromkeys(("Reg0400", "Reg0410", "Reg0420"), NOTHING),
    "Eeprom": {
        **dict.fromkeys(("Data", "ByteSize", "ConfigData", "BootStrap"), NOTHING),
        "Category": dict.fromkeys(
            ("CatNo", "Data", "DataString", "DataUINT", "DataUDINT"), NOTHING
        ),
    },
}


def unknown_paths(element: Element, known: Known) -> tuple[str, ...]:
    """Return the paths of the elements that the reader does not interpret, each once.

    Args:
        element: The device or module.
        known: The table of its children.
    """
    found: dict[str, None] = {}
    _collect(element, known, "", found)
    return tuple(found)


def _collect(element: Element, known: Known, path: str, found: dict[str, None]) -> None:
    for child in element.children:
        below = known.get(child.tag, NOTHING)
        if child.tag not in known:
            if len(found) < UNKNOWN_MAX:
                found[path + child.tag] = None
        elif below is not None and child.children:
            _collect(child, below, f"{path}{child.tag}/", found)
