"""The image table: copies are checked, and no call follows its end."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.core import Engine
from catenary.igh._ecrt import Exchange, KernelTime
from catenary.igh.configure import Domain
from catenary.igh.library import Library
from catenary.igh.master import Master
from catenary.loop.external_cycle import carried
from tests.igh.double import Double
from tests.igh.loops import kernel_of
from tests.loop_options import grouped


@pytest.fixture
def library(doubles: dict[str, Path]) -> Library:
    Double(doubles["1.6.1"])
    return Library(doubles["1.6.1"])


@pytest.mark.parametrize(
    ("outputs", "inputs", "said"),
    [
        ([(6, 0, 4)], [], "exceed a domain of 8"),
        ([(0, 14, 4)], [], "exceed an image of 16"),
        ([], [(0, 0, 0)], "exceed a domain"),
        ([], [(-1, 0, 2)], "exceed a domain"),
        ([], [(0, -1, 2)], "exceed an image"),
    ],
)
def test_a_copy_outside_a_domain_or_image_is_refused(
    library: Library, outputs: list[object], inputs: list[object], said: str
) -> None:
    domain = Domain(1, 1, 0, False, data=1, size=8, outputs=outputs, inputs=inputs)
    with pytest.raises(ValueError, match=said):
        Exchange(KernelTime(True), library, 1, [domain], 16, 16)


def test_virtual_time_advances_only_in_waits() -> None:
    time = KernelTime(True)
    begin = time.now()
    assert time.wait_until(begin + 5_000_000, True) is False
    assert time.now() == begin + 5_000_000
    machine = KernelTime()
    assert machine.now() <= machine.now()
    assert machine.receive() is None
    with pytest.raises(cat.CatenaryError, match="sends only its own frames"):
        machine.send(bytes(60))


def test_an_engine_refuses_an_image_of_another_plan(doubles: dict[str, Path]) -> None:
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        both = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        plan = carried(main.plan(both))
        other = carried(
            main.plan(
                cat.Drives([main.subs[0]], counts_per_turn=1000, velocity_limit=100.0, mode="cst")
            )
        )
        main.configure(plan)
        image, link = kernel_of(main).configuration.exchange.capsule, main.link.capsule
        Engine(plan.cycle, link, image)
        with pytest.raises(ValueError, match=r"image: .*the plan has"):
            Engine(other.cycle, link, image)
        with pytest.raises(ValueError, match=r"capsule|incorrect name"):
            Engine(plan.cycle, link, link)


def test_no_call_follows_the_end(doubles: dict[str, Path]) -> None:
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        plan = carried(
            main.plan(cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0))
        )
        main.configure(plan)
        engine = Engine(
            plan.cycle, main.link.capsule, kernel_of(main).configuration.exchange.capsule
        )
        engine.start()
        engine.run(3)
        main.leave()
        double.forget()
        engine.run(3)
        assert double.calls() == []
        engine.stop()


def test_no_domain_is_processed_before_its_frame_is_back(doubles: dict[str, Path]) -> None:
    """The kernel logs "working counter changes" for a domain that is processed too early.

    The wait adapts to the round trip, and an early check must cost nothing. Frames take 400 us. A
    stalled machine only delays checks.
    """
    double = Double(doubles["1.6.1"])
    double.delay(400)
    with cat.MainDevice(Master(library=double.path)) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        with cat.Loop(arm, period=4e-3, stop=cat.StopPolicy(late_limit=0), priority=None) as loop:
            double.early()  # bring-up: the round trip is unknown before the first cycle
            for _ in range(60):
                assert next(loop).ok
            assert double.early() == 0


def test_the_monitor_datagram_is_sent_last_in_threaded_execution(doubles: dict[str, Path]) -> None:
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        with cat.Loop(arm, execution="threaded") as loop:
            double.forget()
            next(loop)
            calls = double.calls()
    first = calls.index("queue 0")
    assert calls[first : first + 5] == [
        *("queue 0", "sync_monitor_queue", "send", "receive", "sync_monitor_process")
    ]


def test_a_ring_without_its_main_interface_causes_no_wait(doubles: dict[str, Path]) -> None:
    """The monitor datagram uses only the main interface.

    The domains return on the other one, and are not delayed until the deadline.
    """
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)
        with cat.Loop(arm, execution="threaded") as loop:
            double.mainless(1)
            assert all(next(loop).ok for _ in range(50))
            double.forget()
            assert next(loop).ok
            assert double.calls().count("receive") < 5  # of some 40 until the deadline
            double.mainless(0)
            assert all(next(loop).ok for _ in range(50))


def test_slow_answers_of_optional_devices_are_received(doubles: dict[str, Path]) -> None:
    """A lost device causes only a short wait, but slow answers must be received."""
    double = Double(doubles["1.6.1"])
    double.delay(20_000)
    with cat.MainDevice(Master(library=double.path)) as main:
        main.scan()
        arm = cat.Drives(
            main.subs.drives, counts_per_turn=1000, velocity_limit=100.0, required=False
        )
        calm = {"late_limit": 0, "priority": None, "watchdog": 2.0, "enable": False}
        with cat.Loop(arm, period=50e-3, **grouped(calm)) as loop:  # type: ignore[arg-type]
            for cycle in loop:
                if arm.present.all() or cycle.number > 100:
                    break
            assert arm.present.all()
