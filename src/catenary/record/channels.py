"""The channels of a file, and the fields of the rows that each one carries.

    /NAME/joint_states    sensor_msgs/JointState    position, velocity, effort as measured
    /NAME/joint_commands  sensor_msgs/JointState    the same as sent to the drives
    /NAME/cycle           catenary_msgs/Cycle       all the rest: timing, flags, states, inputs ...
    /NAME/log             rcl_interfaces/Log        events, in words
    /NAME/events          std_msgs/String           events, as JSON

All is CDR with its definition in the file, so any reader of ROS 2 bags reads it, and PlotJuggler
and Foxglove know joints by their names. catenary_msgs/Cycle depends on the loop: its definition is
the file's own.
"""

from __future__ import annotations

import keyword
import re
from dataclasses import dataclass
from math import prod

import numpy as np

from catenary.errors import RecordingError
from catenary.record.cdr import CdrLayout, CdrMessage, Rows
from catenary.record.definitions import (
    JOINT_STATE,
    TYPES,
    Definition,
    make_definition,
)
from catenary.record.layout import Field, Layout

JOINT_CHANNELS = {  # topic: ROS's name → the row's
    "joint_states": {"position": "position", "velocity": "velocity", "effort": "torque"},
    "joint_commands": {
        "position": "commanded_position",
        "velocity": "commanded_velocity",
        "effort": "commanded_torque",
    },
}
FORMAT, OLD_FORMAT = "2", "1"
SECOND_NS = 1_000_000_000
INFO, WARNING, ERROR = 20, 30, 40  # of rcl_interfaces/Log


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel with one message for each row.

    `fields`: field of the message → field of the row. `instants`: the same for fields of type
    builtin_interfaces/Time.
    """

    topic: str
    definition: Definition
    message: CdrMessage
    fields: dict[str, str]
    instants: dict[str, str]

    def encode(self, rows: Rows, times_ns: np.ndarray[tuple[int], np.dtype[np.int64]]) -> bytes:
        """Return one message for each row. `times_ns`: UTC times, one for each row."""
        columns = {name: rows[source] for name, source in self.fields.items()}
        columns["sec"], columns["nanosec"] = np.divmod(times_ns, SECOND_NS)
        for name, source in self.instants.items():
            columns[f"{name}.sec"], columns[f"{name}.nanosec"] = np.divmod(rows[source], SECOND_NS)
        return self.message.encode(columns, len(rows))

    def decode(self, messages: bytes, rows: Rows) -> None:
        """Write the fields of messages into rows, one row for each message."""
        values = self.message.decode(messages)
        for name, source in self.fields.items():
            rows[source] = values[name]
        for name, source in self.instants.items():
            seconds = values[f"{name}.sec"].astype(np.int64)
            rows[source] = seconds * SECOND_NS + values[f"{name}.nanosec"]


def topic(layout: Layout, name: str) -> str:
    return f"/{_ros_name(layout.name)}/{name}"


def is_event(topic: str) -> bool:
    """Return True if the topic carries events rather than cycles."""
    return topic.endswith(("/log", "/events"))


def make_channels(layout: Layout, format_: str = FORMAT) -> list[Channel]:
    """Return the channels of a layout; each field is in exactly one channel.

    In format 1, times were integers. PlotJuggler refuses integers beyond 2^53, which a machine
    reaches after 104 days.
    """
    joints = [
        _joint_channel(layout, name, fields)
        for name, wanted in JOINT_CHANNELS.items()
        if (fields := {ros: row for ros, row in wanted.items() if layout.of_axes(row)})
    ]
    carried = {row for channel in joints for row in channel.fields.values()}
    rest = [field for field in layout.fields if field.name not in carried]
    return [*joints, _cycle_channel(layout, rest, has_instants=format_ != OLD_FORMAT)]


def encode_log(time_ns: int, level: int, name: str, message: str, number: int) -> bytes:
    """Encode a rcl_interfaces/Log. `line` is the cycle's number, limited to 32 bits."""
    layout = CdrLayout()
    layout.field("sec", "<i4")
    layout.field("nanosec", "<u4")
    layout.field("level", "u1")
    for text in (name, message, "", ""):  # file and function are empty
        layout.text(text)
    layout.field("line", "<u4")
    sec, nanosec = divmod(time_ns, SECOND_NS)
    values = {"sec": sec, "nanosec": nanosec, "level": level, "line": number & 0xFFFFFFFF}
    return layout.make().encode({key: np.array([value]) for key, value in values.items()}, 1)


def encode_text(text: str) -> bytes:
    """Encode a std_msgs/String."""
    layout = CdrLayout()
    layout.text(text)
    return layout.make().constant


def decode_text(message: bytes) -> str:
    """Return the text of a std_msgs/String."""
    return message[8:-1].decode()


def _with_header(layout: Layout) -> CdrLayout:
    message = CdrLayout()
    message.field("sec", "<i4")
    message.field("nanosec", "<u4")
    message.text(layout.name)  # frame_id
    return message


def _joint_channel(layout: Layout, name: str, fields: dict[str, str]) -> Channel:
    message = _with_header(layout)
    message.texts(layout.axes)
    for quantity in ("position", "velocity", "effort"):
        message.sequence(quantity, "<f8", len(layout.axes) if quantity in fields else 0)
    return Channel(topic(layout, name), JOINT_STATE, message.make(), fields, {})


def _cycle_channel(layout: Layout, rest: list[Field], *, has_instants: bool) -> Channel:
    message = _with_header(layout)
    fields: dict[str, str] = {}
    instants: dict[str, str] = {}
    lines: list[tuple[str, str, int | None, str]] = []
    for field in rest:
        if has_instants and (field.dtype, field.shape, field.unit) == ("<i8", (), "ns"):
            name = _unused(_ros_name(field.name.removesuffix("_ns")), {**fields, **instants})
            message.field(f"{name}.sec", "<i4")
            message.field(f"{name}.nanosec", "<u4")
            instants[name] = field.name
            lines.append((name, "builtin_interfaces/Time", None, "of the loop's clock"))
            continue
        name = _unused(_ros_name(field.name), {**fields, **instants})
        length = prod(field.shape) if field.shape else None
        message.field(name, field.dtype, field.shape)
        fields[name] = field.name
        lines.append((name, _ros_type(layout, field), length, _comment(field)))
    definition = make_definition("catenary_msgs/msg/Cycle", lines)
    return Channel(topic(layout, "cycle"), definition, message.make(), fields, instants)


def _ros_type(layout: Layout, field: Field) -> str:
    dtype = np.dtype(field.dtype)
    code = f"{dtype.kind}{dtype.itemsize}"
    if code not in TYPES or 0 in field.shape or dtype.byteorder == ">":
        raise RecordingError(
            f"{layout.name}: field {field.name!r} of {field.dtype} {field.shape} is no message's",
            hint="recorded are little endian numbers of 1 to 8 bytes, and arrays of them",
        )
    return TYPES[code]


def _comment(field: Field) -> str:
    unit = f"[{field.unit}]" if field.unit else ""
    axes = "one for each axis" if field.per_axis else ""
    return ", ".join(filter(None, (unit, axes)))


def _ros_name(name: str) -> str:
    """Return a valid ROS name: lower case, digits, single underscores, a letter first."""
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    usable = plain[:1].isalpha() and not keyword.iskeyword(plain)  # messages become classes
    return plain if usable else f"x_{plain}".rstrip("_")


def _unused(name: str, taken: dict[str, str]) -> str:
    reserved = {"header", "sec", "nanosec", *taken}
    candidates = (name if n == 1 else f"{name}_{n}" for n in range(1, len(reserved) + 2))
    return next(each for each in candidates if each not in reserved)
