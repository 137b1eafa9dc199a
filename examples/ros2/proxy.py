"""A ROS 2 program that commands a gripper through its topics, as RDDA's Python proxy does.

    python proxy.py home                          close and find the stops
    python proxy.py wave 0.3 0.5 --duration 10    amplitude [rad], frequency [Hz]
    python proxy.py stiffness 2.0 2.0             [N·m/rad]
    python proxy.py states                        print the joint states

It runs in a ROS 2 environment and needs nothing of Catenary. The other side is the bridge of the
gripper: `catenary ros2 gripper --config rdda.toml`. Services need the bridge to run with rclpy.
"""

import argparse
import math
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectoryPoint

RATE = 100.0  # [Hz] of commands; RDDA uses less than 500 Hz


class GripperProxy(Node):
    """Gripper in a namespace, by default that of rdda.toml."""

    def __init__(self, namespace="/rdda", patience=20.0):
        super().__init__("gripper_proxy", namespace=namespace)
        self.state = None  # newest JointState
        self.patience = patience  # [s] to wait for the bridge
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._commands = self.create_publisher(JointTrajectoryPoint, "joint_cmds", 1)
        self._stiffness = self.create_publisher(Float64MultiArray, "stiffness", 1)
        self._home = self.create_client(Trigger, "home")
        self.create_subscription(JointState, "joint_stats", self._received, 10)

    def _received(self, state):
        self.state = state

    def wait(self, condition, what):
        """Handle messages until the condition is true."""
        end = time.monotonic() + self.patience
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"{what} within {self.patience:g} s; is the bridge running?")
            self._executor.spin_once(timeout_sec=0.01)

    def positions(self):
        """Return the positions of the newest state [rad]."""
        self.wait(lambda: self.state is not None, "no joint state")
        return list(self.state.position)

    def home(self):
        """Find the hard stops. Return the text of the response."""
        self.wait(self._home.service_is_ready, "no service home")
        response = self._home.call_async(Trigger.Request())
        self.wait(response.done, "no response of home")
        if not response.result().success:
            raise RuntimeError(response.result().message)
        return response.result().message

    def set_stiffness(self, *stiffness):
        """Set the stiffness of each finger [N·m/rad]; RDDA permits 0 to 20."""
        if not all(0 <= each <= 20 for each in stiffness):
            raise ValueError(f"stiffness {stiffness} is outside 0 to 20 N·m/rad")
        self.wait(self._stiffness.get_subscription_count, "no subscription of the stiffness")
        self._stiffness.publish(Float64MultiArray(data=[float(each) for each in stiffness]))
        self.wait(lambda: self._stiffness.wait_for_all_acked(), "no acknowledgement")

    def wave(self, amplitude, frequency, duration):
        """Move all fingers by amplitude · (1 - cos(2π · frequency · t)) / 2 [rad, Hz, s]."""
        center = self.positions()
        self.wait(self._commands.get_subscription_count, "no subscription of the commands")
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < duration:
            phase = 2 * math.pi * frequency * now
            offset = amplitude * (1 - math.cos(phase)) / 2
            speed = amplitude * math.pi * frequency * math.sin(phase)
            point = JointTrajectoryPoint()
            point.positions = [each + offset for each in center]
            point.velocities = [speed] * len(center)
            self._commands.publish(point)
            self._executor.spin_once(timeout_sec=0)
            time.sleep(1 / RATE)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--namespace", default="/rdda", help="namespace of the bridge")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("home", help="find the hard stops")
    commands.add_parser("states", help="print the joint states")
    wave = commands.add_parser("wave", help="move harmonically")
    wave.add_argument("amplitude", type=float, help="[rad]")
    wave.add_argument("frequency", type=float, help="[Hz]")
    wave.add_argument("--duration", type=float, default=10.0, help="[s]")
    stiffness = commands.add_parser("stiffness", help="set the stiffness")
    stiffness.add_argument("values", type=float, nargs="+", help="[N·m/rad], one per finger")
    return parser.parse_args()


def main():
    given = arguments()
    rclpy.init(args=[])
    proxy = GripperProxy(given.namespace)
    try:
        if given.command == "home":
            print(proxy.home())
        elif given.command == "wave":
            proxy.wave(given.amplitude, given.frequency, given.duration)
        elif given.command == "stiffness":
            proxy.set_stiffness(*given.values)
        print("positions", [round(each, 4) for each in proxy.positions()])
    finally:
        proxy.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
