"""One example of each message type, with values that show a wrong order or alignment."""

from __future__ import annotations

from catenary.ros2.messages import (
    Bool,
    Clock,
    DiagnosticArray,
    DiagnosticStatus,
    Duration,
    Float64,
    Float64MultiArray,
    Header,
    Imu,
    Int64,
    JointState,
    JointTrajectory,
    JointTrajectoryPoint,
    KeyValue,
    MultiArrayDimension,
    MultiArrayLayout,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    String,
    Time,
    Vector3,
    Wrench,
    WrenchStamped,
)

HEADER = Header(Time(1_700_000_000, 123_456_789), "base")
NINE = tuple(float(number) for number in range(9))
FORCE, TORQUE = Vector3(1.0, 2.0, 3.0), Vector3(-4.0, -5.0, -6.0)
EXAMPLES = (
    String("größe"),
    Bool(True),
    Int64(-(2**40)),
    Float64(0.1),
    Float64MultiArray(MultiArrayLayout((MultiArrayDimension("joint", 2, 2),), 0), data=(1.5, -2.5)),
    Clock(Time(3, 4)),
    PoseStamped(HEADER, Pose(Point(1.0, 2.0, 3.0), Quaternion(0.1, 0.2, 0.3, 0.9))),
    Wrench(FORCE, TORQUE),
    WrenchStamped(HEADER, Wrench(FORCE, TORQUE)),
    Imu(HEADER, Quaternion(), (-1.0, *NINE[1:]), FORCE, NINE, TORQUE, NINE),
    JointState(HEADER, ("a", "joint_2"), (0.1, 0.2), (0.3, 0.4), ()),
    JointTrajectory(
        HEADER,
        ("a", "b", "c"),
        (
            JointTrajectoryPoint((1.0, 2.0, 3.0), (), (), (), Duration(0, 500_000_000)),
            JointTrajectoryPoint((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), time_from_start=Duration(1, 1)),
        ),
    ),
    JointTrajectoryPoint((1.0,), (0.5,), (), (2.0,), Duration(1, 5)),
    DiagnosticArray(
        HEADER,
        (
            DiagnosticStatus(2, "drive 1", "fault", "0x1001", (KeyValue("code", "0x8611"),)),
            DiagnosticStatus(0, "cable", "", "", ()),
        ),
    ),
)
