"""Services of the bridge, and parameters of laws, with a loop in the background."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.ros2 import messages
from catenary.ros2.bridge import Bridge
from catenary.ros2.config import Config, LawParameters, Services
from catenary.virtual import Segment
from catenary.virtual.devices import Coupler, Servo
from catenary.wire.cia402 import AxisState, state_of
from tests.record.beside import until
from tests.remote.programs import Running, program
from tests.ros2.memory_backend import MemoryBackend

PATIENT = Services(timeout=60.0)


@contextmanager
def bridged(
    *, jog: bool = True, segment: Segment | None = None, **options: object
) -> Iterator[tuple[Running, MemoryBackend, Bridge]]:
    policy = cat.StopPolicy(on_axis_stopped="event", raise_faults=False)
    with program(jog=jog, stop=policy, segment=segment) as running:
        backend = MemoryBackend()
        config = Config(services=PATIENT, **options)
        with Bridge(running.name, backend, config) as bridge:
            bridge.step()
            yield running, backend, bridge


def answer(backend: MemoryBackend, service: str) -> tuple[bool, str]:
    return backend.services[service](None)


def test_stop_disables_and_enable_enables_again() -> None:
    with bridged() as (running, backend, _):
        assert until(lambda: bool(running.arm.enabled.all()))
        done, text = answer(backend, "stop")
        assert done, text
        assert until(lambda: not running.arm.enabled.any())
        done, text = answer(backend, "enable")
        assert done, text
        assert until(lambda: bool(running.arm.enabled.all()))


def test_reset_clears_a_fault() -> None:
    servo = Servo()
    with (
        bridged(segment=Segment([Coupler(), servo])) as (running, backend, _),
        cat.attach(running.name) as reader,
    ):

        def state() -> AxisState | None:
            return state_of(int(reader.read()["statusword"][0]))

        assert until(lambda: bool(running.arm.enabled.all()))
        servo.inject_fault(0x7500)
        assert until(lambda: state() is AxisState.FAULT)
        servo.inject_fault(0)  # removes the cause
        done, text = answer(backend, "reset")
        assert done, text
        assert until(lambda: state() is not AxisState.FAULT)


def test_a_refusal_has_its_reason() -> None:
    with bridged(jog=False) as (_, backend, _bridge):
        assert answer(backend, "enable") == (
            False,
            "enable: refused: the program does not allow it",
        )


def test_home_starts_the_homing() -> None:
    with bridged() as (running, backend, _):
        assert until(lambda: bool(running.arm.enabled.all()))
        done, text = answer(backend, "home")
        assert done, text
        assert f"homing of {running.arm.names[0]} has started" in text


def test_a_service_without_a_loop_fails() -> None:
    with bridged() as (running, backend, bridge):
        running.loop.close()
        bridge.step()
        bridge._source._news_at = 0.0  # lets 1 s without a cycle pass
        bridge.step()
        done, text = answer(backend, "stop")
        assert not done
        assert "the loop has ended" in text


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ([1.0, 2.0], "needs 1 finite numbers"),
        ([float("nan")], "needs 1 finite numbers"),
        ([1.0], "the law 'impedance' does not run"),
    ],
)
def test_parameters_that_cannot_be_set_are_reported(data: list[float], reason: str) -> None:
    parameters = (LawParameters(law="impedance", topic="stiffness", names=("stiffness",)),)
    with bridged(parameters=parameters) as (_, backend, bridge):
        backend.deliver("stiffness", messages.Float64MultiArray(data=data))
        backend.spin_once(0.0)
        assert until(lambda: bool(bridge.reports.texts))
        assert reason in bridge.reports.texts[-1]


def test_parameters_of_a_running_law_are_set() -> None:
    pytest.importorskip("numba")

    @cat.law(parameters=["stiffness", "damping"])
    def impedance(target, parameters):  # type: ignore[no-untyped-def]
        target.position[0] = 0.0 * parameters[0]

    parameters = (LawParameters(law="impedance", topic="stiffness", names=("stiffness",)),)
    with bridged(parameters=parameters) as (running, backend, _):
        run = running.loop.start(impedance, parameters=[1.0, 2.0])
        backend.deliver("stiffness", messages.Float64MultiArray(data=[7.0]))
        backend.spin_once(0.0)
        assert until(lambda: run.parameters.tolist() == [7.0, 2.0])


def test_parameters_of_a_law_are_parameters_of_the_node() -> None:
    pytest.importorskip("numba")

    @cat.law(parameters=["stiffness"])
    def impedance(target, parameters):  # type: ignore[no-untyped-def]
        target.position[0] = 0.0 * parameters[0]

    with bridged() as (running, backend, bridge):
        run = running.loop.start(impedance, parameters=[1.0])

        def declared() -> bool:
            bridge.step()
            return "impedance.stiffness" in backend.declared

        assert until(declared)
        assert backend.change({"impedance.stiffness": 2.0}) == ""
        assert run.parameters.tolist() == [2.0]


def test_parameters_can_be_switched_off() -> None:
    with program() as running:
        backend = MemoryBackend()
        config = Config(services=Services(parameters=False))
        with Bridge(running.name, backend, config):
            assert "enable" in backend.services
            assert not hasattr(backend, "change")
