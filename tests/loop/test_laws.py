"""Laws in a loop: compiled and as Python, arguments, refusals and failures."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.errors import LawError
from tests.loop_options import grouped

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
COUNTS = 2**20


@contextmanager
def opened(mode: str = "csp", **more: Any) -> Iterator[tuple[cat.Drives, cat.Loop]]:
    with cat.MainDevice(
        cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.Servo()])
    ) as main:
        arm = cat.Drives(
            main.scan().drives, mode=mode, counts_per_turn=COUNTS, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3, **grouped(more)) as loop:
            yield arm, loop


@cat.law
def pd(actual, target, memory, time):
    for i in range(actual.n):
        error = memory[0] - actual.position[i]
        target.torque[i] = memory[1] * error - memory[2] * actual.velocity[i]
    return time > 3.0


@cat.law
def sine(actual, target, memory, time):
    for i in range(actual.n):
        target.position[i] = 0.1 * math.sin(time)
    return time > 0.5


@cat.law
def count(actual, target, memory, time, parameters, enabled, dt, ok, n):
    memory[0] += parameters[0]
    memory[1] = enabled[0] + enabled[1]
    memory[2] = dt
    memory[3] = ok
    memory[4] = n
    return memory[0] > 100.0


FACTOR = 2.0


@cat.law
def scaled(memory, parameters):
    memory[0] = FACTOR * parameters[0]
    return True


@cat.law
def returns_in_one_branch(memory):
    memory[0] += 1.0
    if memory[0] > 20.0:
        return True


def test_a_law_without_a_return_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba's result is then optional. Its conversion must not raise in the cycle thread."""
    raised: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", raised.append)
    with opened() as (_, loop):
        assert loop.run(returns_in_one_branch, memory=[0.0]).tolist() == [21.0]
    assert raised == []


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_the_law_of_the_documentation_moves_the_arm(run: str) -> None:
    with opened("cst", execution=run, laws=[pd]) as (arm, loop):
        memory = loop.run(pd, memory=[0.5, 4.0, 0.4])
        assert arm.actual.position == pytest.approx(0.5, abs=0.05)
        assert memory.tolist() == [0.5, 4.0, 0.4]
        assert loop.timing.counters["lost"] == 0


def test_compiled_and_as_python_it_does_the_same() -> None:
    tracks = []
    for compiled in (True, False):
        with opened() as (arm, loop):
            loop.run(sine, compiled=compiled)
            tracks.append((arm.target.position.copy(), loop.log["flags"][-50:] & 1))
    assert tracks[0][0] == pytest.approx(tracks[1][0], abs=2e-4)  # one cycle apart
    assert np.array_equal(tracks[0][1], tracks[1][1])


def test_all_arguments_of_a_law() -> None:
    for compiled in (True, False):
        with opened() as (_, loop):
            memory = loop.run(count, np.zeros(5), [2.0], compiled=compiled)
        assert memory.tolist() == [102.0, 2.0, 1e-3, 1.0, 2.0]


def test_loops_use_the_same_code_until_a_global_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    def result() -> float:
        with opened() as (_, loop):
            return float(loop.run(scaled, memory=[0.0], parameters=[3.0])[0])

    assert [result(), result()] == [6.0, 6.0]
    assert len(scaled.compiled) == 1
    monkeypatch.setitem(globals(), "FACTOR", 5.0)
    assert result() == 15.0
    assert len(scaled.compiled) == 2


def test_the_code_of_a_closure_is_not_kept() -> None:
    factor = 2.0

    @cat.law
    def law(memory):
        memory[0] = factor
        return True

    with opened() as (_, loop):
        assert loop.run(law, memory=[0.0])[0] == 2.0
    factor = 3.0
    with opened() as (_, loop):
        assert loop.run(law, memory=[0.0])[0] == 3.0


def test_watched_while_it_runs_parameters_changed_all_at_once() -> None:
    with opened() as (_, loop):
        run = loop.start(count, np.zeros(5), [0.0])
        for cycle in loop:
            if cycle.number == 20:
                assert run.memory[0] == 0.0
                run.parameters = [1.0]
            if not run.running:
                break
        assert run.parameters.tolist() == [1.0]
        assert run.memory[0] == 101.0
        assert run.steps > 110
        assert run.longest >= 0.0
        assert run.overruns == 0
        with pytest.raises(ValueError, match="expected 1 numbers, received 2"):
            run.parameters = [1.0, 2.0]
        with pytest.raises(ValueError, match="one-dimensional"):
            run.memory = np.zeros((5, 1))


def test_stopped_it_leaves_the_axes_to_python() -> None:
    with opened() as (arm, loop):
        run = loop.start(sine)
        for cycle in loop:
            if cycle.number == 100:
                run.stop()
            if not run.running:
                break
        stood = arm.target.position.copy()
        for cycle in loop:
            arm.target.position[:] = stood
            if cycle.number > 200:
                break
        assert arm.actual.position == pytest.approx(stood, abs=1e-3)


def test_columns_by_name_and_by_bank() -> None:
    segment = cat.Segment(
        [cat.virtual.DigitalOutputs(), cat.virtual.DigitalInputs(), cat.virtual.Servo()]
    )

    @cat.law
    def follow(actual, target, memory, time):
        target["Channel 2 Output"] = 1
        target.bits[0] = 1
        memory[0] = actual["following_error"][0]
        memory[1] = actual.bits[0]
        return time > 0.02

    with cat.MainDevice(segment) as main:
        subs = main.scan()
        lamps, buttons = cat.Outputs(subs[0]), cat.Inputs(subs[1])
        arm = cat.Drives(
            subs.drives,
            mode="csp",
            counts_per_turn=COUNTS,
            velocity_limit=100.0,
            columns=["following_error"],
        )
        with cat.Loop(arm, lamps, buttons) as loop:
            for compiled in (True, False):
                memory = loop.run(follow, memory=[9.0, 9.0], compiled=compiled)
                assert abs(memory[0]) < 1e-3
                assert memory[1] == 0.0
            assert lamps.names[1] == "Channel 2 Output"


# ---- refused when compiling, with the line


def prints(actual, target, memory, time):
    print(time)


def raises(actual, target, memory, time):
    if time > 1.0:
        raise ValueError("too late")


def asserts(actual, target, memory, time):
    assert time < 1.0


def returns_text(actual, target, memory, time):
    return "done"


def lacks(actual, target, memory, time):
    target.position[0] = float(input())


def misspelt(actual, target, memory, time):
    target.posiiton[0] = 1.0


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (prints, r"test_laws\.py:\d+: `print`"),
        (raises, r"test_laws\.py:\d+: `raise`"),
        (asserts, r"test_laws\.py:\d+: `assert`"),
        (returns_text, "returns .*str"),
        (lacks, r"cannot be compiled"),
        (misspelt, r"posiiton.*\n.*target has position"),
    ],
)
def test_refused_before_anything_moves(law: Callable, said: str) -> None:
    with opened() as (arm, loop):
        with pytest.raises(LawError, match=said):
            loop.run(law)
        next(loop)
        assert all(arm.enabled)


def test_an_argument_no_law_has() -> None:
    with pytest.raises(LawError, match=r"invalid argument 'speed'"):

        @cat.law
        def drive(actual, speed):
            pass

    with pytest.raises(TypeError, match="plain function"):
        cat.law(3)


def test_handled_exceptions_are_allowed() -> None:
    @cat.law
    def handles(actual, target, memory, time):
        try:
            if time > 0.01:
                raise ValueError("handled")
        except Exception:
            return True
        return False

    with opened() as (_, loop):
        loop.run(handles)


def test_allocating_is_allowed_with_a_warning() -> None:
    @cat.law
    def vector(actual, target, memory, time):
        target.position[:] = actual.position * 1.0
        return time > 0.01

    with opened() as (_, loop), pytest.warns(UserWarning, match="vector allocates"):
        loop.run(vector)


# ---- failing while running


def divides(actual, target, memory, time):
    if time > 0.01:
        target.position[1] = 1.0 / (time - time)


def out_of_bounds(actual, target, memory, time):
    if time > 0.01:
        target.position[int(memory[0])] = 0.0


def endless(actual, target, memory, time):
    while time > 0.01:
        memory[0] += time


@pytest.mark.parametrize("run", ["threaded", "inline"])
@pytest.mark.parametrize(
    ("law", "said"),
    [
        (divides, "NaN or infinity in the target of 2"),
        (out_of_bounds, r"raised an exception \(IndexError: .*line \d+\)"),
        (endless, "did not return"),
    ],
)
def test_a_failing_law_stops_the_drives(law: Callable, said: str, run: str) -> None:
    with opened(execution=run) as (arm, loop):
        with pytest.raises(LawError, match=said) as caught:
            loop.run(law, memory=[7.0])
        assert caught.value.log is not None
        assert "step 1" in str(caught.value)
        for cycle in loop:
            if cycle.number > 100:
                break
        assert not any(arm.enabled)


def test_a_failing_law_ends_the_iteration_that_watches_it() -> None:
    with opened() as (_, loop):
        loop.start(divides)
        with pytest.raises(LawError, match="NaN"):
            for _cycle in loop:
                pass


def test_one_that_never_returns_from_the_start_is_not_started() -> None:
    @cat.law
    def hangs(actual, target, memory, time):
        while time >= 0.0:
            memory[0] += 1.0

    with opened() as (arm, loop):
        with pytest.raises(LawError, match="when it was tried"):
            loop.run(hangs, memory=[0.0])
        next(loop)
        assert all(arm.enabled)


@pytest.mark.parametrize(
    ("more", "named"), [({"budget": -1.0}, "budget"), ({"overruns": 0}, "overruns")]
)
def test_impossible_budgets(more: dict, named: str) -> None:
    with opened() as (_, loop), pytest.raises(ValueError, match=named):
        loop.run(sine, **more)


def test_a_law_without_axes() -> None:
    @cat.law
    def blink(actual, target, memory, time):
        target["Channel 1 Output"] = 1
        memory[0] += 1.0
        return time > 0.02

    segment = cat.Segment([cat.virtual.DigitalOutputs()])
    with cat.MainDevice(segment) as main:
        lamps = cat.Outputs(main.scan()[0])
        with cat.Loop(lamps) as loop:
            assert loop.run(blink, memory=[0.0])[0] == 22.0
            assert segment[0].outputs == 1
