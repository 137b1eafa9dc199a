"""`catenary shell`: with -c, and in a pseudo-terminal."""

from __future__ import annotations

import importlib.util
import os
import pty
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

import catenary as cat
from catenary.cli.main import main
from catenary.virtual import Segment, demo_segment
from catenary.wire.al import AlState
from tests.remote.programs import program

Capture = pytest.CaptureFixture[str]
TIME_LIMIT = 60.0  # [s]


def test_code_sees_main_and_subs(capsys: Capture) -> None:
    code = "print(len(subs), subs[2].sdo.read(0x1018, 1, type=types.UDINT), main.subs is not None)"
    assert main(["shell", "virtual", "-c", code]) == 0
    assert capsys.readouterr().out == f"6 {0x43544E59} True\n"


def test_functions_in_the_code_see_its_names(capsys: Capture) -> None:
    code = "def names():\n    return [sub.position for sub in subs]\nprint(names())"
    assert main(["shell", "virtual", "-c", code]) == 0
    assert capsys.readouterr().out == "[0, 1, 2, 3, 4, 5]\n"


def test_a_syntax_error_is_a_wrong_command_line(capsys: Capture) -> None:
    assert main(["shell", "virtual", "-c", "print("]) == 2
    assert "CODE is not Python" in capsys.readouterr().err


def test_an_error_of_a_device_has_its_hint(capsys: Capture) -> None:
    assert main(["shell", "virtual", "-c", "subs[1].sdo.read(0x1000)"]) == 1
    assert "has no mailbox" in capsys.readouterr().err


def test_a_mistake_in_the_code_is_not_an_error_of_catenary(capsys: Capture) -> None:
    assert main(["shell", "virtual", "-c", "def f():\n    return subs[9]\nf() + 1 / 0"]) == 1
    error = capsys.readouterr().err
    assert error.startswith('Traceback (most recent call last):\n  File "<catenary shell -c>"')
    assert "internal error" not in error


def test_the_code_may_choose_the_exit_status() -> None:
    with pytest.raises(SystemExit) as caught:
        main(["shell", "virtual", "-c", "exit(3)"])
    assert caught.value.code == 3


def test_leaving_stops_an_open_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    segment: Segment = demo_segment()
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)
    code = """
arm = cat.Drives(subs.drives, counts_per_turn=2**20, velocity_limit=1.0)
loop = cat.Loop(arm, period=1e-3).open()
for _ in range(10):
    next(loop)
"""
    assert main(["shell", "virtual", "-c", code]) == 0
    with cat.MainDevice(segment) as again:
        states = [sub.read_state().state for sub in again.passive_scan()]
    assert set(states) == {AlState.INIT}
    servos = [device for device in segment if hasattr(device, "drive_state")]
    assert {servo.drive_state() for servo in servos} != {"OPERATION ENABLED"}


def test_a_running_program(capsys: Capture) -> None:
    with program() as running:
        code = "print([device.position for device in program.devices()])"
        assert main(["shell", f"share:{running.name}", "-c", code]) == 0
    assert capsys.readouterr().out == "[0, 1, 2]\n"


class Terminal:
    """A shell in a pseudo-terminal."""

    def __init__(self, *options: str, folder: Path) -> None:
        self.master, slave = pty.openpty()
        environment = os.environ | {"IPYTHONDIR": str(folder), "TERM": "dumb"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "catenary.cli", "shell", "virtual", *options],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env=environment,
            start_new_session=True,
        )
        os.close(slave)
        self.text = ""

    def read_until(self, expected: str) -> str:
        """Return and remove the output up to a text. Fail after the time limit."""
        deadline = time.monotonic() + TIME_LIMIT
        while expected not in self.text:
            assert time.monotonic() < deadline, f"no {expected!r} in {self.text!r}"
            assert self.read_more(), f"no {expected!r} in {self.text!r}, and the shell has ended"
        found, _, self.text = self.text.partition(expected)
        return found

    def read_more(self) -> bool:
        """Append new output. Return False if the shell has closed the terminal."""
        if select.select([self.master], [], [], 1.0)[0]:
            try:
                self.text += os.read(self.master, 4096).decode(errors="replace")
            except OSError:
                return False
        return True

    def wait(self) -> int:
        """Return the exit status, and drop the output until then."""
        deadline = time.monotonic() + TIME_LIMIT
        while self.read_more() and self.process.poll() is None:
            assert time.monotonic() < deadline, f"the shell has not ended: {self.text!r}"
        return self.process.wait(TIME_LIMIT)

    def write(self, text: str) -> None:
        os.write(self.master, text.encode())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.master)


def talk(terminal: Terminal, prompt: str, end: str) -> int:
    try:
        banner = terminal.read_until(prompt)
        assert "Catenary on virtual" in banner
        assert "subs" in banner
        terminal.write("print('devices', len(subs) * 7)\n")
        terminal.read_until("devices 42")
        terminal.read_until(prompt)
        terminal.write(end)
        return terminal.wait()
    finally:
        terminal.close()


def test_the_shell_of_python(tmp_path: Path) -> None:
    assert talk(Terminal("--plain", folder=tmp_path), ">>> ", "\x04") == 0


@pytest.mark.skipif(importlib.util.find_spec("IPython") is None, reason="needs IPython")
def test_the_shell_of_ipython(tmp_path: Path) -> None:
    assert talk(Terminal(folder=tmp_path), "]: ", "exit\n") == 0


@pytest.mark.parametrize(("end", "status"), [("exit()\n", 0), ("exit(3)\n", 3)])
def test_exit_ends_the_shell_of_python(tmp_path: Path, end: str, status: int) -> None:
    assert talk(Terminal("--plain", folder=tmp_path), ">>> ", end) == status
