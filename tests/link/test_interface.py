"""The raw link: round trips over a veth pair, and interfaces that are refused."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import threading
import time
from pathlib import Path

import pytest

from catenary.bus import MainDevice
from catenary.errors import LinkError
from catenary.link import Interface, Link, LinkSource, Recorder, Ring
from catenary.realtime.private_network import await_carrier
from tests.core.hammer import compiled
from tests.link_table import table_in

HEADER = b"\xff" * 6 + bytes.fromhex("020000000001") + b"\x88\xa4"
SECOND = 1_000_000_000


def frame(payload: bytes) -> bytes:
    return HEADER + payload


def receive_within(link: Link, seconds: int) -> bytes | None:
    deadline = link.now() + seconds * SECOND
    return link.receive() if link.wait_until(deadline, True) else None


@pytest.fixture(params=[True, False], ids=["mapped ring", "recv"])
def pair(request, veth):
    first, second = veth
    with (
        Interface(first, mapped_ring=request.param).open_link() as near,
        Interface(second, mapped_ring=request.param).open_link() as far,
    ):
        yield near, far


def echo(link: Link, count: int) -> None:
    """Answers `count` frames as a segment would: one bit of the source address set."""
    for _ in range(count):
        received = receive_within(link, 5)
        assert received is not None
        link.send(received[:6] + bytes([received[6] | 2]) + received[7:])


def test_receive_path_describes_how_frames_are_received(pair):
    assert pair[0].receive_path in ("mapped ring", "recv (requested)")


def test_is_a_link_and_its_own_source(pair):
    assert isinstance(pair[0], Link)
    assert isinstance(pair[0], LinkSource)
    assert pair[0].open_link() is pair[0]


def test_round_trips_through_more_frames_than_the_ring_has_slots(pair):
    near, far = pair
    count = 300
    segment = threading.Thread(target=echo, args=(far, count))
    segment.start()
    answers = []
    for number in range(count):
        near.send(frame(number.to_bytes(2, "little") + bytes(100)))
        answers.append(receive_within(near, 5))
    segment.join()
    assert [int.from_bytes(answer[14:16], "little") for answer in answers] == list(range(count))
    assert {len(answer) for answer in answers} == {116}


def test_does_not_receive_what_it_sends(pair):
    pair[0].send(frame(bytes(46)))
    assert pair[0].receive() is None


def test_pads_short_frames(pair):
    near, far = pair
    near.send(frame(b"abc"))
    assert receive_within(far, 5) == frame(b"abc") + bytes(43)


def test_carries_the_longest_frame(pair):
    near, far = pair
    near.send(frame(b"\x55" * 1500))
    assert receive_within(far, 5) == frame(b"\x55" * 1500)


@pytest.mark.parametrize("length", [0, 13, 1515])
def test_refuses_a_frame_of_impossible_length(pair, length):
    with pytest.raises(LinkError, match="cannot send"):
        pair[0].send(bytes(length))


def test_keeps_the_order_of_a_burst(pair):
    near, far = pair
    for number in range(100):
        near.send(frame(bytes([number]) * 46))
    assert [far.receive()[14] for _ in range(100)] == list(range(100))
    assert far.receive() is None


def test_waits_for_time_on_a_monotonic_clock(pair):
    near = pair[0]
    deadline = near.now() + 200_000
    assert near.wait_until(deadline, False) is False
    assert near.now() >= deadline


def test_waits_for_a_frame_no_longer_than_the_deadline(pair):
    near = pair[0]
    deadline = near.now() + 200_000
    assert near.wait_until(deadline, True) is False
    assert near.now() >= deadline


def test_a_wait_without_wake_on_frame_keeps_frames(pair):
    near, far = pair
    near.send(frame(bytes(46)))
    assert far.wait_until(far.now(), False) is False
    assert far.receive() == frame(bytes(46))


def test_other_ethertypes_are_not_ours(pair):
    near, far = pair
    near.send(HEADER[:12] + b"\x08\x00" + bytes(46))
    assert far.receive() is None


def test_a_network_gone_down_is_an_error_and_coming_back_is_not(pair, veth):
    near, far = pair
    subprocess.run(["ip", "link", "set", veth[0], "down"], check=True)
    with pytest.raises(LinkError, match="Network is down"):
        near.send(frame(bytes(46)))
    with pytest.raises(LinkError, match="Network is down"):
        near.wait_until(near.now() + SECOND, True)
    subprocess.run(["ip", "link", "set", veth[0], "up"], check=True)
    near.send(frame(bytes(46)))
    assert receive_within(far, 5) == frame(bytes(46))


def send_until(link: Link, deadline: float) -> None:
    while time.monotonic() < deadline:
        link.send(frame(bytes(46)))
        time.sleep(0.01)


@pytest.mark.parametrize("wrapped", ["raw", "recorded", "ring"])
def test_an_interface_without_a_carrier_is_reported(veth, wrapped, tmp_path):
    """The kernel's word for it is ENOBUFS, "No buffer space available"."""
    name, other = veth
    link = Interface(name).open_link()
    if wrapped == "recorded":
        link = Recorder(link, tmp_path / "run.pcapng")
    elif wrapped == "ring":  # both of its interfaces lose their link
        link = Ring(link, Interface(name, mapped_ring=False)).open_link()
    with link:
        subprocess.run(["ip", "link", "set", other, "down"], check=True)
        deadline = time.monotonic() + 5.0  # the kernel reports a lost carrier up to 1 s later
        with pytest.raises(LinkError, match=f"{name} has no link: the cable") as refused:
            send_until(link, deadline)
        assert "No buffer space" not in str(refused.value)
        assert "first device" in str(refused.value)
        subprocess.run(["ip", "link", "set", other, "up"], check=True)
        await_carrier(name)
        link.send(frame(bytes(46)))


def test_a_scan_without_a_carrier_is_reported(veth):
    name, other = veth
    subprocess.run(["ip", "link", "set", other, "down"], check=True)
    with MainDevice(Interface(name)) as main, pytest.raises(LinkError, match=f"{name} has no link"):
        main.scan()


def test_a_closed_link_is_reported(pair):
    near = pair[0]
    capsule = near.capsule
    near.close()
    near.close()
    with pytest.raises(LinkError, match="the link is closed"):
        near.send(frame(bytes(46)))
    assert "catenary.link" in repr(capsule)


@pytest.mark.parametrize("mapped_ring", [True, False])
def test_a_link_can_be_closed_while_a_native_thread_uses_it(veth, mapped_ring):
    """The thread keeps reading: neither the ring nor the descriptor may go away under it."""
    hammer = compiled(Path(__file__).with_name("close_hammer.c"))
    gc.collect()  # links of earlier tests give their descriptors back here, not below
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(100):
        link = Interface(veth[0], mapped_ring=mapped_ring).open_link()
        capsule = link.capsule
        hammer.use_begin(ctypes.byref(table_in(capsule)))
        for number in range(5):
            link.send(frame(bytes([number]) * 46))
        link.close()
        hammer.use_end()
        with pytest.raises(LinkError, match="the link is closed"):
            link.receive()
        del link, capsule
    assert len(os.listdir("/proc/self/fd")) == before


def test_old_frames_are_flushed(veth):
    first, second = veth
    with Interface(first).open_link() as near:
        near.send(frame(bytes(46)))
        with Interface(second).open_link() as far:
            assert far.receive() is None
            near.send(frame(bytes(46)))
            assert far.flush() == 1
            assert far.receive() is None


def test_an_interface_that_is_down_names_the_command(veth):
    subprocess.run(["ip", "link", "set", veth[0], "down"], check=True)
    with pytest.raises(LinkError, match=f"sudo ip link set {veth[0]} up"):
        Interface(veth[0]).open_link()


def test_an_unknown_interface_names_the_nearest(veth):
    with pytest.raises(LinkError, match=f"did you mean {veth[0][:-1]}"):
        Interface(veth[0] + "1").open_link()


def test_an_unknown_interface_lists_what_is_there():
    with pytest.raises(LinkError, match=r"no network interface 'eth99'(.|\n)*there are: .*lo"):
        Interface("eth99").open_link()


def test_lo_gives_no_answer_beyond_the_frame_itself(veth):
    with Interface("lo").open_link() as link:
        link.send(frame(bytes(46)))
        assert receive_within(link, 1) == frame(bytes(46))


def test_no_permission_names_the_command(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("catenary.link.interface.check", lambda name: None)
    monkeypatch.setattr("catenary.link.interface.socket.socket", refuse)
    with pytest.raises(LinkError, match=r"sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep .*"):
        Interface("eth0").open_link()


def test_a_refused_ring_falls_back_to_recv_and_is_reported(veth, monkeypatch):
    monkeypatch.setattr("catenary.link.interface.BLOCK_SIZE", 3)
    with Interface(veth[0]).open_link() as near, Interface(veth[1]).open_link() as far:
        assert far.receive_path.startswith("recv (no mapped ring: ")
        near.send(frame(bytes(46)))
        assert receive_within(far, 5) == frame(bytes(46))
