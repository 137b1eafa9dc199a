"""Loops on a double of the kernel master: motion of drives, and the order of calls."""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.drive import ProcessData, StartUp
from catenary.errors import ConfigurationError
from catenary.igh import Master
from catenary.types import DINT, USINT
from tests.igh.double import Double
from tests.igh.loops import kernel_of

TURN = 2 * math.pi


def arm_of(main: cat.MainDevice, **options: object) -> cat.Drives:
    return cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0, **options)


def test_a_scan_finds_drives(main: cat.MainDevice) -> None:
    first, second = main.subs
    assert (first.name, first.identity[:2]) == ("Doubled Drive", (0xAA, 0x402))
    assert second.alias == 7
    assert first.is_drive
    assert str(first.state) == "PRE-OP"
    assert first.description.outputs[0].pdos[0].index == 0x1600
    assert [entry.index for entry in first.description.inputs[0].pdos[0].entries] == [
        *(0x6041, 0x6064, 0x6077, 0x6061)
    ]


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_drives_follow(main: cat.MainDevice, double: Double, run: str) -> None:
    arm = arm_of(main)
    with cat.Loop(arm, execution=run) as loop:
        assert arm.enabled.all()
        home = arm.actual.position.copy()
        np.testing.assert_allclose(home, [0.0, TURN])
        for cycle in loop:
            assert cycle.ok
            arm.target.position[:] = home + 0.1 * min(1.0, 10 * cycle.time)
            if cycle.time > 0.2:
                break
        np.testing.assert_allclose(arm.actual.position, home + 0.1, atol=TURN / 1000)
    assert double.value(0, 0x6041, 0) & 0x6F != 0x27
    assert double.changes()[-1] == "deactivate"
    assert main.subs[0].state == 2


def test_a_law_runs_natively(main: cat.MainDevice) -> None:
    pytest.importorskip("numba")

    @cat.law
    def ramp(actual, target, memory, time):  # type: ignore[no-untyped-def]
        for i in range(actual.n):
            target.position[i] = memory[i] + time
        return time > 0.05

    arm = arm_of(main)
    with cat.Loop(arm, laws=[ramp]) as loop:
        home = arm.actual.position.copy()
        loop.run(ramp, memory=home.tolist())
        assert next(loop).ok
        np.testing.assert_allclose(arm.actual.position, home + 0.05, atol=0.01)


def test_the_calls_of_a_cycle_and_their_order(main: cat.MainDevice, double: Double) -> None:
    with cat.Loop(arm_of(main), execution="inline") as loop:
        next(loop)
        double.forget()
        for _ in range(3):
            next(loop)
        calls = [call for call in double.calls() if not call.startswith("reg_request")]
    one = ["queue 0", "send", "receive", "process 0", "domain_state 0", "master_state"]
    assert calls[: 3 * len(one)] == 3 * one


def test_the_calls_before_operation(main: cat.MainDevice, double: Double) -> None:
    double.forget()
    with cat.Loop(arm_of(main), watchdog=0.05):
        pass
    calls = double.calls()
    first = calls.index("create_domain")
    told = [c for c in calls[first : calls.index("activate") + 1] if "entry " not in c]
    assert told[:4] == [
        "create_domain",
        "slave_config 0 0 aa 402",
        "watchdog 0 2498 500",
        "pdos 0 sync 2 dir 1 pdos 1 watchdog 1",
    ]
    assert "pdos 0 sync 3 dir 2 pdos 1 watchdog 2" in told
    assert told.index("reg_pdo_entry_pos 1 2 0 0") < told.index("reg_pdo_entry_pos 1 3 0 0")
    assert told[-2:] == ["set_send_interval 1000", "activate"]


def test_without_a_watchdog_the_trigger_is_cleared(main: cat.MainDevice, double: Double) -> None:
    double.forget()
    with cat.Loop(arm_of(main), watchdog=0):
        pass
    calls = double.calls()
    assert "pdos 0 sync 2 dir 1 pdos 1 watchdog 2" in calls
    assert not [call for call in calls if call.startswith("watchdog")]


def test_the_mapping_is_changed_if_an_object_is_missing(
    main: cat.MainDevice, double: Double
) -> None:
    """Torque control needs 0x6071, which is not mapped, so the master gets a new mapping."""
    arm = cat.Drives(main.subs.drives, mode="cst", counts_per_turn=1000, velocity_limit=100.0)
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.torque[:] = 0.25
            if cycle.number > 20:
                break
        assert arm.enabled.all()
        np.testing.assert_allclose(arm.actual.torque, 0.25, atol=0.01)
    assert "entry 1600 6071:00 16" in double.calls()


def test_sync_units_are_domains(main: cat.MainDevice, double: Double) -> None:
    left, right = main.subs.drives
    one = cat.Drives([left], counts_per_turn=1000, velocity_limit=100.0)
    two = cat.Drives([right], counts_per_turn=1000, velocity_limit=100.0, required=False, divider=2)
    with cat.Loop(one, two, execution="inline") as loop:
        next(loop)
        double.forget()
        for _ in range(4):
            next(loop)
        calls = double.calls()
    assert calls.count("queue 0") == 4
    assert calls.count("queue 1") == 2


def test_a_pulled_cable_ends_the_loop(main: cat.MainDevice, double: Double) -> None:
    def run() -> None:
        with cat.Loop(arm_of(main)) as loop:
            for cycle in loop:
                assert cycle.ok is (cycle.number <= 5)
                if cycle.number == 5:
                    double.cable(0)

    with pytest.raises(cat.errors.WorkingCounterError, match="no device answers"):
        run()
    assert any("main interface lost its link" in str(event) for event in main.events)


def test_an_optional_device_returns(main: cat.MainDevice, double: Double) -> None:
    left, right = main.subs.drives
    one = cat.Drives([left], counts_per_turn=1000, velocity_limit=100.0)
    two = cat.Drives([right], counts_per_turn=1000, velocity_limit=100.0, required=False)
    seen = []
    with cat.Loop(one, two) as loop:
        for cycle in loop:
            assert cycle.ok
            seen.append(bool(two.present[0]))
            if cycle.number == 20:
                double.online(1, 0)
            if cycle.number == 60:
                double.online(1, 1)
            if cycle.number == 120:
                break
    assert (seen[10], seen[40], seen[-1]) == (True, False, True)
    kinds = [type(event).__name__ for event in main.events]
    assert "DeviceLost" in kinds
    assert "DeviceReturned" in kinds


def test_a_lost_device_does_not_delay_a_cycle(main: cat.MainDevice, double: Double) -> None:
    """Answers of present devices are not delayed by the wait for missing frames."""
    left, right = main.subs.drives
    one = cat.Drives([left], counts_per_turn=1000, velocity_limit=100.0)
    two = cat.Drives([right], counts_per_turn=1000, velocity_limit=100.0, required=False)
    with cat.Loop(one, two) as loop:
        next(loop)
        double.online(1, 0)
        for _ in range(20):
            next(loop)
        double.forget()
        for _ in range(64):
            assert next(loop).ok
        assert double.calls().count("receive") < 640  # about 2500 with a wait for all


def test_a_device_that_refuses_op_is_named(main: cat.MainDevice, double: Double) -> None:
    double.register(1, 0x0134, 0x001D)
    arm = arm_of(main)
    double.state(1, 4, 1)
    said = r"device 1 .*SAFE-OP \(AL status code 0x001D"
    with pytest.raises(cat.errors.StateError, match=said) as caught, cat.Loop(arm):
        pass
    assert caught.value.code == 0x001D
    assert double.changes()[-1] == "deactivate"


def test_leaving_op_ends_the_loop(main: cat.MainDevice, double: Double) -> None:
    double.register(0, 0x0134, 0x001B)

    def run() -> None:
        with cat.Loop(arm_of(main)) as loop:
            for cycle in loop:
                if cycle.number == 5:
                    double.state(0, 4, 1)

    with pytest.raises(cat.errors.CatenaryError, match="watchdog") as caught:
        run()
    assert "device 0" in str(caught.value)


def test_the_real_clock(doubles: dict[str, Path]) -> None:
    """A native thread, and Python that may be late. The assertions hold on any machine."""
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path)) as main:
        main.scan()
        arm = arm_of(main)
        with cat.Loop(arm, period=2e-3, stop=cat.StopPolicy(late_limit=0), priority=None) as loop:
            for cycle in loop:
                arm.target.position[:] = arm.actual.position
                if cycle.number > 20:
                    break
            assert main.subs[0].sdo.request(0x6076).cancelled is False
            assert loop.timing is not None
        double.forget()
    assert double.calls() == ["release_master"]
    assert double.reserved() == 0


def test_a_ring_on_the_kernel_master(main: cat.MainDevice, double: Double) -> None:
    with cat.Loop(arm_of(main)) as loop:
        next(loop)
        exchange = kernel_of(main).configuration.exchange
        assert exchange.figures["redundancy"] is False
        double.redundancy(1)
        next(loop)
        next(loop)
        assert exchange.figures["redundancy"] is True
        assert exchange.figures["link_up"] is True


def test_the_plan_is_printed(main: cat.MainDevice) -> None:
    with cat.Loop(arm_of(main)) as loop:
        assert "SyncManager 2" in str(loop.plan)
        assert loop.timing.counters["lost"] >= 0


def test_a_missing_second_interface_is_read_once(main: cat.MainDevice, double: Double) -> None:
    """libethercat prints a line on stderr for each read of a missing interface."""
    with cat.Loop(arm_of(main)) as loop:
        for _ in range(100):
            next(loop)
        calls = double.calls()
    assert calls.count("link_state 1") == 1
    assert calls.count("link_state 0") > 1


def test_the_code_of_an_error_is_read_after_its_acknowledgement(
    main: cat.MainDevice, double: Double
) -> None:
    """The master refuses requests to a device in an error state; a later one succeeds."""
    double.register(0, 0x0134, 0x001B)

    def run() -> None:
        with cat.Loop(arm_of(main)) as loop:
            for cycle in loop:
                if cycle.number == 5:
                    double.forget()
                    double.state(0, 4, 1)

    with pytest.raises(cat.errors.StateError, match="0x001B"):
        run()
    assert sum(call == "reg_request_read 0 0134 2" for call in double.calls()) > 1


def test_send_errors_of_new_libraries_are_counted(doubles: dict[str, Path]) -> None:
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        with cat.Loop(arm_of(main)) as loop:
            next(loop)
            double.fail(b"send", -5)
            next(loop)
            next(loop)
            double.fail(b"", 0)
            assert kernel_of(main).configuration.exchange.figures["send_errors"] >= 1


def test_a_share_and_a_stream_on_the_kernel_master(main: cat.MainDevice) -> None:
    arm = arm_of(main)
    with cat.Share(f"igh-{os.getpid()}") as share, cat.Loop(arm, sink=share) as loop:
        home = arm.actual.position.copy()
        stream = loop.stream(50)
        stream.write(home + np.linspace(0.0, 0.2, 50)[:, None])
        while stream.taken < 50:
            next(loop)
        stream.close()  # the end of the motion; an empty stream would be continued
        for _ in range(10):
            next(loop)
        with cat.attach(f"igh-{os.getpid()}") as reader:
            last = reader.read()
        np.testing.assert_allclose(last["position"], home + 0.2, atol=0.01)


def test_two_masters_in_one_loop(doubles: dict[str, Path], tmp_path: Path) -> None:
    """Each library has its own devices and its own native thread."""
    paths = [doubles["1.6.1"], Path(shutil.copy(doubles["1.6.1"], tmp_path / "second.so"))]
    for path in paths:
        Double(path)
    sources = [Master(number, library=path) for number, path in enumerate(paths)]
    with cat.MainDevice(sources[0]) as first, cat.MainDevice(sources[1]) as second:
        arms = [
            cat.Drives(main.scan().drives, counts_per_turn=1000, velocity_limit=100.0)
            for main in (first, second)
        ]
        with cat.Loop(*arms, period=5e-3, stop=cat.StopPolicy(late_limit=0), priority=None) as loop:
            for cycle in loop:
                assert cycle.ok
                for arm in arms:
                    arm.target.position[:] = arm.actual.position
                if cycle.number > 20:
                    break
            assert all(arm.enabled.all() for arm in arms)


def test_the_master_gets_the_start_up_objects_in_order(
    main: cat.MainDevice, double: Double
) -> None:
    """The kernel writes all objects before the mapping, without a check (docs/how_to/igh.md)."""
    arm = arm_of(
        main,
        start_up=[
            StartUp(0x60C2, 1, 2, type=USINT),
            StartUp(0x605A, 0, b"\x02\x00", before_mapping=True),
        ],
    )
    with cat.Loop(arm):
        told = [call for call in double.changes() if call.startswith("config_sdo 1")]
    places = [call.split()[2] for call in told]
    assert places[0] == "605a:00"
    assert places[-1] == "60c2:01"
    assert double.value(1, 0x60C2, 1) == 2


def test_the_type_of_a_start_up_object_is_required(main: cat.MainDevice) -> None:
    arm = arm_of(main, start_up=[StartUp(0x605A, 0, 2)])
    with pytest.raises(ConfigurationError, match="type of start-up object 0x605A:00 is unknown"):
        main.plan(arm)


def test_process_data_as_bytes_and_by_name(main: cat.MainDevice, double: Double) -> None:
    first, second = main.subs
    raw = ProcessData(first, safe=b"\0\0" + bytes((1, 2, 3, 4)) + b"\0")
    named = ProcessData(second, inputs={"position": (0x6064, 0, DINT)}, outputs={})
    with cat.Loop(raw, named) as loop:
        assert (len(raw.outputs), len(raw.inputs)) == (7, 9)
        raw.outputs[2:6] = (0x12345678).to_bytes(4, "little")
        for _ in range(4):
            assert next(loop).ok
        assert double.value(0, 0x607A, 0) == 0x12345678
        assert named["position"] == 1000
    assert double.value(0, 0x607A, 0) == 0x04030201
