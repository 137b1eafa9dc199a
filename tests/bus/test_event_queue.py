"""The queue of events, and callbacks."""

from __future__ import annotations

import dataclasses
import logging
import threading

import pytest

import catenary as cat
from catenary.bus.event_queue import Callbacks, Events
from catenary.bus.event_types import DeviceLost, Emergency, Event, GatewayWrite
from catenary.procedure.mailbox import ReceivedEmergency
from catenary.virtual import Servo, demo_segment
from catenary.wire import coe


def numbered(count: int) -> list[Event]:
    return [Event(float(number), None, f"number {number}") for number in range(count)]


def test_iterating_removes_the_pending_events() -> None:
    events = Events()
    first, second = numbered(2)
    events.put(first)
    events.put(second)
    assert list(events) == [first, second]
    assert list(events) == []


def test_get_returns_the_oldest_event_or_none() -> None:
    events = Events()
    first, second = numbered(2)
    events.put(first)
    events.put(second)
    assert [events.get(), events.get(), events.get()] == [first, second, None]


def test_writes_of_tools_give_way_to_other_events() -> None:
    events = Events(capacity=10)
    others = numbered(5)
    for event in others:
        events.put(event)
    for number in range(100):
        events.put(GatewayWrite(5.0 + number, None, "", "", "", "", None, None, b""))
    assert events.dropped == 95
    assert list(events)[:5] == others
    for number in range(10):
        events.put(GatewayWrite(5.0 + number, None, "", "", "", "", None, None, b""))
    for event in others * 2:
        events.put(event)
    assert list(events) == others * 2


def test_get_waits_for_another_thread() -> None:
    events = Events()
    [event] = numbered(1)
    thread = threading.Thread(target=events.put, args=(event,))
    thread.start()
    assert events.get(timeout=60.0) is event
    thread.join()


def test_an_event_put_while_iterating_is_returned_too() -> None:
    events = Events()
    first, second = numbered(2)
    events.put(first)
    seen = []
    for event in events:
        seen.append(event)
        if event is first:
            events.put(second)
    assert seen == [first, second]


def test_the_oldest_events_are_dropped_and_counted() -> None:
    events = Events(capacity=3)
    for event in numbered(5):
        events.put(event)
    assert [event.time for event in events] == [2.0, 3.0, 4.0]
    assert events.dropped == 2


def test_in_a_loop_times_count_from_its_first_iteration() -> None:
    events, zero_ns = Events(), 0
    events.put(DeviceLost(7.0, None, "before the loop"))
    events.begin_loop(lambda: zero_ns)
    events.put(DeviceLost(8.0, None, "start-up"))
    events.put(DeviceLost(9.0, None, "start-up"))
    before = events.get()
    early = events.get()
    assert before is not None
    assert early is not None
    assert (before.time, early.time) == (7.0, 8.0)  # the zero is not known yet
    zero_ns = 10_000_000_000
    events.put(DeviceLost(10.5, None, "in the loop"))
    events.end_loop()
    zero_ns = 0
    events.put(DeviceLost(12.0, None, "after the loop"))
    assert [event.time for event in events] == [-1.0, 0.5, 12.0]


def test_a_listener_gets_times_of_the_links_clock() -> None:
    events, told = Events(), list[float]()
    events.begin_loop(lambda: 2_000_000_000)
    events.listen(lambda event: told.append(event.time))
    event = DeviceLost(3.0, None, "in the loop")
    events.put(event)
    assert told == [3.0]
    assert events.stamped(event).time == 1.0


def test_an_event_is_frozen_and_has_a_readable_text() -> None:
    event = DeviceLost(1.5, None, "device 3 (Servo) does not answer")
    assert str(event) == "1.500 s: device 3 (Servo) does not answer"
    with pytest.raises(dataclasses.FrozenInstanceError):
        event.time = 2.0  # type: ignore[misc]


def test_callbacks_are_called_in_a_thread_and_in_order() -> None:
    callbacks = Callbacks()
    told: list[tuple[float, bool]] = []
    main = threading.current_thread()
    callbacks.add(lambda event: told.append((event.time, threading.current_thread() is main)))
    for event in numbered(100):
        callbacks.report(event)
    callbacks.close()
    assert told == [(float(number), False) for number in range(100)]


def test_a_callback_that_raises_is_logged_and_the_others_are_called(
    caplog: pytest.LogCaptureFixture,
) -> None:
    callbacks = Callbacks()
    callbacks.in_thread = False
    told: list[Event] = []

    def fails(event: Event) -> None:
        raise RuntimeError("a mistake of the user's")

    callbacks.add(fails)
    callbacks.add(told.append)
    [event] = numbered(1)
    callbacks.report(event)
    with caplog.at_level(logging.ERROR, logger="catenary"):
        callbacks.deliver()
    assert told == [event]
    assert "number 0" in caplog.text
    assert "a mistake of the user's" in caplog.text


def test_slow_callbacks_lose_the_oldest_events_and_block_nothing() -> None:
    callbacks = Callbacks(capacity=2)
    callbacks.in_thread = False
    told: list[float] = []
    callbacks.add(lambda event: told.append(event.time))
    for event in numbered(5):
        callbacks.report(event)
    callbacks.deliver()
    assert told == [3.0, 4.0]
    assert callbacks.dropped == 3


def test_an_event_put_by_a_callback_is_delivered_later() -> None:
    callbacks = Callbacks()
    callbacks.in_thread = False
    first, second = numbered(2)
    told: list[Event] = []

    def callback(event: Event) -> None:
        told.append(event)
        if event is first:
            callbacks.report(second)
            callbacks.deliver()

    callbacks.add(callback)
    callbacks.report(first)
    callbacks.deliver()
    assert told == [first, second]


def test_an_emergency_is_an_event_with_its_text() -> None:
    with cat.MainDevice(demo_segment()) as main:
        drive = main.scan().drives[0]
        assert drive.channel is not None
        assert drive.channel.listener is not None
        told: list[Event] = []
        main.on_event(told.append)
        received = ReceivedEmergency(
            coe.Emergency(0x8611, 0x21, b"\x01\x00\x00\x00\x00"), 1_500_000_000
        )
        drive.channel.listener(received)
        [event] = main.events
        assert isinstance(event, cat.events.Emergency)
        assert (event.sub, event.time, event.error_code) == (drive, 1.5, 0x8611)
        assert event.text == "following error"
        assert "device 2" in event.message
        assert "0x8611 (following error), error register 0x21, data 01 00 00 00 00" in event.message
        assert told == []  # in virtual time: between two steps
        main.deliver_events()
        assert told == [event]


def test_a_fault_is_reported_with_the_next_reading_of_the_mailbox() -> None:
    segment = demo_segment()
    with cat.MainDevice(segment) as main:
        drive = main.scan().drives[0]
        told: list[Event] = []
        main.on_event(told.append)
        servo = segment[drive.position]
        assert isinstance(servo, Servo)
        servo.inject_fault(0x7305)
        main.link.wait_until(main.link.now() + 1_000_000, False)
        drive.sdo.read(0x1000)
        [event] = main.events
        assert isinstance(event, Emergency)
        assert event.error_code == 0x7305
        assert told == [event]


def test_the_application_sets_a_marker() -> None:
    with cat.MainDevice(demo_segment()) as main:
        before = main.link.now() * 1e-9
        main.mark("gripper closed")
        main.mark("button", time=before - 1.5)
        now, then = main.events
    assert isinstance(now, cat.events.Marker)
    assert (now.message, now.sub) == ("gripper closed", None)
    assert now.time >= before
    assert (then.message, then.time) == ("button", before - 1.5)
