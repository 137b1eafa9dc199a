"""Processes of a test: servos, the program of the loop, the dashboard. Each is ended by its pid."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from tests.share.processes import DEADLINE

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(?P<role>\w+): (?P<link>https?://\S+#\S+)")


def with_parent(*command: str) -> list[str]:
    """Return a command (`-m MODULE ...`, `--exec PROGRAM ...`) that ends with this process."""
    return [sys.executable, "-m", "catenary.realtime.child", str(os.getpid()), *command]


class Process:
    """Owner of a process with pipes, in its own session."""

    def __init__(self, command: Sequence[str], **environment: str) -> None:
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, **environment},
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        return self.process.pid

    def line(self) -> str:
        """Return the next line of the output; "" at its end. Fail after DEADLINE."""
        assert self.process.stdout is not None
        until = time.monotonic() + DEADLINE
        text = ""
        while not text.endswith("\n"):
            left = max(until - time.monotonic(), 0.0)
            if not select.select([self.process.stdout], [], [], left)[0]:
                raise TimeoutError(f"{self.process.args!r} printed nothing for {DEADLINE:g} s")
            character = os.read(self.process.stdout.fileno(), 1).decode("latin-1")
            if not character:
                break
            text += character
        return text.strip()

    def ask(self, command: str) -> Any:
        """Send a command, and return the decoded answer."""
        self.tell(command)
        return json.loads(self.line())

    def tell(self, command: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()

    def signal(self, number: int) -> None:
        """Send a signal to the process and its children."""
        os.killpg(self.pid, number)

    def end(self) -> None:
        """End the process and its children, also if they are stopped."""
        if self.process.poll() is None:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(10.0)
        with contextlib.suppress(ProcessLookupError):
            self.signal(signal.SIGKILL)
        self.process.wait(DEADLINE)
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


@contextlib.contextmanager
def running(command: Sequence[str], **environment: str) -> Iterator[Process]:
    process = Process(command, **environment)
    try:
        yield process
    finally:
        process.end()


@contextlib.contextmanager
def python(*arguments: str) -> Iterator[Process]:
    """Run this interpreter, and wait until the program has printed "ready"."""
    with running(with_parent(*arguments)) as process:
        line = process.line()
        assert json.loads(line or "null") == "ready", f"{arguments} did not start: {line!r}"
        yield process


def servos_on(interface: str, names: Sequence[str]) -> contextlib.AbstractContextManager[Process]:
    """Serve servos on a network interface."""
    return python("-m", "tests.browser.cell", interface, json.dumps(list(names)))


def machine(
    share: str, names: Sequence[str], interface: str = "", *options: str
) -> contextlib.AbstractContextManager[Process]:
    """Run a loop with a share. Without an interface, the process also contains the servos."""
    arguments = (share, interface, json.dumps(list(names)), *options)
    return python("-m", "tests.browser.machine", *arguments)


class Dashboard:
    """Owner of a process `catenary dashboard`."""

    def __init__(self, process: Process) -> None:
        self.process = process
        self.links: dict[str, str] = {}  # role → address of the page with its token
        lines: list[str] = []
        while not lines or not lines[-1].startswith("The page is not"):
            lines.append(process.line())
            assert process.process.poll() is None, f"the dashboard ended: {lines}"
            if found := LINK.match(lines[-1]):
                self.links[found["role"]] = found["link"]

    @property
    def port(self) -> int:
        [port, *_] = [urlsplit(link).port for link in self.links.values()]
        assert port is not None
        return port


@contextlib.contextmanager
def dashboard(source: str, *options: str, port: int = 0) -> Iterator[Dashboard]:
    """Run `catenary dashboard` on a free port."""
    module = with_parent("-m", "catenary.cli", "dashboard")
    with running([*module, source, "--port", str(port), *options]) as process:
        yield Dashboard(process)
