"""`main.diagnose()` with and without a running loop."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.bus.diagnosis import Diagnosis
from catenary.model.finding import Kind
from catenary.model.topology import Cable
from catenary.procedure.cable_traffic import exercise
from catenary.virtual import Junction, faults


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment(
        [
            cat.virtual.Coupler(),
            cat.virtual.Servo(),
            cat.virtual.Servo(),
            cat.virtual.DigitalOutputs(),
        ]
    )


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_a_segment_without_faults(main: cat.MainDevice) -> None:
    main.scan()
    found = main.diagnose()
    assert not found
    assert str(found) == "no faults found in 4 devices"


def test_broken_frames_name_the_cable(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    segment.core.poke(2, 0x0300, b"\x09")
    found = main.diagnose()
    assert [each.kind for each in found.findings] == [Kind.CABLE]
    assert str(found).startswith(
        "the cable between device 1 (Catenary virtual servo) port 1 and device 2"
    )


def test_since_an_earlier_diagnosis(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    segment.core.poke(2, 0x0300, b"\x09")
    first = main.diagnose()
    assert not main.diagnose(since=first)
    segment.core.poke(2, 0x0300, b"\x0b")
    new = main.diagnose(since=first)
    assert "2 broken frames" in str(new)


def test_silence_names_the_cable(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    segment.plug(devices=2)
    [found] = main.diagnose().findings
    assert (found.kind, found.devices) == (Kind.SILENT, (2, 3))


def after(segment: cat.Segment, main: cat.MainDevice, *injected: faults.Fault) -> Diagnosis:
    """Return the diagnosis after half a second of traffic with faults."""
    subs = main.passive_scan()
    before = main.diagnose(subs=subs)
    for fault in injected:
        segment.inject(fault)
    _, lost = main.converse(exercise(2.0))
    return main.diagnose(subs=subs, since=before, lost_frames=lost)


@pytest.mark.parametrize("between", [(0, 1), (1, 2), (2, 3)])
def test_corrupt_frames_name_their_cable(
    segment: cat.Segment, main: cat.MainDevice, between: tuple[int, int]
) -> None:
    [found] = after(segment, main, faults.corrupt(20, every=4, between=between)).findings
    assert found.cable is not None
    assert (found.cable.upper, found.cable.lower) == between
    assert found.evidence.startswith("20 broken frames at device")


def test_a_branch_with_a_bad_cable() -> None:
    devices = [Junction(), cat.virtual.Servo(), cat.virtual.Servo(), cat.virtual.DigitalOutputs()]
    segment = cat.Segment(devices, behind={2: (0, 2)})
    with cat.MainDevice(segment) as main:
        [found] = after(segment, main, faults.corrupt(20, every=4, between=(0, 2))).findings
    assert found.cable == Cable(0, 2, 2)


def test_a_cable_that_was_pulled_and_plugged_in(segment: cat.Segment, main: cat.MainDevice) -> None:
    [found] = after(segment, main, faults.cut(between=(1, 2), for_=0.1)).findings
    assert found.cable == Cable(1, 1, 2)
    assert found.evidence.count("1 lost link at device") == 2


def test_a_device_that_was_switched_off_and_on(segment: cat.Segment, main: cat.MainDevice) -> None:
    [found] = after(segment, main, faults.power_cycle(2, for_=0.1)).findings
    assert (found.kind, found.devices) == (Kind.SILENT, (2,))
    assert "it has lost its station address" in found.evidence


def test_a_device_that_returned_by_itself_had_no_power(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    """After it gets its address again, its counters can be read, and show a restart."""
    subs = main.passive_scan()
    before = main.diagnose(subs=subs)
    segment.inject(faults.power_cycle(2, for_=0.1))
    main.converse(exercise(0.5))
    segment.core.poke(2, 0x0010, subs[2].station.address.to_bytes(2, "little"))
    [found] = main.diagnose(subs=subs, since=before).findings
    assert (found.kind, found.devices) == (Kind.POWER, (2,))


def test_lost_frames_without_a_faulty_cable(segment: cat.Segment, main: cat.MainDevice) -> None:
    [found] = after(segment, main, faults.lose_frames(20, every=4, way="back")).findings
    assert found.kind is Kind.MAIN
    assert found.evidence == (
        "20 frames did not return undamaged, but no device has counted a broken one"
    )


def test_a_device_with_an_error_is_named(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    segment.core.show_al_status(1, 0x14, 0x001B)
    [found] = main.diagnose().findings
    assert found.evidence == (
        "in SAFE-OP with an error, AL status code 0x001B: SyncManager watchdog"
    )


def test_diagnosis_of_devices_of_a_passive_scan(segment: cat.Segment, main: cat.MainDevice) -> None:
    segment.core.poke(2, 0x0300, b"\x09")
    assert main.diagnose(subs=main.passive_scan())
    assert len(main.subs) == 0


def test_diagnosis_from_another_thread_while_a_loop_runs(segment: cat.Segment) -> None:
    segment.core.poke(2, 0x0300, b"\x09")
    results: list[Diagnosis] = []
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3, stop=cat.StopPolicy(late_limit=0)) as loop:
            asking = threading.Thread(target=lambda: results.append(main.diagnose()))
            asking.start()
            for cycle in loop:
                if not asking.is_alive():
                    break
                assert cycle.time < 3600, "the answer never came"
            asking.join()
    [found] = results[0].findings
    assert found.kind is Kind.CABLE


def test_diagnosis_in_the_loops_thread_is_refused(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3) as loop:
            next(iter(loop))
            with pytest.raises(RuntimeError, match="in the loop's thread"):
                main.diagnose()
