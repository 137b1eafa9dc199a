"""QEMU as a child process: its arguments and its end. A shell script replaces it."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tools.rtlab import machine
from tools.rtlab.errors import LabError
from tools.rtlab.kernel import Kernel

ROOT = Path(__file__).resolve().parents[2]
KERNEL = Kernel(Path("/boot/vmlinuz"), Path("/lib/modules/6.1.0-rt"), "linux-image-rt_6.1")
ANSWER = {"kernel": "6.1", "status": 0, "seconds": 2.5, "result": {"lost": 0}}
GENEROUS = 60.0  # [s] for a busy machine


@pytest.fixture
def qemu(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Program with the name of QEMU. A test writes its script with `becomes`."""
    program = tmp_path / "bin" / machine.PROGRAM
    program.parent.mkdir()
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    return program


def becomes(program: Path, script: str) -> None:
    """Write the script. $RESULTS is the file of the second serial line, QEMU's last argument."""
    find = 'for last; do :; done; RESULTS="${last#file:}"'
    program.write_text(f"#!/bin/sh\n{find}\n{script}\n")
    program.chmod(0o755)


def run(folder: Path, seconds: float = GENEROUS) -> tuple[list[str], dict[str, object]]:
    with machine.started(KERNEL, Path("/root.cpio"), {}, folder, seconds) as guest:
        return list(guest.lines()), guest.answer()


def ended(pid: int) -> bool:
    """Return True if the process ends within GENEROUS seconds."""
    try:
        descriptor = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([descriptor], [], [], GENEROUS)[0])
    finally:
        os.close(descriptor)


def test_guest_time_counts_instructions_and_skips_idle_time(qemu: Path) -> None:
    becomes(qemu, "")
    asked = " ".join(machine.command(KERNEL, Path("/root.cpio"), Path("/out"), {"name": "x"}))
    for part in ("-accel tcg", "-icount shift=0,sleep=off", "-rtc clock=vm", "-smp 1"):
        assert part in asked
    assert "-drive" not in asked  # a disk responds in host time


def test_output_and_answer_of_the_guest(qemu: Path, tmp_path: Path) -> None:
    becomes(qemu, f"printf 'one\\r\\ntwo'; echo '{json.dumps(ANSWER)}' >$RESULTS")
    assert run(tmp_path) == (["one", "two"], ANSWER)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bin"]  # no files are left


def test_progress_lines_are_printed_immediately(qemu: Path, tmp_path: Path) -> None:
    shown = "\\r\\033[K1 of 2\\r\\033[K2 of 2\\n"
    becomes(qemu, f"printf '{shown}'; echo '{json.dumps(ANSWER)}' >$RESULTS")
    assert run(tmp_path)[0] == ["", "1 of 2", "2 of 2"]


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("echo 'qemu: no kernel' >&2; echo more >&2; exit 1", "status 1: qemu: no kernel$"),
        ("exit 3", "status 3: it said nothing$"),
        ("echo panic; : >$RESULTS", "without an answer"),
        ('echo \'{"status": 2, "result": null}\' >$RESULTS', "status 2; its output is above"),
    ],
)
def test_errors_have_one_line(qemu: Path, tmp_path: Path, script: str, message: str) -> None:
    becomes(qemu, script)
    with pytest.raises(LabError, match=message) as caught:
        run(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_guest_that_does_not_end_is_killed(qemu: Path, tmp_path: Path) -> None:
    becomes(qemu, f"echo $$ >{tmp_path}/pid; exec sleep 1000")
    with pytest.raises(LabError, match="not done within"):
        run(tmp_path, 2.0)
    pid = tmp_path / "pid"
    assert not pid.exists() or ended(int(pid.read_text()))


def test_a_missing_qemu_names_the_package(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tools.rtlab", "quick"],
        cwd=ROOT,
        env={"PATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == (
        "rtlab: qemu-system-x86_64 is not installed: `sudo apt-get install qemu-system-x86`\n"
    )
    assert list(tmp_path.iterdir()) == []


SCRIPT = """
import signal, sys
from pathlib import Path
from tests.rtlab.test_machine import KERNEL, machine
signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
with machine.started(KERNEL, Path("/root.cpio"), {}, Path(sys.argv[1]), 1000.0) as guest:
    for line in guest.lines():
        print(line, flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_an_interrupted_run_leaves_no_process(
    qemu: Path, tmp_path: Path, number: signal.Signals
) -> None:
    becomes(qemu, "echo $$; exec sleep 1000")
    folder = tmp_path / "work"
    folder.mkdir()
    lab = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(folder)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert lab.stdout is not None
    pid = int(lab.stdout.readline())
    lab.send_signal(number)
    assert ended(pid)
    assert lab.wait(GENEROUS) != 0
    lab.stdout.close()
    if number == signal.SIGTERM:
        assert list(folder.iterdir()) == []


def test_a_guest_that_ends_before_its_first_output_is_restarted(
    qemu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "BOOT_SECONDS", 1.0)
    been = tmp_path / "been"
    again = f"echo up; echo '{json.dumps(ANSWER)}' > \"$RESULTS\""
    becomes(qemu, f"if test -e {been}; then {again}; else touch {been}; exec sleep 600; fi")
    lines, answer = run(tmp_path)
    assert lines == ["up"]
    assert answer == ANSWER


def test_a_job_that_exceeds_the_kernel_command_line_is_refused() -> None:
    kernel = Kernel(Path("vmlinuz"), Path("modules"), "a kernel")
    with pytest.raises(LabError, match="at most 2047"):
        machine.command(kernel, Path("root"), Path("results"), {"arguments": ["x" * 1800]})
