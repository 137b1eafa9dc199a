from __future__ import annotations

import logging

import pytest

from catenary.teleoperation import LinkState, NetworkModel, Peer, PeerSample
from tests.teleoperation.sides import KEY, OTHER_KEY, SAMPLE, Sides, Tapped

BOTH_CONNECTED = (LinkState.CONNECTED, LinkState.CONNECTED)


def test_samples_arrive_once_connected() -> None:
    sides = Sides(NetworkModel(delay=0.002))
    sides.connect()
    sides.run(5)
    sides.received = [[], []]
    sides.run(10)
    assert sides.received == [[SAMPLE] * 10] * 2
    assert sides.peers[0].reason == ""


def test_nothing_is_delivered_before() -> None:
    sides = Sides()
    sides.run_until(lambda: LinkState.CONNECTED in sides.states)
    assert [each for each in (*sides.received[0][:-1], *sides.received[1][:-1]) if each] == []


@pytest.mark.parametrize("settle", [0.02, 0.021])
def test_the_call_that_connects_returns_a_sample(settle: float) -> None:
    """A program that keeps the last sample must not follow one from before a loss."""
    sides = Sides(settle=settle)
    for number in range(200):
        sides.run(1, silent=(1,) if number % 2 else ())
        if sides.peers[0].state is LinkState.CONNECTED:
            break
    assert sides.peers[0].state is LinkState.CONNECTED
    assert sides.received[0][-1] in (SAMPLE, SAMPLE._replace(holding=True))


def test_delays() -> None:
    """A packet arrives in the cycle after its arrival, and waits there for the next packet."""
    sides = Sides(NetworkModel(delay=0.0035), max_delay=0.05)
    assert sides.peers[0].delay is None
    sides.connect()
    sides.run(20)
    for peer in sides.peers:
        assert peer.round_trip == pytest.approx(0.008)
        assert peer.delay == pytest.approx(0.008)
        assert peer.delay_bound == pytest.approx(0.008)
        assert peer.longest_gap == pytest.approx(0.001)


def test_the_same_seed_gives_the_same_samples() -> None:
    def run(seed: int) -> list[list[PeerSample | None]]:
        model = NetworkModel(0.005, 0.005, loss=0.2, reorder=0.1, duplicate=0.1, seed=seed)
        sides = Sides(model, max_delay=0.1)
        sides.run(300)
        return sides.received

    assert run(1) == run(1) != run(2)


def test_loss_reorder_and_duplicates_are_counted() -> None:
    model = NetworkModel(0.005, 0.0, loss=0.05, reorder=0.05, duplicate=0.05, seed=4)
    sides = Sides(model, max_delay=0.1)
    sides.run(2000)
    counters = sides.peers[0].counters
    assert sides.states == BOTH_CONNECTED
    assert counters["sent"] == 2000
    assert counters["late"] > 30
    assert counters["replayed"] > 50
    names = ("used", "late", "replayed", "unproven", "delayed")
    assert counters["received"] == sum(counters[name] for name in names)


def test_a_wrong_key_is_refused_and_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    sides = Sides()
    sides.restart(1, key=OTHER_KEY)
    sides.run(500)
    assert sides.states == (LinkState.WAITING, LinkState.WAITING)
    assert sides.peers[0].counters["key"] == 499
    assert sides.received == [[None] * 500] * 2
    reports = [each for each in caplog.records if "wrong digest" in each.getMessage()]
    assert len(reports) == 2  # one for each side
    assert "same key file" in reports[0].getMessage()
    assert "wrong digest" in sides.peers[0].reason
    assert "same key file" in sides.peers[0].reason


def test_a_lasting_cause_is_reported_every_ten_seconds(caplog: pytest.LogCaptureFixture) -> None:
    sides = Sides()
    sides.restart(1, key=OTHER_KEY)
    sides.run(25_000)
    assert len([each for each in caplog.records if "wrong digest" in each.getMessage()]) == 6


def test_a_single_foreign_packet_is_not_the_cause_for_ever() -> None:
    sides = Sides()
    sides.transports[0].injected = [b"CTEL\x01" + bytes(200)]
    sides.run(10_001, silent=(1,))
    assert "wrong digest" in sides.peers[0].reason
    sides.run(1, silent=(1,))
    assert sides.peers[0].reason == "no packet of the other side has arrived yet"


def test_another_number_of_axes_is_refused(caplog: pytest.LogCaptureFixture) -> None:
    sides = Sides()
    sides.restart(1, axes=3)
    peer = sides.peers[1]
    peer.send(PeerSample((0.0,) * 3, (0.0,) * 3, (0.0,) * 3))
    sides.run(1, silent=(1,))
    assert sides.peers[0].counters["axes"] == 1
    assert "same number of axes" in caplog.text


def test_a_flood_of_foreign_packets_does_not_stop_a_connected_link() -> None:
    sides = Sides()
    sides.connect()
    for _ in range(100):
        sides.transports[0].injected += [b"CTEL\x01" + bytes(200)] * 20
        sides.run(1)
    assert sides.states == BOTH_CONNECTED
    assert sides.peers[0].counters["key"] == 2000


def test_one_call_reads_a_limited_number_of_packets() -> None:
    sides = Sides()
    sides.transports[0].injected = [b"x"] * 100
    sides.peers[0].receive()
    assert len(sides.transports[0].injected) == 100 - 32


def test_replayed_packets_are_refused() -> None:
    sides = Sides()
    sides.connect()
    before = sides.peers[0].counters["used"]
    sides.transports[0].injected = sides.transports[1].sent[-20:]
    sides.peers[0].receive()
    assert sides.peers[0].counters["used"] == before + 1  # the newest had not arrived yet
    assert sides.peers[0].counters["replayed"] == 19


def test_a_recorded_session_does_not_connect_after_a_restart() -> None:
    sides = Sides()
    sides.connect()
    sides.run(200)
    recorded = list(sides.transports[1].sent)
    sides.restart(0)
    sides.received[0] = []
    for data in recorded:
        sides.transports[0].injected.append(data)
        sides.run(1, silent=(1,))
    assert sides.peers[0].state is LinkState.WAITING
    assert set(sides.received[0]) == {None}


def test_a_restarted_program_connects_again(caplog: pytest.LogCaptureFixture) -> None:
    sides = Sides()
    sides.connect()
    sides.restart(1)
    before = sides.peers[0].other_session
    sides.run(10)
    assert sides.peers[1].state is LinkState.WAITING
    assert sides.peers[1].other_session == 0
    sides.connect()
    assert sides.peers[0].losses == 1
    assert 0 != sides.peers[0].other_session != before
    assert "teleoperation link lost: " in caplog.text


def test_a_delay_beyond_the_bound_is_a_loss() -> None:
    sides = Sides(NetworkModel(delay=0.009), max_delay=0.021)
    sides.connect()
    slow = Sides(NetworkModel(delay=0.011), max_delay=0.021)
    slow.run(500)
    assert slow.states == (LinkState.WAITING, LinkState.WAITING)
    assert "bound 21.0 ms" in slow.peers[0].reason or "not answered" in slow.peers[0].reason


def test_an_outage_is_lost_on_both_sides_and_connects_after_it() -> None:
    sides = Sides(NetworkModel(delay=0.002, outages=[(0.3, 0.5)]))
    sides.connect()
    sides.run_until(lambda: sides.states == (LinkState.LOST, LinkState.LOST), 500)
    assert 300 < sides.clock.now_ns * 1e-6 < 325
    sides.connect()
    assert 500 < sides.clock.now_ns * 1e-6 < 560


@pytest.mark.parametrize("fault", ["deaf", "mute"])
def test_both_sides_lose_a_link_of_one_direction(fault: str) -> None:
    sides = Sides()
    sides.connect()
    setattr(sides.transports[0], fault, True)
    sides.run(45)
    assert sides.states == (LinkState.LOST, LinkState.LOST)
    setattr(sides.transports[0], fault, False)
    sides.connect()


def test_closing_ends_the_connection_at_once() -> None:
    sides = Sides()
    sides.connect()
    with sides.peers[1]:
        pass
    sides.run(1, silent=(1,))
    assert sides.peers[0].state is LinkState.LOST
    assert sides.peers[0].reason == "the other program has ended"


def test_a_late_program(caplog: pytest.LogCaptureFixture) -> None:
    sides = Sides()
    sides.connect()
    sides.run(100, silent=(0,))
    sides.run(1)
    assert sides.peers[0].state is LinkState.LOST
    assert "did not call receive for 101.0 ms" in caplog.text
    assert sides.peers[0].longest_gap == pytest.approx(0.101)


def test_a_sample_that_is_not_finite_is_not_sent() -> None:
    sides = Sides()
    with pytest.raises(ValueError, match="not finite"):
        sides.peers[0].send(SAMPLE._replace(velocity=(0.0, float("inf"))))
    assert sides.transports[0].sent == []


def test_connections_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "catenary.teleoperation")
    Sides().connect()
    assert caplog.text.count("teleoperation link connected, delays 2.0 ms") == 2


def test_what_this_machine_cannot_send_is_counted() -> None:
    sides = Sides()
    sides.transports[0].send = lambda data: False
    sides.run(3)
    assert (sides.peers[0].counters["sent"], sides.peers[0].counters["unsent"]) == (0, 3)


@pytest.mark.parametrize(
    "wrong",
    [{"max_delay": 0.0}, {"max_delay": 11.0}, {"max_delay": float("nan")}, {"settle": -1.0}],
)
def test_invalid_times(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        Sides(**wrong)


def test_sessions_are_random() -> None:
    sides = Sides()
    peers = [Peer(Tapped(each.inner), key=KEY, axes=2, max_delay=0.1) for each in sides.transports]
    for peer in peers:
        peer.send(SAMPLE)
    sent = [peer._transport.sent[0][8:16] for peer in peers]
    assert len(set(sent)) == 2
