"""TAP interfaces: frames in both directions, and interfaces that cannot be used."""

from __future__ import annotations

import errno
import os
import resource
import socket

import pytest

from catenary.errors import TapError
from catenary.link import tap as taps
from catenary.link.tap import Tap
from catenary.realtime.private_network import run_ip

FRAME = b"\xff" * 6 + bytes.fromhex("020000000702") + b"\x88\xb5" + bytes(range(46))


def test_frames_in_both_directions(tap: str) -> None:
    with Tap(tap) as opened, socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as other:
        other.bind((tap, 0x88B5))
        other.settimeout(20.0)
        assert opened.write(FRAME)
        assert other.recv(2000) == FRAME
        for _ in range(2000):  # the kernel drops frames until it has noticed the carrier
            other.send(FRAME)
            if opened.wait(0.01) and opened.read() == FRAME:  # it also sends frames of its own
                break
        else:
            pytest.fail("the frame did not arrive")


def test_wake_ends_a_wait(tap: str) -> None:
    with Tap(tap) as opened:
        opened.wake()
        assert not opened.wait(None)


def test_an_interface_in_use(tap: str) -> None:
    with Tap(tap), pytest.raises(TapError, match="is already in use") as caught:
        Tap(tap)
    assert "main.eoe.connect" in caught.value.hint
    Tap(tap).close()


def test_an_interface_that_is_down(tap: str) -> None:
    run_ip("link", "set", tap, "down")
    with pytest.raises(TapError, match="is down") as caught:
        Tap(tap)
    assert caught.value.hint == f"sudo ip link set {tap} up"


def test_an_interface_that_is_set_down_later(tap: str) -> None:
    with Tap(tap) as opened:
        run_ip("link", "set", tap, "down")
        assert not opened.write(FRAME)
        assert opened.read() is None


def test_an_interface_of_another_kind(veth: tuple[str, str]) -> None:
    with pytest.raises(TapError, match="is not a TAP interface"):
        Tap(veth[0])


def test_an_interface_that_does_not_exist() -> None:
    with pytest.raises(TapError, match="the interface cat77 does not exist") as caught:
        Tap("cat77")
    assert "ip tuntap add dev cat77 mode tap user" in caught.value.hint


def test_an_interface_of_another_user() -> None:
    # The kernel lets root use every TAP, so that only the text is tested.
    error = taps._attach_error("cat0", OSError(errno.EPERM, "Operation not permitted"))
    assert "belongs to another user" in error.message


@pytest.mark.parametrize("name", ["", "x" * 16, "a/b"])
def test_names_that_no_interface_can_have(name: str) -> None:
    with pytest.raises(ValueError, match="cannot be the name"):
        Tap(name)


def test_without_tun(tap: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(taps, "DEVICE", "/dev/does-not-exist")
    with pytest.raises(TapError, match="this kernel or container has no TAP"):
        Tap(tap)


def test_a_forked_child_does_not_keep_the_interface(tap: str) -> None:
    opened = Tap(tap)
    read, write = os.pipe()
    running, started = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(started, b"x")
        os.read(read, 1)
        os._exit(0)
    try:
        os.read(running, 1)
        opened.close()
        Tap(tap).close()
    finally:
        os.write(write, b"x")
        os.waitpid(child, 0)
        for each in (read, write, running, started):
            os.close(each)


def test_a_closed_interface_ignores_late_calls(tap: str) -> None:
    opened = Tap(tap)
    number = opened._file
    opened.close()
    other = os.memfd_create("other")
    try:
        os.dup2(other, number)  # the descriptor now belongs to another file
        opened.wake()
        assert not opened.write(FRAME)
        assert os.fstat(other).st_size == 0
    finally:
        os.close(number)
        if other != number:
            os.close(other)


def test_an_interface_that_is_deleted_later(tap: str) -> None:
    with Tap(tap) as opened:
        run_ip("link", "delete", tap)
        assert opened.wait(0)
        with pytest.raises(TapError, match="was deleted"):
            opened.read()
        assert not opened.write(FRAME)
    run_ip("tuntap", "add", "dev", tap, "mode", "tap")  # the fixture deletes it


def test_a_program_with_many_open_files(tap: str) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard <= 1100:
        pytest.skip(f"at most {hard} files can be open")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1101), hard))
    files = [os.open(os.devnull, os.O_RDONLY) for _ in range(1030)]
    try:
        with Tap(tap) as opened:
            opened.wake()
            assert not opened.wait()
    finally:
        for each in files:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
