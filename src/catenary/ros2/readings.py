"""Messages made from the cycles of shares: joints, sensors and process data."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from catenary.ros2 import messages
from catenary.ros2.config import Imu, JointStates, ProcessData, Vector, Wrench
from catenary.ros2.source import stamp_ns, value_of
from catenary.share import Reader, ShareLayout

NOT_MEASURED = (-1.0, *(0.0,) * 8)  # convention of sensor_msgs/Imu


class InvalidReading(Exception):
    """A sample that must not be published; its text is the reason."""


def make_header(time_ns: int, frame: str) -> messages.Header:
    """Return the header of a message.

    Args:
        time_ns: time of the message [ns].
        frame: coordinate frame.
    """
    return messages.Header(messages.Time.from_ns(time_ns), frame)


def joint_names(layout: ShareLayout, joints: Mapping[str, str]) -> list[str]:
    """Return the name of the joint of each axis.

    Args:
        layout: layout of the share.
        joints: names of joints by axis. The other joints have the name of their axis.

    Raises:
        ValueError: An axis does not exist, or two joints have one name.
    """
    unknown = [name for name in joints if name not in layout.axes]
    if unknown:
        raise ValueError(
            f"joints: there is no axis {unknown[0]!r}; the axes are {', '.join(layout.axes)}"
        )
    names = [joints.get(axis, axis) for axis in layout.axes]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"joints: two axes have the joint name {twice[0]!r}")
    return names


def joint_state(
    config: JointStates, reader: Reader, row: np.void, names: Sequence[str]
) -> messages.JointState:
    """Return the actual values of all axes.

    Args:
        config: configuration of the topic.
        reader: reader of the share.
        row: a cycle.
        names: names of the joints.

    Raises:
        ValueError: The field of the efforts does not have one number per axis.
    """
    effort = np.atleast_1d(value_of(row, config.effort))
    if len(effort) != len(names):
        raise ValueError(f"{config.effort!r} has {len(effort)} numbers for {len(names)} joints")
    return messages.JointState(
        header=make_header(stamp_ns(reader, row), config.frame),
        name=list(names),
        position=row["position"].tolist(),
        velocity=row["velocity"].tolist(),
        effort=effort.astype(np.float64).tolist(),
    )


def wrench(config: Wrench, reader: Reader, row: np.void) -> messages.WrenchStamped:
    """Return the sample of a force/torque sensor.

    Args:
        config: configuration of the topic.
        reader: reader of the sensor's share.
        row: a sample.

    Raises:
        InvalidReading: The sample is invalid or too old.
        ValueError: The share lacks a field.
    """
    check_sample(reader, row, config.max_age)
    return messages.WrenchStamped(
        header=make_header(stamp_ns(reader, row), config.frame),
        wrench=messages.Wrench(force=vector(row, config.force), torque=vector(row, config.torque)),
    )


def imu(config: Imu, reader: Reader, row: np.void) -> messages.Imu:
    """Return the sample of an inertial sensor; the arguments and errors are those of `wrench`."""
    check_sample(reader, row, config.max_age)
    known = config.orientation is not None
    x, y, z, w = numbers(row, config.orientation) if config.orientation else (0.0, 0.0, 0.0, 1.0)
    return messages.Imu(
        header=make_header(stamp_ns(reader, row), config.frame),
        orientation=messages.Quaternion(x=x, y=y, z=z, w=w),
        orientation_covariance=messages.ZEROS_9 if known else NOT_MEASURED,
        angular_velocity=vector(row, config.angular_velocity),
        linear_acceleration=vector(row, config.linear_acceleration),
    )


def check_sample(reader: Reader, row: np.void, max_age: float) -> None:
    """Raise InvalidReading if a sample is flagged invalid or is too old.

    Args:
        reader: reader of the sensor's share.
        row: a sample.
        max_age: largest age [s]. Without an effect in virtual time.
    """
    if "valid" in (row.dtype.names or ()) and not row["valid"]:
        raise InvalidReading("the sensor reports invalid data")
    age = (time.monotonic_ns() - int(row["scheduled_ns"])) * 1e-9
    if reader.layout.clock == "monotonic" and age > max_age:
        raise InvalidReading(f"the sample is {age:.3f} s old; the limit is {max_age:g} s")


def numbers(row: np.void, fields: Sequence[str]) -> list[float]:
    """Return the values of scalar fields.

    Args:
        row: a cycle.
        fields: names of fields or elements.

    Raises:
        InvalidReading: A value is not finite.
        ValueError: A field does not exist or is not a scalar.
    """
    values = []
    for field in fields:
        value = value_of(row, field)
        if np.ndim(value):
            raise ValueError(f"{field!r} has {len(value)} elements; name one: {field}[0]")
        values.append(float(value))
    if not all(map(math.isfinite, values)):
        raise InvalidReading(f"not a finite number in {', '.join(fields)}")
    return values


def vector(row: np.void, fields: Vector) -> messages.Vector3:
    """Return a field of three numbers, or three fields, as a vector.

    Args:
        row: a cycle.
        fields: name of one field, or of three.

    Raises:
        InvalidReading: A value is not finite.
        ValueError: A field does not exist or has another shape.
    """
    if isinstance(fields, str):
        size = np.size(value_of(row, fields))
        if size != 3:
            raise ValueError(f"{fields!r} has {size} numbers instead of 3")
        fields = (f"{fields}[0]", f"{fields}[1]", f"{fields}[2]")
    x, y, z = numbers(row, fields)
    return messages.Vector3(x=x, y=y, z=z)


def process_value(config: ProcessData, row: np.void) -> Any:
    """Return a field of a cycle as a standard message.

    Args:
        config: configuration of the topic.
        row: a cycle.

    Raises:
        InvalidReading: The value is not finite.
        ValueError: The field does not exist, or does not fit the type.
    """
    if config.type == "float64_array":
        values = np.atleast_1d(value_of(row, config.field)).astype(np.float64)
        return messages.Float64MultiArray(data=values.tolist())
    kind, convert = SCALARS[config.type]
    numbers(row, (config.field,))  # checks the value
    return kind(data=convert(value_of(row, config.field)))


SCALARS: Mapping[str, tuple[Any, Callable[[Any], Any]]] = {
    "float64": (messages.Float64, float),
    "int64": (messages.Int64, int),
    "bool": (messages.Bool, bool),
}
TYPES: Mapping[str, Any] = {
    **{name: kind for name, (kind, _) in SCALARS.items()},
    "float64_array": messages.Float64MultiArray,
}
