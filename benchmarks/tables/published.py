"""The published figures and their conditions.

Spreads are mean, max, min and sd; None if a value is not published.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from benchmarks.task_times import TaskTimes

FIGURES = ("mean", "max", "min", "sd")


class Spread(NamedTuple):
    mean: float
    max: float
    min: float
    sd: float | None = None


def spread_of(figures: Mapping[str, float], scale: float = 1.0) -> Spread:
    return Spread(*(figures[name] * scale for name in FIGURES))


# PyIgH, section 1: in-controller delay


class Phases(NamedTuple):
    """Period [ms], the others [us]."""

    period: Spread
    receive: Spread
    process: Spread
    send: Spread
    in_controller: Spread


PYIGH_CONDITIONS = (
    "theirs: i7-6600U, Linux 5.15.79-rt54, IgH with the generic driver, 3 servo drives, 1 kHz, "
    "600 000 cycles"
)
PYIGH: Mapping[str, Phases] = {
    "IgH, C++": Phases(
        Spread(1.000000, 1.027, 0.972, 0.000297),
        Spread(8.849, 44, 7, 0.446),
        Spread(0.001, 5, 0, 0.031),
        Spread(8.963, 64, 5, 0.287),
        Spread(17.812, 113, 12),
    ),
    "PyIgH": Phases(
        Spread(1.000000, 1.017, 0.984, 0.000518),
        Spread(46.772, 61, 43, 0.817),
        Spread(2.998, 19, 2, 0.158),
        Spread(31.341, 57, 29, 0.541),
        Spread(81.110, 137, 74),
    ),
    "PySOEM": Phases(
        Spread(1.000000, 1.063, 0.936, 0.000717),
        Spread(49.325, 120, 48, 0.886),
        Spread(2.988, 17, 2, 0.189),
        Spread(36.904, 102, 35, 0.910),
        Spread(89.217, 239, 85),
    ),
}
PYIGH_C = "IgH, C++"
PYIGH_CHI_SQUARED = {"PyIgH": 48.94, "PySOEM": 55.75}  # 29 degrees, critical 49.59 at 0.01

# PyIgH, section 2: six tasks of a six-axis cobot under cyclic torque control, 5 min, PREEMPT_RT

# "stop" is its sporadic error task, "ros2" its ROS 2 node.
COBOT: Mapping[str, TaskTimes] = {
    "dynamics": TaskTimes(
        (1.0, 1.041, 0.959, 0.007),
        (16.811, 48.328, 1.086, 4.346),
        (97.555, 165.733, 39.624, 17.978),
    ),
    "main control": TaskTimes(
        (1.0, 1.025, 0.975, 0.001),
        (1.686, 22.405, 1.028, 0.795),
        (225.162, 339.378, 133.508, 19.356),
    ),
    "trajectory": TaskTimes(
        (2.0, 2.035, 1.965, 0.002),
        (2.064, 32.46, 1.171, 1.216),
        (24.338, 455.232, 4.732, 46.769),
    ),
    "ros2": TaskTimes(
        (10.0, 10.116, 9.883, 0.026),
        (97.859, 198.234, 6.309, 19.451),
        (326.594, 836.576, 9.272, 82.731),
    ),
    "log": TaskTimes(
        (100.0, 100.502, 99.554, 0.082),
        (56.924, 504.362, 1.454, 60.639),
        (61.772, 513.557, 3.832, 61.281),
    ),
    "stop": TaskTimes(
        (1000.0, 1000.642, 999.292, 0.028426),
        (8.338, 352.268, 1.766, 28.426),
        (12.633, 358.615, 4.735, 28.872),
    ),
}
COBOT_UTILISATION = 0.737  # schedulable by rate-monotonic analysis

# TOCABI, section 4: two networks, 33 axes


class Channel(NamedTuple):
    """[us], as avg, max, min, sd; `overflows` in three hours."""

    latency: Spread
    send: Spread
    receive: Spread
    overflows: str


TOCABI_CONDITIONS = (
    "theirs: i7-10700, Xenomai, SOEM, a process and a core for each network, rings, 3 h"
)
TOCABI: Mapping[tuple[int, str], Channel] = {
    (4000, "upper, RTnet"): Channel(
        Spread(0.76, 10.64, -0.32, 0.34),
        Spread(2.94, 9.45, 1.88, 0.47),
        Spread(87.57, 105.57, 74.71, 2.69),
        "0",
    ),
    (4000, "upper, generic"): Channel(
        Spread(0.76, 136.12, -0.50, 0.43),
        Spread(16.46, 70.10, 9.63, 3.13),
        Spread(77.74, 305.33, 37.07, 2.94),
        "717",
    ),
    (4000, "lower, RTnet"): Channel(
        Spread(2.40, 13.30, -0.23, 0.70),
        Spread(5.40, 16.57, 2.16, 0.98),
        Spread(74.76, 91.10, 63.66, 2.43),
        "0",
    ),
    (4000, "lower, generic"): Channel(
        Spread(1.13, 33.27, -0.17, 0.61),
        Spread(15.26, 155.93, 10.07, 1.71),
        Spread(69.02, 251.26, 27.51, 2.91),
        "1",
    ),
    (8000, "upper, RTnet"): Channel(
        Spread(1.46, 15.48, -0.30, 0.66),
        Spread(4.68, 18.05, 2.13, 1.15),
        Spread(88.24, 107.30, 74.52, 2.88),
        "0",
    ),
    (8000, "upper, generic"): Channel(
        Spread(11.96, 495.57, -0.49, 42.15),
        Spread(13.26, 113.19, 8.67, 2.15),
        Spread(88.16, 516.77, 6.14, 34.72),
        "7.28 million",
    ),
    (8000, "lower, RTnet"): Channel(
        Spread(1.44, 13.54, -0.30, 0.66),
        Spread(4.81, 22.47, 2.13, 0.66),
        Spread(75.69, 125.28, 61.19, 2.75),
        "0",
    ),
    (8000, "lower, generic"): Channel(
        Spread(0.74, 172.83, -0.50, 0.62),
        Spread(12.47, 197.65, 9.08, 1.59),
        Spread(69.70, 278.65, 24.93, 1.77),
        "9102",
    ),
}

# Real-time tasks in Python, section 3: three busy tasks


class Times(NamedTuple):
    """Period and response [ms]."""

    period: Spread
    response: Spread


TASKS_CONDITIONS = (
    "theirs: Raspberry Pi 4, RT-Preempt, one isolated core, 10 min; stress-ng 100 % CPU, 70 % "
    "memory"
)
TASKS: Mapping[tuple[str, str], tuple[Times, Times, Times]] = {
    ("idle", "C"): (
        Times(Spread(10.000, 10.048, 9.954, 0.003), Spread(3.008, 3.056, 3.006, 0.002)),
        Times(Spread(20.000, 20.051, 19.948, 0.004), Spread(8.017, 8.067, 8.014, 0.003)),
        Times(Spread(40.000, 40.051, 39.949, 0.004), Spread(29.021, 29.068, 29.019, 0.003)),
    ),
    ("idle", "Python"): (
        Times(Spread(10.000, 10.088, 9.918, 0.023), Spread(3.064, 3.190, 3.041, 0.016)),
        Times(Spread(20.000, 20.222, 19.783, 0.038), Spread(8.136, 8.399, 8.106, 0.020)),
        Times(Spread(40.000, 40.312, 39.693, 0.013), Spread(29.184, 29.441, 29.135, 0.013)),
    ),
    ("stress", "C"): (
        Times(Spread(10.000, 10.068, 9.935, 0.009), Spread(3.018, 3.082, 3.007, 0.007)),
        Times(Spread(19.999, 20.068, 19.929, 0.014), Spread(8.035, 8.100, 8.018, 0.008)),
        Times(Spread(40.000, 40.058, 39.935, 0.010), Spread(29.041, 29.101, 29.028, 0.007)),
    ),
    ("stress", "Python"): (
        Times(Spread(10.000, 10.262, 9.715, 0.064), Spread(3.216, 3.459, 3.060, 0.066)),
        Times(Spread(20.000, 20.298, 19.646, 0.082), Spread(8.474, 8.751, 8.219, 0.067)),
        Times(Spread(40.000, 40.282, 39.702, 0.066), Spread(29.636, 29.871, 29.287, 0.069)),
    ),
}

# Real-time tasks in Python, EtherCAT part: two digital outputs

SKEW_CONDITIONS = "theirs: Raspberry Pi 4, RT-Preempt, 3 servo drives and 2 digital outputs, 1 kHz"
SKEW = Spread(1.45, 2.5, 0.68, 0.18)  # [us]

# RtEML, section 5

RTEML_CONDITIONS = "theirs: INtime on Windows, frames of 60 bytes, 5702 captured packets"
RTEML_PACKETS, RTEML_INTERVAL_US = 5702, 200.0  # on average

# RDDA, section 5: a gripper with two drives at 2 kHz, SOEM, an isolated core without a real-time
# patch; Z. Yu, An EtherCAT-based real-time control system design for a remote-direct-drive 2-DOF
# manipulator, MSc thesis, Northeastern University, 2019; github.com/RoboticsCollaborative/RDDA

RDDA_CONDITIONS = "theirs: SOEM on an isolated core, no real-time patch, 2 drives, 2 kHz"
RDDA_CYCLES, RDDA_RATE = 10_000, 2000
RDDA_LATENCY_US = 100.0  # below, under load
RDDA_PERIOD_TOLERANCE = 0.1  # fraction of the period
RDDA_COLUMNS = ("following_error", "velocity_offset", "torque_offset")  # 0x60F4, 0x60B1, 0x60B2
RDDA_EXPERIMENTS: Mapping[str, str] = {
    "homing": "three phases against hard stops, by the torque",
    "stiffness": "0 to 20 N·m/rad, with a disturbance observer",
    "contact": "by current and by a momentum residual, no force sensor",
    "chirp": "corner at about 10 rad/s",
}
