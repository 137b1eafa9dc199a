"""ROS 2 message definitions as MCAP stores them (schema encoding `ros2msg`).

The message comes first, then the types that it contains. The definitions of ROS messages are exact
copies of those of ROS, without comments.
"""

from __future__ import annotations

from dataclasses import dataclass

RULE = "=" * 80
TIME = """\
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
HEADER = f"""\
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
{TIME}"""


@dataclass(frozen=True, slots=True)
class Definition:
    """A message type: its name, and the definition needed to decode it."""

    name: str
    text: str


JOINT_STATE = Definition(
    "sensor_msgs/msg/JointState",
    f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{RULE}
{HEADER}""",
)

LOG = Definition(
    "rcl_interfaces/msg/Log",
    f"""\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
{RULE}
{TIME}""",
)

STRING = Definition("std_msgs/msg/String", "string data\n")

TYPES = {  # NumPy kind and size → ROS type
    "b1": "bool",
    "i1": "int8",
    "u1": "uint8",
    "i2": "int16",
    "u2": "uint16",
    "i4": "int32",
    "u4": "uint32",
    "i8": "int64",
    "u8": "uint64",
    "f4": "float32",
    "f8": "float64",
}


def make_definition(name: str, fields: list[tuple[str, str, int | None, str]]) -> Definition:
    """Return the definition of a message with a header and fields.

    Args:
        name: name of the type.
        fields: (name, type, length of the array, comment) of each field.
    """
    lines = ["std_msgs/Header header"]
    for field, kind, length, comment in fields:
        array = "" if length is None else f"[{length}]"
        lines.append(f"{kind}{array} {field}" + (f"  # {comment}" if comment else ""))
    return Definition(name, "\n".join([*lines, RULE, HEADER]))
