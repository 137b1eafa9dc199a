"""Drives.probe: touch probes of virtual servos, in virtual time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import catenary as cat
from catenary.drive import TouchProbe
from catenary.errors import ConfigurationError, MoveError
from catenary.virtual import Coupler, ProbeOptions, Segment, Servo

COUNTS = 1 << 20
STEP = 2 * 3.141592653589793 / COUNTS  # [rad] of one count


@contextmanager
def opened(
    servo: Servo, *, run: str = "threaded", **options: Any
) -> Iterator[tuple[cat.Drives, cat.Loop]]:
    segment = Segment([Coupler(), servo])
    chosen = {"counts_per_turn": COUNTS, "velocity_limit": 20.0, "touch_probe": True, **options}
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, **chosen)
        with cat.Loop(arm, period=1e-3, execution=run) as loop:
            yield arm, loop


def probed_servo(**options: Any) -> Servo:
    return Servo(touch_probe=ProbeOptions(**options))


def cycles(loop: cat.Loop, count: int) -> None:
    for _ in range(count):
        next(loop)


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_the_position_is_that_of_the_edge_and_not_of_the_cycle(run: str) -> None:
    servo = probed_servo()
    with opened(servo, run=run) as (arm, loop):
        servo.place_probe_switch(1, 0.5123456)
        probe = arm.probe(1, edge="rising")
        move = arm.move_to(1.0, velocity=10.0)
        loop.wait(probe, timeout=5.0)
        assert probe.position == pytest.approx(0.5123456, abs=STEP)
        assert probe.outcome == "captured"
        assert probe.time is None  # without distributed clocks
        loop.wait(move)
        assert len(probe.events) == 1


def test_both_edges_measure_a_width() -> None:
    servo = probed_servo()
    with opened(servo) as (arm, loop):
        servo.place_probe_switch(1, 0.2, 0.3)
        probe = arm.probe(1, edge="both")
        loop.wait(arm.move_to(0.5, velocity=5.0))
        assert probe.done
        found = {event.edge: event.position for event in probe.events}
        assert found == {
            "rising": pytest.approx(0.2, abs=STEP),
            "falling": pytest.approx(0.3, abs=STEP),
        }


def test_the_edges_in_the_other_direction() -> None:
    servo = probed_servo()
    with opened(servo) as (arm, loop):
        servo.place_probe_switch(1, -0.3, -0.2)
        probe = arm.probe(1, edge="rising")
        loop.wait(arm.move_to(-0.5, velocity=5.0))
        assert probe.position == pytest.approx(-0.2, abs=STEP)


def test_units_and_direction_of_the_joint() -> None:
    servo = probed_servo()
    with opened(servo, gear_ratio=10.0, direction=-1, offset=0.1) as (arm, loop):
        servo.place_probe_switch(1, 2.0)
        probe = arm.probe()
        loop.wait(arm.move_to(-0.3, velocity=1.0))
        assert probe.position == pytest.approx(0.1 - 0.2, abs=STEP)


@pytest.mark.parametrize("divider", [1, 3])
@pytest.mark.parametrize("options", [{}, {"keeps_stored": True}])
def test_a_probe_can_be_armed_again(options: dict[str, bool], divider: int) -> None:
    servo = probed_servo(**options)
    with opened(servo, divider=divider) as (arm, loop):
        servo.place_probe_switch(1, 0.2, 0.3)
        first = arm.probe()
        loop.wait(arm.move_to(0.5, velocity=5.0))
        assert first.position == pytest.approx(0.2, abs=STEP)
        second = arm.probe()
        cycles(loop, 20)
        assert second.armed
        assert second.events == ()
        loop.wait(arm.move_to(0.0, velocity=5.0))
        assert second.position == pytest.approx(0.3, abs=STEP)


@pytest.mark.parametrize(
    ("offered", "wanted"),
    [
        ({"times": True, "counters": True}, {}),
        ({"times": False, "counters": False}, {}),
        ({"times": False, "counters": False, "toggles": True}, {"toggles": True}),
    ],
)
def test_continuous_mode_captures_every_edge(offered: dict, wanted: dict) -> None:
    servo = probed_servo(**offered)
    with opened(servo, touch_probe=TouchProbe(**wanted)) as (arm, loop):
        servo.place_probe_switch(1, 0.2, 0.3)
        probe = arm.probe(edge="both", continuous=True)
        loop.wait(arm.move_to(0.5, velocity=2.0))
        loop.wait(arm.move_to(0.0, velocity=2.0))
        assert [event.edge for event in probe.events] == ["rising", "falling"] * 2
        positions = [event.position for event in probe.events]
        assert positions == pytest.approx([0.2, 0.3, 0.3, 0.2], abs=STEP)
        assert (probe.missed, probe.done) == (0, False)
        probe.stop()
        next(loop)
        assert probe.outcome == "stopped"
        loop.wait(probe)  # returns without an error


def test_counters_show_edges_that_were_replaced_within_a_cycle() -> None:
    servo = probed_servo()
    with opened(servo) as (arm, loop):
        probe = arm.probe(continuous=True)
        cycles(loop, 10)
        for _ in range(2):  # the second time, three edges between two cycles
            for level in (True, False) * (1 if not probe.events else 3):
                servo.set_probe_input(1, level)
            cycles(loop, 5)
        assert (len(probe.events), probe.missed) == (2, 2)


def test_the_two_probes_are_independent() -> None:
    servo = probed_servo()
    with opened(servo, touch_probe=TouchProbe(probes=(1, 2))) as (arm, loop):
        servo.place_probe_switch(1, 0.2)
        servo.place_probe_switch(2, 0.4)
        one, two = arm.probe(1), arm.probe(2)
        loop.wait(arm.move_to(0.5, velocity=5.0))
        assert one.position == pytest.approx(0.2, abs=STEP)
        assert two.position == pytest.approx(0.4, abs=STEP)


def test_the_index_pulse_and_a_source_of_0x60d0() -> None:
    servo = probed_servo()
    turn = 2 * 3.141592653589793
    with opened(servo, touch_probe=TouchProbe(probes=(1, 2))) as (arm, loop):
        servo.place_probe_switch(1, 2.0)
        index, other = arm.probe(1, source="index_pulse"), arm.probe(2, source=1)
        loop.wait(arm.move_to(7.0, velocity=10.0))
        assert index.position == pytest.approx(turn, abs=STEP)
        assert other.position == pytest.approx(2.0, abs=STEP)


def test_a_drive_without_touch_probes_is_refused_before_the_loop() -> None:
    with (
        pytest.raises(ConfigurationError, match=r"no object 0x60B8 .*0x06020000"),
        opened(Servo()),
    ):
        raise AssertionError("the loop was opened")


def test_a_drive_that_refuses_both_edges() -> None:
    with opened(probed_servo(one_edge=True)) as (arm, loop):
        probe = arm.probe(edge="both")
        with pytest.raises(MoveError, match=r"was not enabled within 1 s: 0x60B8 = 0x31") as no:
            loop.wait(probe)
        assert "both edges at a time" in no.value.hint
        again = arm.probe(edge="falling")
        cycles(loop, 10)
        assert again.armed


def test_a_refused_source_names_the_object() -> None:
    class Refusing(Servo):
        def add_objects(self, application: Any) -> None:
            super().add_objects(application)
            application.dictionary.add_variable(
                0x60D0, application.slot_entry("Source", 3, 16, 0, 0x07)
            )

    with opened(Refusing(touch_probe=ProbeOptions())) as (arm, loop):
        probe = arm.probe(source=3)
        with pytest.raises(MoveError, match=r"refuses the source 3 \(0x60D0\)"):
            loop.wait(probe)


def test_a_missing_edge_is_reported_after_the_timeout() -> None:
    text = r"touch probe 1 captured no rising edge within 0\.5 s"
    with opened(probed_servo()) as (arm, loop), pytest.raises(MoveError, match=text):
        loop.wait(arm.probe(), timeout=0.5)


def test_a_probe_in_use_is_refused() -> None:
    with opened(probed_servo()) as (arm, loop):
        probe = arm.probe()
        with pytest.raises(ValueError, match=r"already in use: <Probe 1 of 1 .*arming"):
            arm.probe()
        probe.stop()
        cycles(loop, 2)
        assert arm.probe().outcome is None


def test_the_end_of_the_loop_fails_an_armed_probe() -> None:
    with opened(probed_servo()) as (arm, loop):
        probe, other = arm.probe(), arm
        cycles(loop, 5)
    assert probe.outcome == "failed"
    with pytest.raises(RuntimeError, match="loop is closed"):
        other.probe()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"number": 3}, "the probes of a drive are 1 and 2"),
        ({"number": 2}, r"TouchProbe\(probes=\(1, 2\)"),
        ({"edge": "up"}, "must be 'rising', 'falling' or 'both'"),
        ({"edge": "falling"}, r"edges=\('rising', 'falling'\)"),
        ({"source": "switch"}, "'index_pulse', or a code"),
        ({"source": 40000}, "or a code for 0x60D0"),
    ],
)
def test_wrong_arguments(arguments: dict, text: str) -> None:
    option = TouchProbe(edges=("rising",))
    opening = opened(probed_servo(), touch_probe=option)
    with opening as (arm, _), pytest.raises(ValueError, match=text):
        arm.probe(**arguments)


@pytest.mark.parametrize("wrong", [{"probes": ()}, {"probes": (3,)}, {"edges": "rising"}])
def test_wrong_options(wrong: dict) -> None:
    with pytest.raises(ValueError, match="give one or both of"):
        TouchProbe(**wrong)


def test_several_axes_need_a_number() -> None:
    servo = Servo(axes=2, touch_probe=ProbeOptions())
    with opened(servo) as (arm, loop):
        with pytest.raises(ValueError, match=r"needs axis=.*0: 1 .*, 1: 1 "):
            arm.probe()
        with pytest.raises(IndexError, match="no such axis"):
            arm.probe(axis=2)
        servo.place_probe_switch(1, 0.2, axis=1)
        probe = arm.probe(axis=1)
        loop.wait(arm.move_to([0.1, 0.5], velocity=5.0))
        assert probe.position == pytest.approx(0.2, abs=STEP)


def test_a_drive_that_cannot_map_the_other_edge() -> None:
    servo = Servo(touch_probe=ProbeOptions(times=False, counters=False))
    pdos = {
        0x1600: [(0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32), (0x60B8, 0, 16)],
        0x1A00: [
            *((0x6041, 0, 16), (0x6061, 0, 8), (0x6064, 0, 32)),
            *((0x60B9, 0, 16), (0x60BA, 0, 32)),
        ],
    }
    with opened(servo, pdos=pdos, measured=["position"]) as (arm, loop):
        with pytest.raises(ValueError, match=r"the falling edge of probe 1 \(0x60BB\) is not in"):
            arm.probe(edge="falling")
        servo.place_probe_switch(1, 0.2)
        probe = arm.probe()
        loop.wait(arm.move_to(0.5, velocity=5.0))
        assert probe.position == pytest.approx(0.2, abs=STEP)


def test_a_counter_that_wraps_is_continued() -> None:
    servo = Servo(counts_per_turn=COUNTS, touch_probe=ProbeOptions())
    span = (1 << 32) * STEP  # 25 735 rad
    start = span / 2 - 0.5
    segment = Segment([Coupler(), servo])
    with cat.MainDevice(segment) as main:
        main.scan()
        servo.move_to(start)
        arm = cat.Drives(
            main.subs.drives, counts_per_turn=COUNTS, velocity_limit=20.0, touch_probe=True
        )
        with cat.Loop(arm, period=1e-3) as loop:
            servo.place_probe_switch(1, start + 0.8)
            probe = arm.probe()
            loop.wait(arm.move_by(1.0, velocity=5.0))
            assert probe.position == pytest.approx(start + 0.8, abs=2 * STEP)


def test_the_time_of_an_edge_on_the_clock_of_the_loop() -> None:
    servo = probed_servo()
    with opened(servo, dc=True) as (arm, loop):
        loop.wait_locked()
        servo.place_probe_switch(1, 0.5)
        probe = arm.probe()
        loop.wait(probe_move := arm.move_to(1.0, velocity=5.0))
        assert probe_move.done
        [event] = probe.events
        assert event.time is not None
        # read in one of the next cycles, never before the edge
        assert 0 <= event.cycle_time - event.time < 5e-3


def test_the_time_of_an_edge_after_a_jump_of_the_system_time() -> None:
    servo = probed_servo()
    with opened(servo) as (arm, loop):
        arm.probe()
        cycles(loop, 10)
        before = arm.actual.position[0]
        offset = 10**18  # of 0x0920, as another master would write it
        servo.core.poke(servo.position, 0x0920, offset.to_bytes(8, "little"))
        servo.set_probe_input(1, True)
        expected = servo.core.system_time(servo.position) & 0xFFFF_FFFF
        cycles(loop, 5)
        assert arm.actual["touch_probe_1_rising"][0] == pytest.approx(before, abs=10 * STEP)
        assert arm.actual["touch_probe_1_rising_time"][0] == expected


def test_the_time_of_an_edge_on_a_clock_of_32_bits() -> None:
    servo = Servo(clock_bits=32, touch_probe=ProbeOptions())
    with opened(servo, dc=True) as (arm, loop):
        loop.wait_locked()
        probe = arm.probe(continuous=True)
        times = []
        for cycle in loop:  # the stamps wrap every 4.29 s
            if probe.armed and cycle.number % 500 == 0:
                times.append(cycle.time)
                servo.set_probe_input(1, True)
                servo.set_probe_input(1, False)
            if len(times) == 12 and len(probe.events) == 12:
                break
            assert cycle.time < 10.0
        assert times[-1] - times[0] > 4.3
        assert [event.time for event in probe.events] == pytest.approx(times, abs=1e-3)


def test_a_linear_axis_measures_metres() -> None:
    servo = probed_servo()
    with opened(servo, metres_per_turn=0.01, velocity_limit=0.1) as (arm, loop):
        servo.place_probe_switch(1, 3.141592653589793)
        probe = arm.probe()
        loop.wait(arm.move_to(0.02, velocity=0.05, until=probe))
        assert probe.position == pytest.approx(0.005, abs=1e-8)


def test_edges_before_the_first_reading_are_counted() -> None:
    servo = probed_servo()
    with opened(servo) as (arm, loop):
        probe = arm.probe(continuous=True)
        cycles(loop, 10)
        for level in (True, False) * 3:
            servo.set_probe_input(1, level)
        cycles(loop, 5)
        assert (len(probe.events), probe.missed) == (1, 2)


def test_an_interrupted_probe_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    with opened(probed_servo()) as (arm, loop):
        probe = arm.probe()
        cycles(loop, 5)
        with monkeypatch.context() as patch:

            def interrupted(self: object, edge: str) -> bool:
                raise KeyboardInterrupt

            patch.setattr("catenary.drive.probe.Probe._stored", interrupted)
            with pytest.raises(KeyboardInterrupt):
                next(loop)
        assert probe.outcome == "failed"
        assert "was interrupted" in str(probe.error)


def test_a_law_or_a_stream_cannot_start_while_a_probe_is_armed() -> None:
    with opened(probed_servo()) as (arm, loop):
        probe = arm.probe()
        with pytest.raises(RuntimeError, match=r"a stream cannot start .* a touch probe is in use"):
            loop.stream(100)
        probe.stop()
        loop.wait(probe)
        loop.stream(100).close()
