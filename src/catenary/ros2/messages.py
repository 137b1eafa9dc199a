"""ROS 2 message types that Catenary exchanges, with the field names of their `.msg` files.

The type of a field on the wire is the annotation's second argument, written as in a `.msg` file.
The hashes are those of REP 2016 (RIHS01). They are the same in Jazzy and Kilted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, NamedTuple

from msgspec import Struct

Int32 = Annotated[int, "int32"]
UInt32 = Annotated[int, "uint32"]
Byte = Annotated[int, "byte"]
Text = Annotated[str, "string"]
Double = Annotated[float, "float64"]
Doubles = Annotated[Sequence[float], "float64[]"]
Matrix3 = Annotated[Sequence[float], "float64[9]"]
Texts = Annotated[Sequence[str], "string[]"]

NANOSECONDS = 1_000_000_000
ZEROS_9 = (0.0,) * 9


class Time(Struct, frozen=True):
    """Time since the epoch of the node's clock [s, ns]."""

    sec: Int32 = 0
    nanosec: UInt32 = 0

    @classmethod
    def from_ns(cls, time_ns: int) -> Time:
        """Return the stamp of a time in nanoseconds."""
        return cls(*divmod(time_ns, NANOSECONDS))

    def to_ns(self) -> int:
        """Return the time in nanoseconds."""
        return self.sec * NANOSECONDS + self.nanosec


class Duration(Struct, frozen=True):
    """Duration [s, ns]. `sec` is negative and `nanosec` is not for a negative duration."""

    sec: Int32 = 0
    nanosec: UInt32 = 0

    @classmethod
    def from_seconds(cls, seconds: float) -> Duration:
        """Return the duration of a number of seconds, rounded to 1 ns."""
        return cls(*divmod(round(seconds * NANOSECONDS), NANOSECONDS))

    def to_seconds(self) -> float:
        """Return the duration in seconds."""
        return self.sec + self.nanosec / NANOSECONDS


class Header(Struct, frozen=True):
    """Stamp and coordinate frame of a message."""

    stamp: Time = Time()
    frame_id: Text = ""


class String(Struct, frozen=True):
    """Text."""

    data: Text = ""


class Bool(Struct, frozen=True):
    """Boolean."""

    data: Annotated[bool, "bool"] = False


class Int64(Struct, frozen=True):
    """Signed integer of 64 bits."""

    data: Annotated[int, "int64"] = 0


class Float64(Struct, frozen=True):
    """Floating-point number of 64 bits."""

    data: Double = 0.0


class MultiArrayDimension(Struct, frozen=True):
    """One dimension of a MultiArray."""

    label: Text = ""
    size: UInt32 = 0
    stride: UInt32 = 0


class MultiArrayLayout(Struct, frozen=True):
    """Dimensions of a MultiArray; usually empty."""

    dim: Sequence[MultiArrayDimension] = ()
    data_offset: UInt32 = 0


class Float64MultiArray(Struct, frozen=True):
    """Numbers; for commands one per joint."""

    layout: MultiArrayLayout = MultiArrayLayout()
    data: Doubles = ()


class Clock(Struct, frozen=True):
    """Simulated time, published on `/clock`."""

    clock: Time = Time()


class Vector3(Struct, frozen=True):
    """Vector."""

    x: Double = 0.0
    y: Double = 0.0
    z: Double = 0.0


class Point(Struct, frozen=True):
    """Position [m]."""

    x: Double = 0.0
    y: Double = 0.0
    z: Double = 0.0


class Quaternion(Struct, frozen=True):
    """Orientation as a unit quaternion."""

    x: Double = 0.0
    y: Double = 0.0
    z: Double = 0.0
    w: Double = 1.0


class Pose(Struct, frozen=True):
    """Position [m] and orientation."""

    position: Point = Point()
    orientation: Quaternion = Quaternion()


class PoseStamped(Struct, frozen=True):
    """Pose at a time in a coordinate frame."""

    header: Header = Header()
    pose: Pose = Pose()


class Wrench(Struct, frozen=True):
    """Force [N] and torque [N·m]."""

    force: Vector3 = Vector3()
    torque: Vector3 = Vector3()


class WrenchStamped(Struct, frozen=True):
    """Wrench at a time in a coordinate frame."""

    header: Header = Header()
    wrench: Wrench = Wrench()


class Imu(Struct, frozen=True):
    """Orientation, angular velocity [rad/s] and linear acceleration [m/s²].

    A covariance is a row-major matrix of 3 x 3. Zeros mean "unknown". The value -1 in its first
    element means that the sensor does not measure this quantity.
    """

    header: Header = Header()
    orientation: Quaternion = Quaternion()
    orientation_covariance: Matrix3 = ZEROS_9
    angular_velocity: Vector3 = Vector3()
    angular_velocity_covariance: Matrix3 = ZEROS_9
    linear_acceleration: Vector3 = Vector3()
    linear_acceleration_covariance: Matrix3 = ZEROS_9


class JointState(Struct, frozen=True):
    """Positions [rad, m], velocities [rad/s, m/s] and efforts [N·m, N], one element per joint.

    An empty sequence of numbers means "not measured".
    """

    header: Header = Header()
    name: Texts = ()
    position: Doubles = ()
    velocity: Doubles = ()
    effort: Doubles = ()


class JointTrajectoryPoint(Struct, frozen=True):
    """Target at a time after the start of a trajectory. Empty sequences are not commanded."""

    positions: Doubles = ()
    velocities: Doubles = ()
    accelerations: Doubles = ()
    effort: Doubles = ()
    time_from_start: Duration = Duration()


class JointTrajectory(Struct, frozen=True):
    """Trajectory of joints. It starts at the header's stamp, or at once if the stamp is 0."""

    header: Header = Header()
    joint_names: Texts = ()
    points: Sequence[JointTrajectoryPoint] = ()


class KeyValue(Struct, frozen=True):
    """Named value of a diagnostic status."""

    key: Text = ""
    value: Text = ""


class DiagnosticStatus(Struct, frozen=True):
    """State of one component."""

    OK: ClassVar[int] = 0
    WARN: ClassVar[int] = 1
    ERROR: ClassVar[int] = 2
    STALE: ClassVar[int] = 3

    level: Byte = 0
    name: Text = ""
    message: Text = ""
    hardware_id: Text = ""
    values: Sequence[KeyValue] = ()


class DiagnosticArray(Struct, frozen=True):
    """States of components at one time."""

    header: Header = Header()
    status: Sequence[DiagnosticStatus] = ()


class MessageType(NamedTuple):
    """ROS 2 name, class and type hash of a message."""

    name: str
    struct: type[Struct]
    rihs: str


MESSAGE_TYPES = (
    MessageType(
        "std_msgs/msg/String",
        String,
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    ),
    MessageType(
        "std_msgs/msg/Bool",
        Bool,
        "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    ),
    MessageType(
        "std_msgs/msg/Int64",
        Int64,
        "RIHS01_8cd1048c2f186b6bd9a92472dc1ce51723c0833a221e2b7aecfff111774f4b49",
    ),
    MessageType(
        "std_msgs/msg/Float64",
        Float64,
        "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
    ),
    MessageType(
        "std_msgs/msg/Float64MultiArray",
        Float64MultiArray,
        "RIHS01_1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f",
    ),
    MessageType(
        "rosgraph_msgs/msg/Clock",
        Clock,
        "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
    ),
    MessageType(
        "geometry_msgs/msg/PoseStamped",
        PoseStamped,
        "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    ),
    MessageType(
        "geometry_msgs/msg/Wrench",
        Wrench,
        "RIHS01_018e8519d57c16adbe97c9fe1460ef21fec7e31bc541de3d653a35895677ce52",
    ),
    MessageType(
        "geometry_msgs/msg/WrenchStamped",
        WrenchStamped,
        "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    ),
    MessageType(
        "sensor_msgs/msg/Imu",
        Imu,
        "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    ),
    MessageType(
        "sensor_msgs/msg/JointState",
        JointState,
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    ),
    MessageType(
        "trajectory_msgs/msg/JointTrajectory",
        JointTrajectory,
        "RIHS01_179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    ),
    MessageType(
        "trajectory_msgs/msg/JointTrajectoryPoint",
        JointTrajectoryPoint,
        "RIHS01_de8907036d8bd45aac6f30cc9044a3d4a329c42cbf719aff7d95a584cfa532d7",
    ),
    MessageType(
        "diagnostic_msgs/msg/DiagnosticArray",
        DiagnosticArray,
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    ),
)
# Packages of the messages that occur only inside of other messages
PACKAGE_OF_PART: dict[type[Struct], str] = {
    Time: "builtin_interfaces",
    Duration: "builtin_interfaces",
    Header: "std_msgs",
    MultiArrayDimension: "std_msgs",
    MultiArrayLayout: "std_msgs",
    Vector3: "geometry_msgs",
    Point: "geometry_msgs",
    Quaternion: "geometry_msgs",
    Pose: "geometry_msgs",
    KeyValue: "diagnostic_msgs",
    DiagnosticStatus: "diagnostic_msgs",
}
BY_STRUCT = {kind.struct: kind for kind in MESSAGE_TYPES}
BY_NAME = {kind.name: kind for kind in MESSAGE_TYPES}


def message_type(message: type[Struct]) -> MessageType:
    """Return the entry of a message class.

    Raises:
        TypeError: The class is not in the table.
    """
    try:
        return BY_STRUCT[message]
    except KeyError:
        raise TypeError(f"{message!r} is not a message of catenary.ros2.messages") from None


def dds_name(message: type[Struct]) -> str:
    """Return the DDS name of a message or part: `sensor_msgs::msg::dds_::JointState_`."""
    kind = BY_STRUCT.get(message)
    package = kind.name.partition("/")[0] if kind else PACKAGE_OF_PART[message]
    return f"{package}::msg::dds_::{message.__name__}_"
