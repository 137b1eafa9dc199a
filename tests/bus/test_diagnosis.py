"""`main.diagnose()`: alone and while a loop runs."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.bus.diagnosis import Diagnosis
from catenary.model.finding import Kind


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.Coupler(), cat.Servo(), cat.Servo(), cat.DigitalOutputs()])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_a_sound_segment(main: cat.MainDevice) -> None:
    main.scan()
    found = main.diagnose()
    assert not found
    assert str(found) == "nothing found: 4 devices"


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


def test_a_device_that_lost_its_power_between_two(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    main.scan()
    segment.core.poke(2, 0x0300, b"\x09")
    first = main.diagnose()
    segment.core.poke(2, 0x0300, b"\x00")
    segment.core.poke(1, 0x0311, b"\x01")
    segment.core.poke(3, 0x0310, b"\x01")
    [found] = main.diagnose(since=first).findings
    assert (found.kind, found.devices) == (Kind.POWER, (2,))


def test_silence_names_the_cable(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    segment.plug(devices=2)
    [found] = main.diagnose().findings
    assert (found.kind, found.devices) == (Kind.SILENT, (2, 3))


def test_a_device_with_an_error_says_so(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    segment.core.show_al_status(1, 0x14, 0x001B)
    [found] = main.diagnose().findings
    assert found.evidence == (
        "in SAFE-OP with an error, AL status code 0x001B: SyncManager watchdog"
    )


def test_on_devices_that_were_only_looked_at(segment: cat.Segment, main: cat.MainDevice) -> None:
    segment.core.poke(2, 0x0300, b"\x09")
    assert main.diagnose(subs=main.look())
    assert len(main.subs) == 0


def test_beside_a_running_loop_from_another_thread(segment: cat.Segment) -> None:
    segment.core.poke(2, 0x0300, b"\x09")
    results: list[Diagnosis] = []
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, mode="csp", counts_per_turn=2**20)
        with cat.Loop(arm, period=1e-3, late_limit=0) as loop:
            asking = threading.Thread(target=lambda: results.append(main.diagnose()))
            asking.start()
            for cycle in loop:
                if not asking.is_alive():
                    break
                assert cycle.time < 3600, "the answer never came"
            asking.join()
        assert loop.timing.lost == 0 if hasattr(loop.timing, "lost") else True
    [found] = results[0].findings
    assert found.kind is Kind.CABLE


def test_in_the_loops_own_thread_it_is_refused(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, mode="csp", counts_per_turn=2**20)
        with cat.Loop(arm, period=1e-3) as loop:
            next(iter(loop))
            with pytest.raises(RuntimeError, match="the loop's own thread"):
                main.diagnose()
