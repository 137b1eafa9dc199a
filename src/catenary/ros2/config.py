"""Configuration of the bridge: the tables of a file such as `ros2.toml`.

    node = "arm"
    namespace = "cell_1"
    joints = { "2 Servo" = "shoulder" }

    [joint_states]
    rate = 200.0

    [commands.trajectory]
    goal_tolerance = 0.01

Every key has a default. Rates are in hertz, times in seconds, angles in radians.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

Rate: TypeAlias = Annotated[float, Meta(gt=0.0, le=10_000.0)]
Seconds: TypeAlias = Annotated[float, Meta(gt=0.0, le=3600.0)]
Tolerance: TypeAlias = Annotated[float, Meta(ge=0.0)]
Text: TypeAlias = Annotated[str, Meta(min_length=1)]
Name: TypeAlias = Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
Topic: TypeAlias = Annotated[
    str, Meta(pattern=r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$")
]
Action: TypeAlias = Annotated[
    str, Meta(pattern=r"^((~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$")
]
Namespace: TypeAlias = Annotated[
    str, Meta(pattern=r"^(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$")
]
Three: TypeAlias = Annotated[tuple[Text, ...], Meta(min_length=3, max_length=3)]
Four: TypeAlias = Annotated[tuple[Text, ...], Meta(min_length=4, max_length=4)]
# A field of three numbers, or three fields. msgspec 0.22 crashes on the union of a constrained text
# and tuple[Text, Text, Text].
Vector: TypeAlias = Text | Three
Quantity: TypeAlias = Literal["position", "velocity", "torque"]
Profile: TypeAlias = Literal["", "rdda"]


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Table of the file. Unknown keys are errors."""


class JointStates(Table, frozen=True):
    """[joint_states]: sensor_msgs/JointState with the actual values of all axes."""

    on: bool = True
    topic: Topic = "joint_states"
    rate: Rate = 100.0
    frame: str = ""
    effort: Text = "torque"  # field of the share with one number per axis


class Diagnostics(Table, frozen=True):
    """[diagnostics]: diagnostic_msgs/DiagnosticArray. The topic is global by convention."""

    on: bool = True
    topic: Topic = "/diagnostics"
    rate: Rate = 1.0


class Clock(Table, frozen=True):
    """[clock]: rosgraph_msgs/Clock, published only for a loop in virtual time."""

    on: bool = True
    topic: Topic = "/clock"
    rate: Rate = 100.0


class Wrench(Table, frozen=True):
    """[[wrench]]: geometry_msgs/WrenchStamped from a sensor's share. Fields: [N], [N·m]."""

    share: Text
    topic: Topic = "wrench"
    frame: str = "tool0"
    force: Vector = "force"
    torque: Vector = "torque"
    rate: Rate = 100.0
    max_age: Seconds = 0.1  # an older sample is not published


class Imu(Table, frozen=True):
    """[[imu]]: sensor_msgs/Imu from a sensor's share. Fields: [rad/s], [m/s²], quaternion."""

    share: Text
    topic: Topic = "imu/data"
    frame: str = "imu_link"
    angular_velocity: Vector = "angular_velocity"
    linear_acceleration: Vector = "acceleration"
    orientation: Four | None = None  # x, y, z, w; None: unknown
    rate: Rate = 100.0
    max_age: Seconds = 0.1  # an older sample is not published


class ProcessData(Table, frozen=True):
    """[[process_data]]: a field of the share as a standard message.

    `field` is a name such as "pressure", or one element such as "input_bytes[3]".
    """

    field: Text
    topic: Topic
    type: Literal["float64", "int64", "bool", "float64_array"] = "float64"
    rate: Rate = 10.0


class Trajectory(Table, frozen=True):
    """[commands.trajectory]: trajectory_msgs/JointTrajectory. A tolerance of 0 is not checked."""

    on: bool = True
    topic: Topic = "joint_trajectory"
    action: Action = "~/follow_joint_trajectory"  # "": none; needs rclpy and control_msgs
    path_tolerance: Tolerance = 0.0  # [rad]
    goal_tolerance: Tolerance = 0.0  # [rad]
    goal_time: Tolerance = 0.0  # [s] after the end to reach the goal; 0: no limit


class Forward(Table, frozen=True):
    """[commands.forward]: std_msgs/Float64MultiArray, one set-point per axis."""

    on: bool = False
    topic: Topic = "forward_commands"
    quantity: Quantity = "position"
    timeout: Seconds = 0.1


class Point(Table, frozen=True):
    """[commands.point]: trajectory_msgs/JointTrajectoryPoint as a stream of set-points."""

    on: bool = False
    topic: Topic = "joint_cmds"
    timeout: Seconds = 0.1


class Pose(Table, frozen=True):
    """[commands.pose]: geometry_msgs/PoseStamped for a body of an MJCF model."""

    model: Text  # path of the MJCF file, relative to the configuration
    site: Text  # name of the site or body that moves to the pose
    joints: tuple[Text, ...] | None = None  # of the model, by axis; None: all
    topic: Topic = "target_pose"
    frame: str = "base_link"
    linear_speed: Annotated[float, Meta(gt=0.0)] = 0.1  # [m/s]
    angular_speed: Annotated[float, Meta(gt=0.0)] = 0.5  # [rad/s]
    timeout: Seconds = 0.5


class MappedJoint(Table, frozen=True):
    """[commands.joint_states.axes.NAME]: position of an axis, scale * joint + offset [rad]."""

    joint: Text  # name in the message
    scale: float = 1.0
    offset: float = 0.0  # [rad]
    minimum: float | None = None  # [rad]; the position is clamped
    maximum: float | None = None  # [rad]


class MappedJoints(Table, frozen=True):
    """[commands.joint_states]: sensor_msgs/JointState of a glove or another device."""

    axes: Annotated[dict[str, MappedJoint], Meta(min_length=1)]  # by the name of the axis
    topic: Topic = "glove/joint_states"
    timeout: Seconds = 0.2


class Commands(Table, frozen=True):
    """[commands]: commands that the bridge accepts."""

    on: bool = True
    axes: tuple[Text, ...] | None = None  # names of axes in the share; None: all
    # Set-points sent to the loop. They continue for 20 ms, so a lower rate would stop between them.
    rate: Annotated[float, Meta(ge=50.0, le=10_000.0)] = 250.0
    lease: Annotated[float, Meta(ge=0.05, le=10.0)] = 0.5  # duration of the lease
    trajectory: Trajectory = Trajectory()
    forward: Forward = Forward()
    point: Point = Point()
    pose: Pose | None = None
    joint_states: MappedJoints | None = None


class LawParameters(Table, frozen=True):
    """[[parameters]]: std_msgs/Float64MultiArray that sets parameters of the running law."""

    law: Text
    topic: Topic
    names: Annotated[tuple[Text, ...], Meta(min_length=1)]


class Services(Table, frozen=True):
    """[services]: enable, stop, home and reset as std_srvs/Trigger, and parameters of the node."""

    on: bool = True  # they need rclpy
    parameters: bool = True  # those of the running law, named LAW.NAME
    timeout: Seconds = 2.0


class Config(Table, frozen=True):
    """Whole configuration of a bridge."""

    node: Name = "catenary"
    namespace: Namespace = ""
    domain: Annotated[int, Meta(ge=0, le=232)] | None = None  # None: $ROS_DOMAIN_ID, else 0
    backend: Literal["auto", "cyclone", "rclpy"] = "auto"
    profile: Profile = ""
    joints: dict[str, Text] = {}  # name of the axis → name of the joint
    joint_states: JointStates = JointStates()
    diagnostics: Diagnostics = Diagnostics()
    clock: Clock = Clock()
    commands: Commands = Commands()
    services: Services = Services()
    wrench: tuple[Wrench, ...] = ()
    imu: tuple[Imu, ...] = ()
    process_data: tuple[ProcessData, ...] = ()
    parameters: tuple[LawParameters, ...] = ()


# RDDA's node (github.com/RoboticsCollaborative/rdda_interface) takes positions from a
# JointTrajectoryPoint and publishes a JointState at 500 Hz. Its ControlState has no standard type:
# the applied efforts are the `data` of a Float64MultiArray.
PROFILES: dict[str, dict[str, object]] = {
    "": {},
    "rdda": {
        "joint_states": {"topic": "joint_stats", "rate": 500.0},
        "commands": {
            "rate": 500.0,
            "trajectory": {"on": False},
            "point": {"on": True, "topic": "joint_cmds"},
        },
        "process_data": [
            {
                "field": "commanded_torque",
                "topic": "ctrl_stats",
                "type": "float64_array",
                "rate": 500.0,
            }
        ],
    },
}
