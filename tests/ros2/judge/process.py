"""Processes of nodes that tests command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

FOLDER = Path(__file__).resolve().parent
SOURCES = FOLDER.parents[2] / "src"
PATIENCE = 30.0  # [s], for discovery on a loaded machine
RELIABLE = ("reliable", "volatile", 10, None)
BEST_EFFORT = ("best_effort", "volatile", 10, None)


class NodeProcess:
    """A process that answers one JSON line per command.

    It starts in the background. The first command waits until it is ready, so that several
    processes start at the same time.
    """

    def __init__(self, command: list[str], environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **environment},
        )
        self._is_ready = False

    def ask(self, do: str, **arguments: Any) -> Any:
        """Send a command and return its answer."""
        if not self._is_ready:
            assert self._answer() == "ready"
            self._is_ready = True
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
        self.process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, f"process ended with {self.process.wait()}"
        return json.loads(line)["answer"]

    def end(self) -> None:
        """Close stdin, so that the node leaves the graph."""
        self.process.stdin.close()  # type: ignore[union-attr]
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.kill()
        self.process.stdout.close()  # type: ignore[union-attr]

    def kill(self) -> None:
        """Kill the process: the node disappears without leaving the graph."""
        self.process.kill()
        self.process.wait()


@dataclass(frozen=True)
class Graph:
    """One ROS 2 graph of a test: the judge's Python, our backend, and the DDS environment."""

    judge: Path
    kind: Literal["cyclone", "rclpy"]
    environment: dict[str, str]

    @contextmanager
    def peer(self, name: str = "judge", namespace: str = "", **extra: str) -> Iterator[NodeProcess]:
        """Start a node of rclpy."""
        command = [str(self.judge), str(FOLDER / "peer.py"), name, namespace]
        yield from ended(NodeProcess(command, {**self.environment, **extra}))

    @contextmanager
    def own(self, name: str = "own", namespace: str = "", **extra: str) -> Iterator[NodeProcess]:
        """Start a node of ours."""
        python = str(self.judge) if self.kind == "rclpy" else sys.executable
        command = [python, str(FOLDER / "own_node.py"), self.kind, name, namespace]
        path = {"PYTHONPATH": str(SOURCES)} if self.kind == "rclpy" else {}
        yield from ended(NodeProcess(command, {**self.environment, **path, **extra}))


def ended(node: NodeProcess) -> Iterator[NodeProcess]:
    try:
        yield node
    finally:
        node.end()


def eventually(condition: Callable[[], Any]) -> Any:
    """Return the first true value of the condition."""
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < end, f"not true within {PATIENCE:.0f} s"
        time.sleep(0.02)
    return value


def connect(
    publisher: NodeProcess, subscriber: NodeProcess, topic: str, kind: str, qos: Any = RELIABLE
) -> None:
    """Create both ends of a topic and wait until they match."""
    subscriber.ask("subscribe", topic=topic, type=kind, qos=qos)
    publisher.ask("advertise", topic=topic, type=kind, qos=qos)
    eventually(lambda: publisher.ask("matched", topic=topic))
