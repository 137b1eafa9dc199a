"""Segment: time, determinism, links and size."""

from __future__ import annotations

import itertools
import struct
import threading

import pytest

from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo, demo_segment
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame
from tests.virtual.main_device import STATION, MainDevice

BRD = encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")])


def test_time_advances_only_while_waiting() -> None:
    with demo_segment().open_link() as link:
        before = link.now()
        link.send(BRD)
        assert link.receive() is None
        assert link.now() == before
        assert not link.wait_until(before + 5_000_000, False)
        assert link.now() == before + 5_000_000


def test_wait_ends_when_a_frame_arrives() -> None:
    with demo_segment().open_link() as link:
        link.send(BRD)
        assert link.wait_until(10_000_000, True)
        # 60 + 24 bytes at 100 Mbit/s; six devices out, five back, twelve cables
        assert link.now() == 84 * 80 + 6 * 340 + 5 * 300 + 12 * 50
        assert link.receive() is not None
        assert not link.wait_until(10_000_000, True)


def test_frames_sent_together_arrive_in_sequence() -> None:
    with demo_segment().open_link() as link:
        arrivals = []
        for _ in range(3):
            link.send(BRD)
        while link.wait_until(1_000_000, True):
            arrivals.append(link.now())
            link.receive()
        assert [b - a for a, b in itertools.pairwise(arrivals)] == [6720, 6720]


def test_full_queue_raises_an_error() -> None:
    with demo_segment().open_link() as link:
        for _ in range(256):
            link.send(BRD)
        with pytest.raises(OSError, match="refused"):
            link.send(BRD)


def run(steps: int) -> list[bytes]:
    main = MainDevice(Segment([Servo(), Servo()]))
    main.number_stations()
    main.let_pass(30)
    main.start_servo(STATION, 0)
    answers = []
    for k in range(steps):
        out = struct.pack("<HbiiH", (6, 7, 15)[min(k // 10, 2)], 10, 0, 0, 150)
        answers.append(main.exchange_logical(EcatCommand.LRW, 0, out + bytes(13)).data)
        if k == 0:
            main.request(STATION, 8)
        main.let_pass(1)
    return answers


def test_two_runs_are_identical() -> None:
    first, second = run(200), run(200)
    assert first == second
    assert len(set(first)) > 50


def test_only_one_link_can_be_open() -> None:
    segment = demo_segment()
    link = segment.open_link()
    with pytest.raises(ValueError, match="open link"):
        segment.open_link()
    link.close()
    segment.open_link().close()


def test_device_belongs_to_one_segment() -> None:
    coupler = Coupler()
    Segment([coupler])
    with pytest.raises(ValueError, match="already in a segment"):
        Segment([coupler])


def test_three_hundred_devices() -> None:
    segment = Segment([Coupler(), *(Servo() for _ in range(299))])
    main = MainDevice(segment)
    assert main.exchange(EcatCommand.BRD, 0, 0x0130, bytes(2)).working_counter == 300
    main.number_stations()
    assert main.read(STATION + 299, 0x0010, 2) == struct.pack("<H", STATION + 299)


def test_empty_line_returns_no_frames() -> None:
    with Segment([]).open_link() as link:
        link.send(BRD)
        assert not link.wait_until(1_000_000, True)


def test_exception_in_the_service_reaches_the_caller() -> None:
    segment = Segment([DigitalOutputs()])

    def fail() -> None:
        raise RuntimeError("application")

    with segment.open_link() as link:
        segment.service.agenda.after(1_000, fail)
        with pytest.raises(RuntimeError, match="application"):
            link.wait_until(1_000_000, False)


def test_a_wrong_position_does_not_leave_the_segment_locked() -> None:
    segment = Segment([Coupler()])
    for call in (segment._core.refresh_inputs, segment._core.system_time):
        with pytest.raises(IndexError):
            call(7)
    with pytest.raises(IndexError):
        segment._wires.delay_cable(99, 100)
    assert segment._core.system_time(0) >= 0  # would wait for ever on a locked mutex


def test_a_service_in_real_time_switches_the_power(monkeypatch: pytest.MonkeyPatch) -> None:
    segment = Segment([Coupler(), DigitalOutputs()], clock="monotonic")
    switched = threading.Event()
    threads: list[threading.Thread] = []
    switch_off = segment[1].switch_off

    def watched() -> None:
        threads.append(threading.current_thread())
        switch_off()
        switched.set()

    monkeypatch.setattr(segment[1], "switch_off", watched)
    link = segment.open_link()
    try:
        segment.switch_power(1, False)
        assert switched.wait(10.0)
    finally:
        link.close()
    assert threads != [threading.current_thread()]


def test_power_is_switched_at_once_without_a_link() -> None:
    segment = Segment([Coupler(), DigitalOutputs()])
    segment.switch_power(1, False)
    main = MainDevice(segment)
    main.let_pass(2000)  # the coupler detects the loss of the link
    assert main.exchange(EcatCommand.BRD, 0, 0x0130, bytes(2)).working_counter == 1
    with pytest.raises(ValueError, match="no device 2"):
        segment.switch_power(2, True)
