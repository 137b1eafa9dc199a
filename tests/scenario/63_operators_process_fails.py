"""The process of an operator is stopped or killed (SIGSTOP, SIGKILL) while it jogs an axis.
Then the process of the loop is stopped and continued during a jog.
In each case the axis stops, and does not move again.
"""

from __future__ import annotations

import signal
from threading import Event

import pytest

import catenary as cat
from catenary.share import JogStatus
from catenary.virtual import Segment, Servo
from tests.share.names import own_name
from tests.share.processes import comes_true, started

CLIENT = """
import sys, time
import catenary as cat
with cat.attach(sys.argv[1]) as arm, arm.lease(for_=3600.0) as command:
    jog = command.jog(0, 0.5)
    moving = False
    while True:
        jog.beat()
        if not moving and jog.status == 1:
            moving = True
            print("moving", flush=True)
        time.sleep(0.02)
"""
LOOP = """
import sys
import catenary as cat
from catenary.virtual import Segment, Servo
segment = Segment([Servo()], clock="monotonic")
with cat.MainDevice(segment) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
    share = cat.Share(sys.argv[1], jog=True)
    stop = cat.StopPolicy(
        late_limit=0, lost_limit=1_000_000, raise_faults=False, on_axis_stopped="event"
    )
    with share, cat.Loop(arm, period=2e-3, watchdog=0, stop=stop, sink=share) as loop:
        for cycle in loop:
            if cycle.number == 100:
                print("running", flush=True)
"""
PATIENT = cat.StopPolicy(
    late_limit=0, lost_limit=1_000_000, raise_faults=False, on_axis_stopped="event"
)


@pytest.mark.parametrize("fate", [signal.SIGSTOP, signal.SIGKILL])
def test_the_axis_of_a_client_that_no_longer_runs_stops(fate: signal.Signals) -> None:
    servo = Servo()
    segment = Segment([servo], clock="monotonic")
    with own_name("operator") as name, cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        share = cat.Share(name, jog=True)
        with (
            share,
            cat.Loop(arm, period=2e-3, watchdog=0, stop=PATIENT, sink=share) as loop,
            cat.attach(name) as reader,
        ):
            next(loop)

            def steps(cycles: int) -> None:
                for _ in range(cycles):
                    next(loop)

            def over() -> bool:
                steps(20)
                return not arm.jogged.any()

            with started(CLIENT, name) as client:
                assert comes_true(lambda: not over())
                while arm.actual.position[0] < 0.05 and arm.jogged.any():
                    steps(1)
                client.process.send_signal(fate)
                assert comes_true(over)
                steps(100)
                at = servo.position_rad
                steps(300)
                assert servo.position_rad == pytest.approx(at, abs=1e-4)
                assert servo.drive_state() == "OPERATION ENABLED"
                answer = reader._opened_desk().motion.answer.load(0)
                assert JogStatus(answer & 0xFF) is JogStatus.EXPIRED
                if fate == signal.SIGSTOP:  # it continues with heartbeats of the old press
                    client.process.send_signal(signal.SIGCONT)
                    steps(300)
                    assert servo.position_rad == pytest.approx(at, abs=1e-4)


def test_a_loop_that_was_stopped_and_continued_does_not_continue_the_jog() -> None:
    with own_name("stopped-loop") as name, started(LOOP, name) as program:
        assert program.line() == "running"
        with cat.attach(name) as reader, reader.lease(for_=3600.0) as lease:
            jog = lease.jog(0, 0.5)

            def is_moving() -> bool:
                jog.beat()
                return bool(jog.status is JogStatus.MOVING and reader.read()["position"][0] > 0.02)

            assert comes_true(is_moving)
            jog.beat()
            program.process.send_signal(signal.SIGSTOP)
            Event().wait(0.5)
            for _ in range(10):
                jog.beat()  # the newest token is still that of before
            program.process.send_signal(signal.SIGCONT)
            assert comes_true(lambda: jog.status.over)
            assert jog.status is JogStatus.EXPIRED
            assert comes_true(lambda: abs(reader.read()["velocity"][0]) < 1e-3)
            at = reader.read()["position"][0]
            after = reader.number
            assert comes_true(lambda: reader.number > after + 300)
            assert reader.read()["position"][0] == pytest.approx(at, abs=1e-3)
