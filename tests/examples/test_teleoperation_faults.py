"""examples/teleoperation: bad links and programs. Both sides hold compliantly, and report it."""

from __future__ import annotations

import hashlib
import math
import secrets
import struct
import sys
from contextlib import closing
from pathlib import Path
from socket import SOCK_DGRAM, socket

import numpy as np
import pytest

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
pytest.importorskip("mujoco", reason="the devices move in MuJoCo: pip install 'catenary[sim]'")

from catenary.teleoperation import LinkState, NetworkModel, make_key
from catenary.teleoperation.packet import DIGEST_BYTES, HEADER, PERSON
from tests.examples.two_devices import FOLDER, KEY, Pair, Side, devices, load
from tests.share.processes import Program

MOVED = 2.9  # [s], when the hand has moved to 0.2 rad


def assert_separate(pair: Pair) -> None:
    """Check that the leader holds at 0 against the hand, and that the follower has not moved."""
    assert pair.leader.peer.losses == pair.follower.peer.losses == 0
    assert not pair.leader.connected
    assert_separate_positions(pair)


def assert_separate_positions(pair: Pair) -> None:
    device = load("device")
    assert not pair.follower.connected
    assert not pair.leader.now.connected
    assert pair.follower.now.position == pytest.approx((0, 0), abs=1e-6)
    hand, held = device.Hand.stiffness, device.STIFFNESS
    wanted = hand * 0.2 / (hand + held)
    assert pair.leader.now.position == pytest.approx((wanted, wanted), abs=2e-3)


def test_a_peer_with_another_key_moves_nothing_and_is_reported() -> None:
    with devices(follower={"key": secrets.token_bytes(32)}) as pair:
        pair.run(MOVED)
        assert_separate(pair)
        assert pair.leader.peer.counters["key"] > 1000
        assert "give both sides the same key file" in pair.leader.peer.reason


def test_a_peer_with_another_number_of_axes_moves_nothing() -> None:
    """The follower's program is not involved: its peer refuses all packets itself."""
    with devices(leader={"axes": 4}, follower={"max_delay": 0.05}) as pair:
        other = pair.follower.peer
        other._codec = type(other._codec)(KEY, 2)  # as if it were made with axes=2
        other.send = lambda sample: None  # type: ignore[method-assign]
        pair.run(MOVED)
        assert_separate(pair)
        assert other.counters["axes"] > 1000


def test_a_delay_beyond_the_bound_never_connects() -> None:
    with devices(NetworkModel(delay=0.03)) as pair:
        pair.run(MOVED)
        assert_separate(pair)


def test_replayed_packets_are_refused_and_counted() -> None:
    recorded: list[bytes] = []

    def again(data: bytes) -> list[bytes]:
        recorded.append(data)
        return [data, recorded[len(recorded) // 2]]

    with devices(change=again) as pair:
        pair.run(MOVED)
        assert pair.leader.connected
        assert pair.leader.peer.counters["replayed"] > 1000
        assert np.subtract(pair.leader.now.position, pair.follower.now.position) == pytest.approx(
            (0, 0), abs=2e-3
        )


def test_values_that_are_not_finite_lose_the_link_and_the_leader_holds() -> None:
    spoiled = False

    def spoil(data: bytes) -> list[bytes]:
        if not spoiled:
            return [data]
        body = data[: HEADER.size] + struct.pack("<d", math.nan) + data[HEADER.size + 8 :]
        body = body[:-DIGEST_BYTES]
        digest = hashlib.blake2b(body, key=KEY, digest_size=DIGEST_BYTES, person=PERSON)
        return [body + digest.digest()]

    with devices(change=spoil) as pair:
        pair.run(MOVED)
        assert pair.leader.connected
        spoiled = True
        pair.run(3.1)
        assert pair.leader.peer.state is LinkState.LOST
        assert pair.leader.peer.counters["not_finite"] > 10
        assert_holds(pair)


def assert_holds(pair: Pair) -> None:
    """Check that the leader now holds its place: the hand moves it by its spring only."""
    device = load("device")
    place = pair.leader.now.position[1]
    pair.run(4.9, alone=True)
    hand, held = device.Hand.stiffness, device.STIFFNESS
    expected = (hand * 0.4 + held * place) / (hand + held)
    assert pair.leader.now.position[1] == pytest.approx(expected, abs=5e-3)


def test_a_silent_peer_is_lost_within_the_bound_and_the_leader_holds() -> None:
    with devices() as pair:
        pair.run(MOVED)
        assert pair.leader.connected
        pair.run(MOVED + 0.06, alone=True)  # as if the other program were killed
        assert pair.leader.peer.losses == 1
        assert "no packet for" in pair.leader.peer.reason
        assert_holds(pair)


def test_a_link_that_returns_connects_again_without_a_step_of_the_torque() -> None:
    with devices(NetworkModel(delay=0.01, outages=((2.0, 6.5),))) as pair:
        pair.run(6.45)
        assert pair.leader.peer.losses == pair.follower.peer.losses == 1
        assert pair.leader.now.position[1] - pair.follower.now.position[1] > 0.3
        assert pair.leader.now.torque[1] < -0.05  # the hand pushes it away while it holds
        torques = []
        while pair.leader.now.time < 7.4:
            pair.run(pair.leader.now.time + 1e-4)
            torques.append((pair.leader.now.torque[1], pair.follower.now.torque[1]))
        assert pair.leader.connected
        assert pair.follower.connected
        assert abs(np.diff(torques, axis=0)).max() < 0.02  # [N·m]
        assert pair.follower.now.position[1] == pytest.approx(pair.leader.now.position[1], abs=5e-3)


def test_a_request_to_stop_lets_the_other_side_hold() -> None:
    with devices() as pair:
        pair.run(MOVED)
        send = pair.follower.peer.send
        pair.follower.peer.send = lambda sample: send(  # type: ignore[method-assign]
            sample._replace(wants_stop=True)
        )
        pair.run(3.1)
        assert pair.leader.peer.state is LinkState.CONNECTED
        assert not pair.leader.now.connected
        assert_holds(pair)


def test_a_side_holds_while_the_other_side_holds() -> None:
    """The follower never connects, because its bound is smaller. The leader would connect."""
    with devices(follower={"max_delay": 0.018}) as pair:
        pair.run(MOVED)
        assert pair.leader.connected
        assert_separate_positions(pair)


def test_the_energies_begin_again_with_a_restarted_program() -> None:
    """Otherwise, energy that the ended program has taken would hide an active coupling."""
    with devices() as pair:
        pair.run(4.5)
        leader = pair.leader
        before = leader.peer.other_session
        assert min(leader.now.observed) > 5e-3  # [J]
        pair.follower = Side("follower", pair.follower.peer._transport, pair.controller)
        with pair.follower.stack:
            while leader.peer.losses == 0 or not leader.connected:
                pair.run(leader.now.time + 1e-4)
                assert leader.now.time < 4.9
            assert leader.peer.other_session != before
            assert leader.now.observed == pytest.approx((0, 0), abs=2e-3)


def test_a_program_that_stands_still_lets_its_law_hold() -> None:
    """The law counts the time since the program has written a new cycle."""
    device = load("device")
    import catenary as cat
    from catenary import control

    side = device.controller(0.05)
    with device.virtual_device("follower") as (segment, _), cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, mode="cst", counts_per_turn=device.COUNTS, velocity_limit=50.0
        )
        with cat.Loop(arm, period=device.PERIOD, laws=[side.law], execution="inline") as loop:
            sent_once = side.parameters(1, 1, [0.1, 0.1], [0.0, 0.0], [0.0, 0.0])
            run = loop.start(side.law, side.memory, sent_once)
            for cycle in loop:
                if cycle.time > 1.0:
                    break
            assert control.part(run.memory, 0)[0] == 1.0  # holds
            moved = arm.actual.position
            assert abs(moved).max() < 0.02  # [rad], of 0.1


def test_a_killed_program_is_lost_and_the_other_continues_to_run(tmp_path: Path) -> None:
    key = tmp_path / "arm.key"
    make_key(key)
    places = free_places()
    programs = []
    for role, bind, remote in zip(("leader", "follower"), places, places[::-1], strict=True):
        words = [role, "--bind", bind, "--remote", remote, "--key", str(key), "--max-delay", "0.6"]
        programs.append(Program.of([sys.executable, str(FOLDER / "device.py"), *words]))
    leader, follower = programs
    try:
        assert until(follower, "link connected")
        assert until(leader, "link connected")
        leader.kill()
        assert until(follower, "link lost")
        assert follower.process.poll() is None
    finally:
        for program in programs:
            program.kill()
            program.close()


def free_places() -> list[str]:
    """Return two addresses of this machine whose UDP ports are free now."""
    with closing(socket(type=SOCK_DGRAM)) as one, closing(socket(type=SOCK_DGRAM)) as other:
        for each in (one, other):
            each.bind(("127.0.0.1", 0))
        return [f"127.0.0.1:{each.getsockname()[1]}" for each in (one, other)]


def until(program: Program, text: str) -> bool:
    """Return True if a line of the program contains `text`, False at its end."""
    while line := program.line():
        if text in line:
            return True
    return False


def test_a_key_file_that_others_can_read_is_refused(tmp_path: Path) -> None:
    key = tmp_path / "arm.key"
    make_key(key)
    key.chmod(0o644)
    words = ["leader", "--bind", "127.0.0.1:0", "--remote", "127.0.0.1:9", "--key", str(key)]
    program = Program.of([sys.executable, str(FOLDER / "device.py"), *words])
    try:
        assert program.process.wait(60) != 0
    finally:
        program.close()
