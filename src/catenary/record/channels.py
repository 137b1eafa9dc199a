"""Channels of an MCAP file, and the fields of the rows in each channel.

    /NAME/joint_states    sensor_msgs/JointState    measured position, velocity, effort
    /NAME/joint_commands  sensor_msgs/JointState    position, velocity, effort sent to the drives
    /NAME/cycle           catenary_msgs/Cycle       other fields: timing, flags, states, inputs ...
    /NAME/log             rcl_interfaces/Log        events as text
    /NAME/events          std_msgs/String           events as JSON

All messages are CDR, and the file contains their definitions. Any reader of ROS 2 bags can
therefore read them, and PlotJuggler and Foxglove show joints by name. The definition of
catenary_msgs/Cycle depends on the loop.
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

JOINT_CHANNELS = {  # topic: field of the message → field of the row
    "joint_states": {"position": "position", "velocity": "velocity", "effort": "torque"},
    "joint_commands": {
        "position": "commanded_position",
        "velocity": "commanded_velocity",
        "effort": "commanded_torque",
    },
}
FORMAT, OLD_FORMAT = "2", "1"
SECOND_NS = 1_000_000_000
INFO, WARNING, ERROR = 20, 30, 40  # levels of rcl_interfaces/Log


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel with one message per row.

    `fields` maps fields of the message to fields of the row. `instants` does the same for fields of
    type builtin_interfaces/Time.
    """

    topic: str
    definition: Definition
    message: CdrMessage
    fields: dict[str, str]
    instants: dict[str, str]

    def encode(self, rows: Rows, times_ns: np.ndarray[tuple[int], np.dtype[np.int64]]) -> bytes:
        """Encode one message per row.

        Args:
            rows: cycles to encode.
            times_ns: UTC time of each row [ns].

        Returns:
            Encoded messages, one after the other.
        """
        columns = {name: rows[source] for name, source in self.fields.items()}
        columns["sec"], columns["nanosec"] = np.divmod(times_ns, SECOND_NS)
        for name, source in self.instants.items():
            columns[f"{name}.sec"], columns[f"{name}.nanosec"] = np.divmod(rows[source], SECOND_NS)
        return self.message.encode(columns, len(rows))

    def decode(self, messages: bytes, rows: Rows) -> None:
        """Decode messages into rows.

        Args:
            messages: encoded messages, one after the other.
            rows: output, one row per message.
        """
        values = self.message.decode(messages)
        for name, source in self.fields.items():
            rows[source] = values[name]
        for name, source in self.instants.items():
            seconds = values[f"{name}.sec"].astype(np.int64)
            rows[source] = seconds * SECOND_NS + values[f"{name}.nanosec"]


def topic(layout: Layout, name: str) -> str:
    """Return the topic of a channel of the layout, such as "/arm/cycle" for "cycle"."""
    return f"/{ros_name(layout.name)}/{name}"


def is_event(topic: str) -> bool:
    """Return True if the topic carries events rather than cycles."""
    return topic.endswith(("/log", "/events"))


def make_channels(layout: Layout, format_: str = FORMAT) -> list[Channel]:
    """Return the channels of a layout. Each field is in exactly one channel.

    In format 1, times are integers. PlotJuggler rejects integers above 2^53, which a time in
    nanoseconds exceeds after 104 days of uptime.

    Args:
        layout: layout of the rows.
        format_: version of the file format.

    Raises:
        RecordingError: A field has a type or shape that cannot be recorded.
    """
    joints = [
        _joint_channel(layout, name, fields)
        for name, sources in JOINT_CHANNELS.items()
        if (fields := {ros: row for ros, row in sources.items() if layout.of_axes(row)})
    ]
    in_joints = {row for channel in joints for row in channel.fields.values()}
    rest = [field for field in layout.fields if field.name not in in_joints]
    return [*joints, _cycle_channel(layout, rest, has_instants=format_ != OLD_FORMAT)]


def encode_log(time_ns: int, level: int, name: str, message: str, number: int) -> bytes:
    """Encode an rcl_interfaces/Log message.

    Args:
        time_ns: UTC time [ns].
        level: level of rcl_interfaces/Log.
        name: name of the logger.
        message: text.
        number: number of the cycle. Its lower 32 bits are stored as the line.
    """
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
    """Encode a std_msgs/String message."""
    layout = CdrLayout()
    layout.text(text)
    return layout.make().constant


def decode_text(message: bytes) -> str:
    """Return the text of a std_msgs/String message."""
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
            name = _unused(ros_name(field.name.removesuffix("_ns")), {**fields, **instants})
            message.field(f"{name}.sec", "<i4")
            message.field(f"{name}.nanosec", "<u4")
            instants[name] = field.name
            lines.append((name, "builtin_interfaces/Time", None, "of the loop's clock"))
            continue
        name = _unused(ros_name(field.name), {**fields, **instants})
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
            f"{layout.name}: field {field.name!r} has dtype {field.dtype} and shape {field.shape}, "
            "which cannot be recorded",
            hint="use little-endian numbers of 1 to 8 bytes, or arrays of them",
        )
    return TYPES[code]


def _comment(field: Field) -> str:
    unit = f"[{field.unit}]" if field.unit else ""
    axes = "one for each axis" if field.per_axis else ""
    return ", ".join(filter(None, (unit, axes)))


def ros_name(name: str) -> str:
    """Return a valid ROS name.

    It begins with a letter, and contains lower-case letters, digits and single underscores.
    """
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    # MCAP readers generate Python classes from the definitions, so a keyword cannot be a name.
    usable = plain[:1].isalpha() and not keyword.iskeyword(plain)
    return plain if usable else f"x_{plain}".rstrip("_")


def _unused(name: str, taken: dict[str, str]) -> str:
    reserved = {"header", "sec", "nanosec", *taken}
    candidates = (name if n == 1 else f"{name}_{n}" for n in range(1, len(reserved) + 2))
    return next(each for each in candidates if each not in reserved)
