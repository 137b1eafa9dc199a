from __future__ import annotations

from catenary.teleoperation.link import Link
from catenary.teleoperation.link_state import LinkState
from catenary.teleoperation.packet import Packet
from catenary.teleoperation.refusal import Refusal
from catenary.teleoperation.sample import PeerSample

MS = 1_000_000
SAMPLE = PeerSample((0.5,), (0.0,), (0.0,))


def link(session: int) -> Link:
    return Link(session, max_delay_ns=20 * MS, settle_ns=5 * MS)


def connected() -> tuple[Link, Link, int]:
    """Return two connected links and the time; one cycle of 1 ms per exchange."""
    one, other = link(1), link(2)
    now = exchange(one, other, 0, 10)
    assert one.state is other.state is LinkState.CONNECTED
    return one, other, now


def exchange(one: Link, other: Link, now: int, cycles: int) -> int:
    for _ in range(cycles):
        now += MS
        packets = one.packet(SAMPLE, now), other.packet(SAMPLE, now)
        one.accept(packets[1], now)
        other.accept(packets[0], now)
        one.update(now)
        other.update(now)
    return now


def test_a_side_alone_waits() -> None:
    one = link(1)
    for now in range(0, 100 * MS, MS):
        assert one.update(now) is LinkState.WAITING
    assert one.reason == "no packet of the other side has arrived yet"


def test_the_handshake() -> None:
    one, other = link(1), link(2)
    assert other.accept(one.packet(SAMPLE, 0), 1 * MS) is Refusal.UNPROVEN
    answer = other.packet(SAMPLE, 2 * MS)
    assert (answer.session, answer.answers, answer.echo_ns, answer.hold_ns) == (2, 1, 0, MS)
    assert one.accept(answer, 3 * MS) is None
    assert one.update(3 * MS) is LinkState.WAITING  # until it has settled
    assert other.accept(one.packet(SAMPLE, 4 * MS), 5 * MS) is None


def test_the_link_connects_after_the_settling_time() -> None:
    one, other = link(1), link(2)
    now = exchange(one, other, 0, 6)  # fresh from the second cycle on
    assert one.state is LinkState.WAITING
    exchange(one, other, now, 1)
    assert one.state is LinkState.CONNECTED
    assert one.reason == ""


def test_a_side_reports_that_it_holds_until_it_is_connected() -> None:
    assert link(1).packet(SAMPLE, 0).sample.holding
    one, _other, now = connected()
    assert not one.packet(SAMPLE, now).sample.holding


def test_a_connected_link_ignores_other_sessions() -> None:
    one, other, now = connected()
    stranger = link(3)
    for _ in range(100):
        assert one.accept(stranger.packet(SAMPLE, now), now) is Refusal.SESSION
    exchange(one, other, now, 3)
    assert one.state is other.state is LinkState.CONNECTED


def test_own_packets_are_refused() -> None:
    one = link(1)
    assert one.accept(one.packet(SAMPLE, 0), MS) is Refusal.REFLECTED


def test_a_packet_with_an_old_or_a_future_echo_is_delayed() -> None:
    one, other, now = connected()
    packet = other.packet(SAMPLE, now)
    assert one.accept(packet._replace(echo_ns=now - 21 * MS), now) is Refusal.DELAYED
    later = other.packet(SAMPLE, now)
    assert one.accept(later._replace(echo_ns=now + 1), now) is Refusal.DELAYED


def test_silence_is_a_loss_and_the_reason_names_it() -> None:
    one, _other, now = connected()
    while one.update(now) is LinkState.CONNECTED:
        now += MS
    assert one.state is LinkState.LOST
    assert one.losses == 1
    assert "the newest packet came" in one.reason or "no packet" in one.reason


def test_both_sides_lose_a_link_that_works_in_one_direction() -> None:
    one, other, now = connected()
    for _ in range(40):
        now += MS
        one.accept(other.packet(SAMPLE, now), now)  # `other` receives nothing
        one.update(now)
        other.update(now)
    assert one.state is other.state is LinkState.LOST
    assert one.update(now) is LinkState.LOST


def test_a_late_program_is_named_as_the_cause() -> None:
    one, _other, now = connected()
    one.update(now + 500 * MS)
    assert one.reason == "this program did not call receive for 500.0 ms, bound 20.0 ms"
    assert one.longest_gap_ns == 500 * MS


def test_a_lost_link_connects_again_within_the_same_sessions() -> None:
    one, other, now = connected()
    now += 100 * MS
    one.update(now)
    other.update(now)
    assert one.state is other.state is LinkState.LOST
    exchange(one, other, now, 10)
    assert one.state is other.state is LinkState.CONNECTED


def test_a_restarted_program_connects_after_the_loss() -> None:
    one, _other, now = connected()
    new = link(4)
    now = exchange(one, new, now, 5)
    assert one.state is LinkState.CONNECTED  # with the ended program, whose packets have stopped
    assert new.state is LinkState.WAITING
    exchange(one, new, now, 40)
    assert one.state is new.state is LinkState.CONNECTED
    assert one.losses == 1


def test_delays_of_another_program_do_not_remain() -> None:
    one, other, now = connected()
    one.update(now + 100 * MS)
    now += 101 * MS
    other.accept(one.packet(SAMPLE, now), now)
    assert one.accept(other.packet(SAMPLE, now), now) is None  # in time, before the next update
    assert one.delays.sum_ns(now) == 0
    new = link(4)
    assert one.accept(new.packet(SAMPLE, now), now) is Refusal.UNPROVEN
    assert one.delays.sum_ns(now) is None
    assert one.proven == other.session
    exchange(one, new, now, 10)
    assert one.state is new.state is LinkState.CONNECTED
    assert one.proven == new.session


def test_packets_of_the_last_connection_do_not_connect_a_restarted_program() -> None:
    recorded: list[Packet] = []
    one, other, now = connected()
    for _ in range(50):
        now += MS
        recorded.append(one.packet(SAMPLE, now))
        other.accept(recorded[-1], now)
        one.accept(other.packet(SAMPLE, now), now)
    new = link(5)
    for packet in recorded:
        now += MS
        assert new.accept(packet, now) is Refusal.UNPROVEN
        assert new.update(now) is LinkState.WAITING
    assert new.reason.startswith("packets of the other side arrive, but it has not answered")


def test_packets_of_an_ended_program_do_not_return() -> None:
    """The other program restarts. Its former packets answer this session, but echo old times."""
    one, other, now = connected()
    recorded = [other.packet(SAMPLE, now) for _ in range(50)]
    now += 100 * MS
    one.update(now)
    for packet in recorded:
        now += MS
        assert one.accept(packet, now) is Refusal.DELAYED
        assert one.update(now) is LinkState.LOST


def test_introductions_that_are_sent_again_do_not_prevent_a_connection() -> None:
    old = [link(9).packet(SAMPLE, 0) for _ in range(3)]
    one, other, now = link(1), link(2), 0
    for _ in range(100):
        now += MS
        for packet in old:
            one.accept(packet, now)
        now = exchange(one, other, now, 1)
    assert one.state is other.state is LinkState.CONNECTED


def test_the_last_packet_of_a_program_ends_the_connection_at_once() -> None:
    one, other, now = connected()
    one.accept(other.packet(SAMPLE, now, leaving=True), now)
    assert one.update(now) is LinkState.LOST
    assert one.reason == "the other program has ended"


def test_alternating_delays_count_with_their_sum() -> None:
    """12 ms one way, then 12 ms the other way: each sum is within 20 ms, both maxima are not."""
    one, other, now = connected()
    packet = one.packet(SAMPLE, now)
    other.accept(packet, now + 12 * MS)
    one.accept(other.packet(SAMPLE, now + 12 * MS), now + 12 * MS)
    assert one.update(now + 12 * MS) is LinkState.CONNECTED
    now += 13 * MS
    other.accept(one.packet(SAMPLE, now), now)
    late = other.packet(SAMPLE, now)
    one.accept(late, now + 12 * MS)
    assert one.update(now + 12 * MS) is LinkState.LOST
    assert one.reason.startswith("the largest delays of 10 s sum to 24.0 ms, bound 20.0 ms")
