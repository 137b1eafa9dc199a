"""Execution modes, cycle starts and figures, in virtual time."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.core import (
    CYCLE_LATE,
    CYCLE_OK,
    RECORD_FIELDS,
    Cycle,
    Engine,
)
from catenary.plan.cycle import ClockPlan, DatagramKind
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame
from tests.core.rig import (
    MS,
    PERIOD,
    Bench,
    al_status,
    axis,
    bench,
    frame_plan,
    lrw,
    make_plan,
)

EXECUTION_MODES = ("threaded", "inline")


class Trace(Bench):
    """Notes what the engine does with its link, and when."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.engine.stop()
        self.events: list[tuple[str, int]] = []
        send, wait = self.link.table_send, self.link.table_wait_until

        def note_send(*arguments) -> int:
            self.events.append(("send", self.link.time))
            return send(*arguments)

        def note_wait(_, deadline, wake_on_frame) -> int:
            self.events.append(("collect" if wake_on_frame else "wait", deadline))
            return wait(_, deadline, wake_on_frame)

        # the table holds C callbacks: exchange what they call
        self.link.table.send = type(self.link.table.send)(note_send)
        self.link.table.wait_until = type(self.link.table.wait_until)(note_wait)
        self.engine.start()


def traced(execution: str) -> Trace:
    return Trace(make_plan([axis(0)], execution=execution))


def test_threaded_waits_sends_and_collects_by_the_deadline() -> None:
    b = traced("threaded")
    b.steps(2)
    assert b.events == [
        ("wait", PERIOD),
        ("send", PERIOD),
        ("collect", PERIOD + PERIOD // 2),
        ("wait", 2 * PERIOD),
        ("send", 2 * PERIOD),
        ("collect", 2 * PERIOD + PERIOD // 2),
    ]


@pytest.mark.parametrize("execution", ["inline"])
def test_inline_and_law_never_wait_for_frames(execution: str) -> None:
    b = traced(execution)
    b.steps(3)
    kinds = [kind for kind, _ in b.events]
    assert "collect" not in kinds
    assert b.engine.counters["lost"] == 0


def test_inline_sends_when_the_body_ends_and_sees_the_frame_of_the_cycle_before() -> None:
    b = traced("inline")
    b.steps(1)
    assert b.events == [("send", 0), ("wait", PERIOD)]
    b.drives[0].position = 5  # after the frame passed
    b.engine.next()
    assert b.actual_position[0] == pytest.approx(0.005)
    assert b.events[2:] == [("send", PERIOD), ("wait", 2 * PERIOD)]


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_number_time_and_cycle_starts(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    seen = []
    for _ in range(5):
        b.engine.next()
        seen.append((b.engine.number, b.engine.time_ns))
    assert seen == [(k + 1, k * PERIOD) for k in range(5)]
    assert b.engine.counters["cycles"] == 5


@pytest.mark.parametrize(("spent", "skipped"), [(2.5, 2), (3.0, 3)])
def test_inline_skips_missed_cycle_starts_without_bursts(spent: float, skipped: int) -> None:
    b = bench(axis(0), execution="inline")
    b.steps(2)
    sent = len(b.link.sent)
    b.engine.spend(int(spent * PERIOD))
    flags = b.engine.next()
    assert flags & CYCLE_LATE
    assert b.engine.skipped == skipped
    assert b.engine.counters["late"] == skipped
    assert b.engine.time_ns == (2 + skipped) * PERIOD
    assert len(b.link.sent) == sent + 1
    assert not b.engine.next() & CYCLE_LATE
    assert b.engine.time_ns == (3 + skipped) * PERIOD


@pytest.mark.parametrize("execution", ["threaded"])
def test_a_late_python_does_not_hold_the_bus_up(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    b.steps(2)
    before = len(b.link.sent)
    b.engine.spend(7 * PERIOD)
    assert len(b.link.sent) == before + 7
    assert b.engine.next() & CYCLE_LATE
    assert b.engine.counters["late"] == 0
    assert b.engine.number == 2 + 7 + 1


def test_a_wait_that_ends_late_keeps_to_the_grid() -> None:
    b = bench(axis(0), execution="inline")
    b.steps(1)
    wait = b.link.table_wait_until

    def oversleep(_, deadline, wake_on_frame) -> int:
        wait(_, deadline, wake_on_frame)
        b.link.time += 2 * PERIOD + 300
        return 0

    b.link.table.wait_until = type(b.link.table.wait_until)(oversleep)
    b.engine.next()
    assert b.engine.time_ns == 3 * PERIOD
    assert b.engine.skipped == 2
    record = records(b)[-1]
    assert record["lateness_ns"] == 300
    assert record["period_ns"] == 3 * PERIOD + 300


def records(b: Bench) -> np.ndarray:
    return np.frombuffer(b.engine.log(), np.dtype(RECORD_FIELDS))


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_the_log_holds_the_last_thousand_cycles(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    b.engine.run(1)
    assert len(records(b)) == 1
    b.engine.run(1499)
    log = records(b)
    assert log["number"].tolist() == list(range(501, 1501))
    assert (np.diff(log["scheduled_ns"]) == PERIOD).all()
    assert (log["flags"] & CYCLE_OK == CYCLE_OK).all()
    assert (log["period_ns"] == PERIOD).all()
    assert (log["al_status"] == 8).all()
    assert (log["al_counter"] == 1).all()


@pytest.mark.parametrize("reach", [1, 1000, 1001, 1100])
def test_the_log_reaches_back_as_far_as_planned(reach: int) -> None:
    b = bench(axis(0), execution="inline", log_cycles=reach)
    b.engine.run(1200)
    assert records(b)["number"].tolist() == list(range(1201 - reach, 1201))


@pytest.mark.parametrize("reach", [0, 1 << 25])
def test_a_log_of_nothing_or_of_gigabytes_is_refused(reach: int) -> None:
    with pytest.raises(ValueError, match="log_cycles"):
        bench(axis(0), execution="inline", log_cycles=reach)


def test_the_log_shows_a_lost_cycle() -> None:
    b = bench(axis(0))
    b.engine.run(5)
    b.segment.spoil = lambda frame: []
    b.engine.run(2)
    log = records(b)
    assert log["lost_in_row"].tolist() == [0] * 5 + [1, 2]
    assert log["missing_frames"].tolist() == [0] * 5 + [1, 1]


def test_phases_of_the_inline_order() -> None:
    b = bench(axis(0), execution="inline")
    b.steps(2)
    b.engine.reset_histograms()
    for _ in range(10):
        b.link.time += 40_000  # the body takes this long
        b.engine.next()
    figures = b.engine.histograms()
    assert figures["process"] == {
        "count": 10,
        "sd": 0.0,
        **dict.fromkeys(("mean", "min", "max", "p50", "p99", "p999"), 40e-6),
    }
    assert figures["in_controller"]["mean"] == 40e-6
    assert figures["period"]["mean"] == 1e-3
    assert figures["round_trip"] == {"count": 0}
    [(lower, upper, count)] = b.engine.histogram_counts("process")
    assert count == 10
    assert lower <= 40e-6 < upper


def test_phases_of_the_threaded_order() -> None:
    b = bench(axis(0))
    b.steps(2)
    b.engine.reset_histograms()
    for _ in range(10):
        b.engine.spend(40_000)
        b.engine.next()
    figures = b.engine.histograms()
    assert figures["process"]["mean"] == 40e-6
    assert figures["round_trip"]["mean"] == 100e-6
    assert figures["in_controller"]["count"] == 10


def test_start_up_without_an_application_has_no_process_phase() -> None:
    for execution in EXECUTION_MODES:
        b = bench(axis(0), execution=execution)
        b.engine.run(20)
        assert b.engine.histograms()["process"] == {"count": 0}


def test_an_unknown_phase_is_refused() -> None:
    with pytest.raises(ValueError, match="lunch"):
        bench(axis(0)).engine.histogram_counts("lunch")


# ---- interruptions and errors of the link


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_an_interrupted_wait_continues_and_sends_once(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    b.steps(1)
    sent = len(b.link.sent)
    b.link.wait_results = [-4, -4]  # -EINTR
    b.steps(1)
    assert len(b.link.sent) == sent + 1
    assert b.ok
    assert b.engine.number == 2


@pytest.mark.parametrize("execution", EXECUTION_MODES)
@pytest.mark.parametrize("method", ["next", "run"])
def test_a_wait_that_fails_is_an_os_error(execution: str, method: str) -> None:
    b = bench(axis(0), execution=execution)
    b.steps(1)
    b.link.wait_results = [-100]  # -ENETDOWN
    with pytest.raises(OSError, match="link") as caught:
        b.engine.next() if method == "next" else b.engine.run(1)
    assert caught.value.errno == 100
    assert b.engine.run(1) & CYCLE_OK  # it may recover


def test_nothing_runs_before_start() -> None:
    b = bench(axis(0))
    with pytest.raises(RuntimeError, match="start it first"):
        Engine(b.plan, b.link.capsule).next()


def test_nothing_runs_after_stop() -> None:
    b = bench(axis(0))
    with pytest.raises(RuntimeError, match="running"):
        b.engine.start()
    b.engine.stop()
    for call in (b.engine.next, lambda: b.engine.run(1), lambda: b.engine.run_until_stopped(1)):
        with pytest.raises(RuntimeError, match="its cycle has ended"):
            call()
    b.engine.stop()


def test_the_grid_continues_after_a_pause() -> None:
    b = bench(axis(0))
    b.engine.run(3)
    b.engine.stop()
    b.link.time += 4 * PERIOD + MS // 3
    b.engine.start()
    b.engine.run(1)
    assert b.engine.number == 4
    assert b.engine.time_ns == 7 * PERIOD
    assert records(b)[-1]["period_ns"] == -1
    assert b.engine.counters["late"] == 0


def test_frames_of_the_former_run_are_not_taken_for_new_ones() -> None:
    b = bench(axis(0))
    b.engine.run(1)
    old = b.segment.answer(b.link.sent[-1])[0][1]
    b.engine.stop()
    b.engine.start()
    b.link.arrive(old, 1000)
    b.engine.run(1)
    assert b.engine.counters["stale"] == 1
    assert decode_frame(old).datagrams[0].index == 0


# ---- overruns


def oversleep(b: Bench, late: int) -> None:
    """The next wait for a cycle start ends `late` [ns] after it; the ones after are punctual."""
    wait = b.link.table_wait_until
    left = [late]

    def sleep(_, deadline, wake_on_frame) -> int:
        result = wait(_, deadline, wake_on_frame)
        if not wake_on_frame:
            b.link.time += left.pop() if left else 0
        return result

    b.link.table.wait_until = type(b.link.table.wait_until)(sleep)


@pytest.mark.parametrize("late", [300_000, 890_000])
def test_a_late_cycle_is_sent_if_its_frames_are_back_before_the_next_cycle_start(late: int) -> None:
    b = bench(axis(0))  # its frames take 100 us
    b.engine.run(3)
    sent = len(b.link.sent)
    oversleep(b, late)
    b.engine.run(2)
    log = records(b)[-2:]
    assert log["lateness_ns"].tolist() == [late, 0]
    assert log["scheduled_ns"].tolist() == [4 * PERIOD, 5 * PERIOD]
    assert log["missing_frames"].tolist() == [0, 0]
    assert len(b.link.sent) == sent + 2
    assert b.engine.counters["late"] == 0


@pytest.mark.parametrize("late", [910_000, 999_000, 1_500_000])
def test_a_late_cycle_whose_frames_would_be_late_is_skipped_and_counted(late: int) -> None:
    b = bench(axis(0))
    b.engine.run(3)
    sent = len(b.link.sent)
    oversleep(b, late)
    b.engine.run(1)
    assert b.engine.skipped == 1
    assert b.engine.time_ns == 4 * PERIOD
    assert len(b.link.sent) == sent + 1
    assert b.engine.counters["late"] == 1
    assert b.engine.counters["lost"] == 0
    [record] = records(b)[-1:]
    assert record["lateness_ns"] == max(late - PERIOD, 0)
    assert record["flags"] & CYCLE_LATE


@pytest.mark.parametrize(("body", "skipped"), [(400_000, 0), (1_300_000, 1), (1_600_000, 1)])
def test_inline_a_body_into_the_next_period_skips_the_cycle_start_and_loses_no_frame(
    body: int, skipped: int
) -> None:
    b = bench(axis(0), execution="inline")
    b.steps(3)
    sent = len(b.link.sent)
    b.engine.spend(body)
    b.engine.next()
    b.engine.next()
    assert b.engine.counters["late"] == skipped
    assert b.engine.counters["lost"] == 0
    assert len(b.link.sent) == sent + 2


# ---- with clocks

CLOCK = ClockPlan(
    follow="reference",
    reference=0,
    reference_station=0x1001,
    followers=(),
    stations=(),
    phase_ns=700_000,
    wire_ns=100_000,
    allowance_ns=200_000,
    bandwidth=0.01,
    rate_limit_ns=1000.0,
    drift_limit_ns=800.0,
    step_ns=PERIOD // 8,
    bound_ns=1000,
)


class DriftingReference(Trace):
    """A drive with the reference clock, which is `PPM` faster than the link's clock."""

    PPM = 150.0

    def __post_init__(self) -> None:
        super().__post_init__()
        process = self.segment.process

        def with_time(datagram: Datagram) -> Datagram:
            if datagram.command != EcatCommand.FRMW:
                return process(datagram)
            time = round(self.link.time * (1 + self.PPM * 1e-6)) + 123_456_789
            data = (time & 0xFFFF_FFFF).to_bytes(4, "little")
            return replace(datagram, data=data, working_counter=1)

        self.segment.process = with_time  # type: ignore[method-assign]


def clocked(execution: str) -> DriftingReference:
    time = Datagram(EcatCommand.FRMW, 0x1001 | 0x0910 << 16, bytes(4))
    frame = frame_plan([al_status(1), lrw(0), (DatagramKind.CLOCK, time, 1, -1)])
    return DriftingReference(
        make_plan([axis(0)], execution=execution, frames=(frame,), clock=CLOCK)
    )


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_cycle_time_is_the_true_time_of_the_cycle_start(execution: str) -> None:
    """Cycle starts follow the reference clock: they are no multiples of the period."""
    b = clocked(execution)
    b.engine.run(50)
    cycle = Cycle(b.engine)
    first = [deadline for kind, deadline in b.events if kind == "wait"][-1]
    for _ in range(2000):
        b.engine.next()
        start = [deadline for kind, deadline in b.events[-3:] if kind == "wait"][-1]
        assert cycle.time == pytest.approx((start - first) * 1e-9, abs=1e-9)
    assert b.engine.clock.figures()["rate"] == pytest.approx(150e-6, rel=0.05)
    assert abs(cycle.time - 2.0) > 100e-6


def test_threaded_frames_later_than_the_margin_are_missed_syncs() -> None:
    b = clocked("threaded")
    b.engine.run(50)
    before = b.engine.counters["missed_sync"]
    oversleep(b, 199_000)
    b.engine.run(2)
    assert b.engine.counters["missed_sync"] == before
    oversleep(b, 201_000)
    b.engine.run(2)
    assert b.engine.counters["missed_sync"] == before + 1
    assert b.engine.counters["late"] == 0


def test_inline_frames_later_than_the_margin_are_missed_syncs() -> None:
    """They leave after the body: the wake-up alone does not tell."""
    b = clocked("inline")
    b.steps(50)
    before = b.engine.counters["missed_sync"]
    b.engine.spend(199_000)
    b.engine.next()
    assert b.engine.counters["missed_sync"] == before
    b.engine.spend(201_000)
    b.engine.next()
    assert b.engine.counters["missed_sync"] == before + 1


def test_without_clocks_there_is_no_missed_sync() -> None:
    b = bench(axis(0))
    oversleep(b, 900_000)
    b.engine.run(5)
    assert b.engine.counters["missed_sync"] == 0
