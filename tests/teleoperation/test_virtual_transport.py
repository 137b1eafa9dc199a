from __future__ import annotations

import pytest

from catenary import realtime
from catenary.teleoperation import LinkState, NetworkModel, Peer, VirtualNetwork
from tests.teleoperation.sides import KEY, SAMPLE, Clock


def test_a_packet_arrives_after_its_delay() -> None:
    clock = Clock()
    network = VirtualNetwork(NetworkModel(delay=0.005))
    one, other = network.side(0, clock), network.side(1, clock)
    assert one.send(b"state")
    clock.now_ns = 5_000_000
    assert other.receive() is None
    clock.now_ns += 1
    assert other.receive() == b"state"
    assert other.receive() is None
    assert one.receive() is None


def test_a_packet_never_arrives_at_the_time_of_sending() -> None:
    clock = Clock()
    network = VirtualNetwork(NetworkModel())
    one, other = network.side(0, clock), network.side(1, clock)
    one.send(b"state")
    assert other.receive() is None
    clock.now_ns += 1
    assert other.receive() == b"state"


def test_reordered_packets_arrive_in_the_order_of_their_arrivals() -> None:
    clock = Clock()
    network = VirtualNetwork(NetworkModel(delay=0.01, reorder=0.2, seed=1))
    one, other = network.side(0, clock), network.side(1, clock)
    for number in range(100):
        clock.now_ns += 1_000_000
        one.send(bytes([number, 0]))  # a final zero is part of the data
    clock.now_ns += 10**9
    found = [other.receive() for _ in range(100)]
    assert other.receive() is None
    assert sorted(found) == [bytes([number, 0]) for number in range(100)] != found


def test_a_full_network_refuses() -> None:
    clock = Clock()
    one = VirtualNetwork(NetworkModel()).side(0, clock)
    results = [one.send(b"state") for _ in range(20_000)]
    assert results == [True] * 16_384 + [False] * 3616


def test_two_sides() -> None:
    with pytest.raises(ValueError, match="0 and 1"):
        VirtualNetwork(NetworkModel()).side(2, Clock())


def run_side(task, number, network, participant, results):
    with Peer(network.side(number, participant), key=KEY, axes=2, max_delay=0.05) as peer:
        found = []
        for job in task:
            found.append(peer.receive() is not None)
            peer.send(SAMPLE)
            if job.number == 199:
                break
        results[number].write([*map(float, found), peer.delay_bound or -1.0])
        assert peer.state is LinkState.CONNECTED


def run_in_tasks() -> list[list[float]]:
    """Run both sides in processes of one virtual clock."""
    network = VirtualNetwork(NetworkModel(0.005, 0.01, loss=0.1, seed=6))
    results = [realtime.Value(shape=201) for _ in range(2)]
    with realtime.VirtualClock() as clock:
        observers = [clock.participate() for _ in range(2)]
        for each in observers:
            each.step_aside()  # it only reads the time
        tasks = [
            realtime.Task(
                run_side,
                (number, network, observers[number], results),
                period=1e-3,
                name=f"{number}",
            )
            for number in range(2)
        ]
        with realtime.Tasks(*tasks, workers="processes", clock=clock) as running:
            running.join(10.0)
    return [result.read().tolist() for result in results]


def test_two_tasks_give_the_same_result_in_each_run() -> None:
    first, second = run_in_tasks(), run_in_tasks()
    assert first == second
    assert all(80 < sum(side[:-1]) < 150 for side in first)  # connected after 50 to 80 ms
