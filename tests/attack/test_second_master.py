"""Attack: two masters on one network interface. The second is refused; the first continues."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import LinkError
from catenary.link import Interface, ownership
from catenary.link.interface import ETHERTYPE
from tests.attack.line_on_a_wire import START, goes_on, looping, program, served

ALL_PROTOCOLS = 0x0003
FRAME = (
    b"\xff" * 6
    + bytes.fromhex("101010101010")
    + b"\x88\xa4"
    # BRD of AL status
    + bytes.fromhex("0e10 07 00 0000 3001 0200 0000 0000 0000")
    + bytes(32)
)
HOLDER = """
import signal, sys
import catenary as cat

main = cat.MainDevice(sys.argv[1], force=len(sys.argv) > 2)
main.open()
print("open", flush=True)
signal.pause()
"""
SOCKET = """
import signal, socket, sys

raw = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
raw.bind((sys.argv[1], int(sys.argv[2])))
print("open", flush=True)
signal.pause()
"""
SENDER = """
import socket, sys, time

raw = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
raw.bind((sys.argv[1], 0x0003))
print("sending", flush=True)
while True:
    raw.send(bytes.fromhex(sys.argv[2]))
    time.sleep(0.005)
"""


def catenary(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "catenary.cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_a_second_one_in_the_same_process(veth: tuple[str, str]) -> None:
    expected = rf"this process \(PID {os.getpid()}\) has {veth[0]} open"
    with cat.MainDevice(veth[0]), pytest.raises(LinkError, match=expected) as refused:
        cat.MainDevice(veth[0]).open()
    assert "call its close() first" in refused.value.hint


def test_another_process_is_named(veth: tuple[str, str], tmp_path: Path) -> None:
    with program(HOLDER, tmp_path, veth[0]) as holder:
        assert holder.read_line(START) == "open"
        with pytest.raises(LinkError, match=rf"PID {holder.pid} \(\S+\) has {veth[0]} open"):
            cat.MainDevice(veth[0]).open()
        with cat.MainDevice(veth[1]):
            pass


def test_an_error_while_closing_keeps_no_interface(veth: tuple[str, str]) -> None:
    """As where a loop was left open, and warnings are errors."""

    def leave_loop() -> None:
        raise RuntimeWarning("the loop was left open")

    main = cat.MainDevice(veth[0])
    main.open()
    main._leave_loop = leave_loop
    with pytest.raises(RuntimeWarning):
        main.close()
    assert not main.is_open
    with cat.MainDevice(veth[0]):
        pass


def test_of_two_that_open_at_the_same_time_one_is_refused(
    veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second one has opened its socket when the first one takes the lock and looks around."""
    late = Interface(veth[0]).open_link()
    monkeypatch.setattr(ownership, "_pause", lambda raw, duration_ns: late.close())
    with cat.MainDevice(veth[0]):
        pass


def test_a_refused_ring_takes_no_further_lock(veth: tuple[str, str]) -> None:
    """Else two rings that open at the same time could refuse each other."""
    first, second = sorted(veth)
    with cat.MainDevice(first), cat.MainDevice(second), pytest.raises(LinkError) as refused:
        cat.MainDevice(second, first).open()
    assert f"has {first} open" in refused.value.message
    assert second not in refused.value.message


def test_force_opens_all_the_same(veth: tuple[str, str], tmp_path: Path) -> None:
    with program(HOLDER, tmp_path, veth[0]) as holder:
        assert holder.read_line(START) == "open"
        with cat.MainDevice(veth[0], force=True) as main:
            assert f"PID {holder.pid}" in main.other_masters[0]


def test_closing_releases_the_interface(veth: tuple[str, str]) -> None:
    for _ in range(2):
        with cat.MainDevice(veth[0]) as main:
            assert main.other_masters == ()


def test_sigkill_releases_the_interface(veth: tuple[str, str], tmp_path: Path) -> None:
    with program(HOLDER, tmp_path, veth[0]) as holder:
        assert holder.read_line(START) == "open"
        holder.process.kill()
        holder.process.wait()
        with cat.MainDevice(veth[0]):
            pass


def test_a_ring_takes_both_interfaces(veth: tuple[str, str]) -> None:
    with cat.MainDevice(*veth):
        for name in veth:
            with pytest.raises(LinkError, match=f"has {name} open"):
                cat.MainDevice(name).open()
    with cat.MainDevice(veth[1]), pytest.raises(LinkError, match=f"has {veth[1]} open"):
        cat.MainDevice(*veth).open()
    with cat.MainDevice(veth[0]):  # what the refused ring had taken is free
        pass


def test_a_master_without_our_lock_is_seen(veth: tuple[str, str], tmp_path: Path) -> None:
    """SOEM and IgH's generic driver open such a socket."""
    with program(SOCKET, tmp_path, veth[0], str(ETHERTYPE)) as other:
        assert other.read_line(START) == "open"
        with pytest.raises(LinkError, match=rf"PID {other.pid} .* packet socket on {veth[0]}"):
            cat.MainDevice(veth[0]).open()
    with cat.MainDevice(veth[0]):
        pass


def test_a_capture_is_not_a_master(veth: tuple[str, str], tmp_path: Path) -> None:
    with program(SOCKET, tmp_path, veth[0], str(ALL_PROTOCOLS)) as capture:
        assert capture.read_line(START) == "open"
        with cat.MainDevice(veth[0]) as main:
            assert main.other_masters == ()


def test_the_segment_at_the_other_end_is_not_a_master(
    veth: tuple[str, str], tmp_path: Path
) -> None:
    with served(veth[1], tmp_path), cat.MainDevice(veth[0]) as main:
        assert len(main.scan()) == 2


def test_frames_of_a_master_elsewhere(veth: tuple[str, str], tmp_path: Path) -> None:
    """A master at the other end of the line: neither its lock nor its socket is here."""
    with program(SENDER, tmp_path, veth[1], FRAME.hex()) as sender:
        assert sender.read_line(START) == "sending"
        with pytest.raises(LinkError, match=f"frames of another master arrive on {veth[0]}"):
            cat.MainDevice(veth[0]).open()


def test_late_answers_to_a_killed_master_are_not_a_master(veth: tuple[str, str]) -> None:
    with (
        Interface(veth[0]).open_link() as link,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as segment,
    ):
        segment.bind((veth[1], ALL_PROTOCOLS))
        for _ in range(50):
            segment.send(FRAME)
        assert ownership.foreign_frames(ownership.raw_links(link)) == ()


def test_a_master_in_another_container(veth: tuple[str, str]) -> None:
    text = f"import catenary as cat; cat.MainDevice({veth[0]!r}).open()"
    command = ["unshare", "--pid", "--fork", sys.executable, "-c", text]
    with cat.MainDevice(veth[0]):
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "unshare failed" in done.stderr:
        pytest.skip("no PID namespace of its own")
    assert (
        f"a process that is invisible here (another container or PID namespace) has {veth[0]}"
        in (done.stderr)
    )


def test_a_process_of_another_container_is_reported_as_invisible() -> None:
    assert "invisible here" in ownership.described(0)


def test_a_lock_held_without_permission_for_the_interface(veth: tuple[str, str]) -> None:
    """Any user may bind a name of an abstract socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as stranger:
        stranger.bind(ownership.NAME + veth[0])
        with pytest.raises(LinkError, match="a process that does not report its number"):
            cat.MainDevice(veth[0]).open()
        with cat.MainDevice(veth[0], force=True) as main:
            assert veth[0] in main.other_masters[0]


def test_a_lock_that_the_system_refuses_is_a_link_error(
    veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ownership, "NAME", "\0" + 200 * "x")  # longer than an address may be
    with pytest.raises(LinkError, match=f"{veth[0]}: cannot take the lock of the interface"):
        cat.MainDevice(veth[0]).open()


def test_without_proc_only_locks_and_frames_show_a_master(
    veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(ownership, "PACKETS", tmp_path / "missing")
    with cat.MainDevice(veth[0]) as main:
        assert main.other_masters == ()


def test_a_scan_does_not_reset_a_line_in_motion(veth: tuple[str, str], tmp_path: Path) -> None:
    with served(veth[1], tmp_path), looping(veth[0], tmp_path) as loop:
        done = catenary("scan", veth[0])
        assert done.returncode == 1
        assert f"PID {loop.pid}" in done.stderr
        assert "--force" in done.stderr
        assert goes_on(loop)


def test_a_forced_scan_is_suspected_by_the_loop_that_it_ends(
    veth: tuple[str, str], tmp_path: Path
) -> None:
    with served(veth[1], tmp_path), looping(veth[0], tmp_path) as loop:
        catenary("scan", veth[0], "--force")
        lines = iter(lambda: loop.read_line(START), None)
        [error] = [line for line in lines if "Error" in line]
        assert error.startswith("StateError")
        assert "second master" in error or "another EtherCAT master" in error


def test_a_line_in_motion_can_be_read(veth: tuple[str, str], tmp_path: Path) -> None:
    with served(veth[1], tmp_path), looping(veth[0], tmp_path) as loop:
        done = catenary("state", veth[0])
        assert f"note: PID {loop.pid}" in done.stderr
        assert [line.split()[-1] for line in done.stdout.splitlines()[1:]] == ["OP", "OP"]
        assert catenary("state", veth[0], "INIT").returncode == 1
        assert goes_on(loop)


def test_what_a_killed_program_left_in_op_is_reset_and_reported(
    veth: tuple[str, str], tmp_path: Path
) -> None:
    with served(veth[1], tmp_path), looping(veth[0], tmp_path) as loop:
        os.kill(loop.pid, signal.SIGKILL)
        loop.process.wait()
        with cat.MainDevice(veth[0]) as main:
            main.scan()
            assert "device 0 in OP" in main.notes[0]
            assert "left by another program" in main.notes[0]
            assert {str(sub.state) for sub in main.subs} == {"PRE-OP"}


def test_outputs_that_another_master_refreshes(
    veth: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A master that is seen in the devices only, as through AF_XDP or at the end of a ring."""
    monkeypatch.setattr(ownership, "locked", lambda name: socket.socket(socket.AF_UNIX))
    monkeypatch.setattr(ownership, "other_sockets", lambda link: ())
    monkeypatch.setattr(ownership, "foreign_frames", lambda raws: ())
    with served(veth[1], tmp_path), looping(veth[0], tmp_path) as loop:
        refused = pytest.raises(LinkError, match=r"refreshes the outputs of device 1 \(0x0440\)")
        with cat.MainDevice(veth[0]) as main, refused:
            main.scan()
        assert goes_on(loop)
