"""The simulated humanoid in real time with the operator's page: `make humanoid HUMANOID=--page`.

The robot hangs in its gantry, stands up, and balances. In the page:

- select an operating mode, or run a preset of the arms
- push a body of the robot with the mouse
- press STOP: the drives stop and close their brakes, and the robot falls stiffly

After a fall, the joints brake, the drives stop, and the program ends.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from program import run
from run import Outcome, Setup
from scenarios import Scenario

from catenary.errors import ConfigurationError

CLOSING = 10.0  # [s] for the server to end, at most
PERIOD, SILENCE = 1e-3, 0.5  # [s]: for any machine, also without a real-time kernel


@contextmanager
def page(setup: Setup, port: int) -> Iterator[subprocess.Popen[bytes]]:
    """Serve the page during the block, and yield its process. It prints the links.

    Raises ConfigurationError if another program uses the port.
    """
    check_port(port)
    upper, lower = setup.shares
    command = [sys.executable, "-m", "catenary.cli", "dashboard", upper, "--also", lower]
    command += ["--base", setup.base, "--model", str(setup.model), "--port", str(port)]
    server = subprocess.Popen(command)
    try:
        yield server
    finally:
        server.terminate()
        try:
            server.wait(CLOSING)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()


def check_port(port: int) -> None:
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError as error:
        raise ConfigurationError(
            f"port {port} of the page: {error.strerror}",
            hint="end the program that uses it, or choose another one: --port 8711",
        ) from error


def operate(
    folder: Path, model: Path, name: str, seconds: float, port: int | None, *, ros2: bool = False
) -> Outcome:
    """Run the robot until `seconds` have passed, or until it has fallen.

    Args:
        folder: folder of the recordings.
        model: MJCF file of the body.
        name: prefix of its shares.
        seconds: duration after the bring-up [s].
        port: port of the page; None: no page.
        ros2: True to let the hands follow poses of ROS 2.
    """
    scenario = Scenario("operate", "the robot balances, and an operator commands it", seconds)
    setup = Setup(scenario, folder, model, name, False, PERIOD, SILENCE, ros2)
    if port is None:
        return run(setup)
    with page(setup, port):
        return run(setup)
