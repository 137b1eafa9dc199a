"""One machine of several: a loop, its share, and a bridge to ROS 2 in a process of its own.

python robot.py arm --name left                  # a virtual arm of six axes: /left/joint_states
python robot.py arm --name right --nic eth0      # a real one
python robot.py base --name base                 # two wheels: /base/wheel_velocities
python robot.py arm --external /dev/ptp0         # its cycles follow a PTP hardware clock
"""

import argparse
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import catenary as cat

HERE = Path(__file__).parent
ROLES = {  # options of the drives; limits [rad/s]
    "arm": {
        "names": ["base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3"],
        "mode": "csp",
        "velocity_limit": 2.0,
    },
    "base": {"names": ["left_wheel", "right_wheel"], "mode": "csv", "velocity_limit": 10.0},
}


@contextmanager
def bridge(name, namespace, role):
    """Run `catenary ros2` for a share during the block."""
    command = [sys.executable, "-m", "catenary.cli", "ros2", name, "--namespace", namespace]
    process = subprocess.Popen([*command, "--config", str(HERE / f"{role}.toml")])
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def run(role, name, namespace, nic, external, seconds):
    """Run the loop until `seconds` have passed (None: until Ctrl-C) or its bridge has ended."""
    servos = [cat.virtual.Servo() for _ in ROLES[role]["names"]]
    target = nic or cat.Segment([cat.virtual.Coupler(), *servos], clock="monotonic")
    # Virtual axes wait for the program on a busy machine. Real ones keep the default limits.
    stop = cat.StopPolicy() if nic else cat.StopPolicy(late_limit=0, lost_limit=20)
    clocks = cat.ClockOptions(external=external)
    with cat.MainDevice(target) as main, cat.Share(name, jog=True) as share:
        drives = cat.Drives(main.scan().drives, counts_per_turn=2**20, **ROLES[role])
        with cat.Loop(drives, period=2e-3, sink=share, stop=stop, clocks=clocks) as loop:
            with bridge(name, namespace, role) as process:
                for cycle in loop:
                    share.apply(drives)
                    if seconds is not None and cycle.time > seconds:
                        break
                    if cycle.number % 500 == 0 and process.poll() is not None:
                        break
            if external:
                print(loop.external)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("role", choices=ROLES, help="kind of robot")
    parser.add_argument("--name", help="name of its share; default: its role")
    parser.add_argument("--namespace", help="namespace of its topics; default: the name")
    parser.add_argument("--nic", help="network card; default: a virtual segment")
    parser.add_argument("--external", help='clock to follow: "/dev/ptp0" or "CLOCK_TAI"')
    parser.add_argument("--seconds", type=float, help="duration; default: until Ctrl-C")
    a = parser.parse_args()
    with suppress(KeyboardInterrupt):
        name = a.name or a.role
        run(a.role, name, a.namespace or name, a.nic, a.external, a.seconds)
