"""Diagnosis messages and synchronisation counters become events while a loop runs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

import catenary as cat
from catenary.bus.event_types import DiagnosisReported, Event, SynchronisationFault
from catenary.errors import MailboxError, SdoAbort
from catenary.loop.watches.diagnosis import (
    FAILURES_MAX,
    MESSAGES_PER_READING,
    TURN_MAX,
    DiagnosisWatch,
    _increase,
)
from catenary.model.diagnosis_history import SyncCounter
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.mailbox import TURN
from catenary.types import UDINT, USINT
from catenary.virtual import Coupler, HistoryOptions, Segment, Servo
from catenary.virtual.coe.diagnosis_history import FAULT, SYNC_LOST, TEXTS
from catenary.virtual.faults import drive_fault, lose_frames, mailbox_silent
from catenary.wire.al import AlState
from catenary.wire.diagnosis_history import DiagnosisMessage
from tests.bus.test_device_diagnosis import with_texts
from tests.esi import servo_file

INTERVAL = 0.02
HISTORIES = {
    "growing": HistoryOptions(messages=30, message_bytes=0),
    "fixed": HistoryOptions(messages=30, message_bytes=32),
}
ARM = {"counts_per_turn": 2**20, "velocity_limit": 1.0}


@pytest.fixture(params=HISTORIES)
def servo(request: pytest.FixtureRequest) -> Servo:
    return Servo(diagnosis=HISTORIES[request.param])


@pytest.fixture
def main(servo: Servo) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(Segment([Coupler(), servo])) as main:
        main.scan()
        yield main


def open_loop(main: cat.MainDevice, **options: object) -> cat.Loop:
    arm = cat.Drives(main.subs.drives, **ARM)
    return cat.Loop(arm, period=1e-3, diagnosis=INTERVAL, **options)  # type: ignore[arg-type]


def events_after(loop: cat.Loop, main: cat.MainDevice, seconds: float = 0.1) -> list[Event]:
    """Run the loop for some time, and return the events of the watch."""
    for _ in range(round(seconds / 1e-3)):
        next(loop)
    return [e for e in main.events if isinstance(e, DiagnosisReported | SynchronisationFault)]


def text_ids(events: list[Event]) -> list[int]:
    return [each.text_id for each in events if isinstance(each, DiagnosisReported)]


def test_new_messages_are_events(servo: Servo, main: cat.MainDevice) -> None:
    with open_loop(main) as loop:
        assert events_after(loop, main) == []
        servo.store_diagnosis(7, [5], severity="warning", code=0x1234_E000)
        servo.store_diagnosis(8)
        first, second = events_after(loop, main)
        assert isinstance(first, DiagnosisReported)
        assert (first.severity, first.code, first.parameters) == ("warning", 0x1234_E000, (5,))
        assert first.sub is main.subs[1]
        assert first.message.endswith("warning: code 0x1234E000, text 0x0007, parameters 5")
        assert isinstance(second, DiagnosisReported)
        assert second.text_id == 8
        assert 0 < first.time <= second.time
        assert events_after(loop, main) == []


def test_messages_from_before_the_loop_are_not_events(servo: Servo, main: cat.MainDevice) -> None:
    for text_id in range(1, 6):
        servo.store_diagnosis(text_id)
    with open_loop(main) as loop:
        assert events_after(loop, main) == []
        servo.store_diagnosis(9)
        assert text_ids(events_after(loop, main)) == [9]


def test_the_ring_may_wrap_between_two_readings(servo: Servo, main: cat.MainDevice) -> None:
    with open_loop(main) as loop:
        events_after(loop, main)
        for text_id in range(1, 46):
            servo.store_diagnosis(text_id)
            found = text_ids(events_after(loop, main, 0.12))
            assert found == [text_id]


def test_a_flood_is_bounded(servo: Servo, main: cat.MainDevice) -> None:
    with open_loop(main) as loop:
        events_after(loop, main)
        for text_id in range(1, 200):
            servo.store_diagnosis(text_id)
        newest = list(range(200 - MESSAGES_PER_READING, 200))
        assert text_ids(events_after(loop, main, 0.3)) == newest


def test_a_mailbox_in_constant_use_is_read_too(servo: Servo, main: cat.MainDevice) -> None:
    sdo = main.subs[1].sdo
    found: list[int] = []
    with open_loop(main) as loop:
        answers = [sdo.request(0x1018, 1, type=UDINT) for _ in range(3)]
        for cycle in loop:
            answers = [each for each in answers if not each.done]
            answers += [sdo.request(0x1018, 1, type=UDINT) for _ in range(3 - len(answers))]
            if cycle.number == 200:
                servo.store_diagnosis(7)
            found += text_ids(list(main.events))
            if found or cycle.number == 2000:
                break
    assert found == [7]


def test_a_cleared_history_begins_again(servo: Servo, main: cat.MainDevice) -> None:
    servo.store_diagnosis(1)
    with open_loop(main) as loop:
        events_after(loop, main)
        cleared = main.subs[1].sdo.request_write(0x10F3, 3, 0, type=USINT)
        events_after(loop, main)
        assert cleared.done
        servo.store_diagnosis(2)
        assert text_ids(events_after(loop, main)) == [2]


def test_a_loop_does_not_acknowledge(servo: Servo, main: cat.MainDevice) -> None:
    with open_loop(main) as loop:
        servo.store_diagnosis(1)
        events_after(loop, main)
        asked = main.subs[1].sdo.request(0x10F3, 3, type=USINT)
        events_after(loop, main)
        assert asked.result() == 0


def test_without_the_option_nothing_is_read(servo: Servo, main: cat.MainDevice) -> None:
    with cat.Loop(cat.Drives(main.subs.drives, **ARM), period=1e-3) as loop:
        servo.store_diagnosis(1)
        assert events_after(loop, main) == []


def test_a_drive_fault_is_a_message_with_its_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, servo: Servo
) -> None:
    servo_file.write(tmp_path, profile=with_texts(TEXTS))
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path))
    segment = Segment([Coupler(), servo])
    with cat.MainDevice(segment) as main:
        main.scan()
        with open_loop(main, stop=cat.StopPolicy(raise_faults=False)) as loop:
            events_after(loop, main)
            segment.inject(drive_fault(1, code=0x8611, for_=0.01))
            (event,) = events_after(loop, main)
            assert isinstance(event, DiagnosisReported)
            assert (event.text, event.text_id) == ("Fault 0x8611", FAULT)


def test_missed_pulses_are_counted(servo: Servo) -> None:
    segment = Segment([Coupler(), servo])
    with cat.MainDevice(segment) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, dc=True, **ARM)
        with cat.Loop(arm, period=1e-3, diagnosis=INTERVAL) as loop:
            events_after(loop, main, 0.2)
            segment.inject(lose_frames(1))
            events = events_after(loop, main)
            faults = [e for e in events if isinstance(e, SynchronisationFault)]
            (event,) = [e for e in faults if e.counter == "missed"]
            assert event.count == 1
            assert event.index in (0x1C32, 0x1C33)
            assert event.total >= 1
            assert "SM events missed" in event.message
            assert events_after(loop, main) == []


def test_a_lost_synchronisation_is_reported_by_the_device(servo: Servo) -> None:
    """The loop has ended: the message stays on the device, for the next program."""
    segment = Segment([Coupler(), servo])
    with cat.MainDevice(segment) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, dc=True, **ARM)

        def run() -> None:
            with cat.Loop(arm, period=1e-3, diagnosis=INTERVAL) as loop:
                events_after(loop, main)
                segment.inject(lose_frames(for_=0.05))
                events_after(loop, main, 1.0)

        with pytest.raises(cat.LoopError):
            run()
        main.scan()
        messages = main.subs[1].diagnosis.messages()
        assert SYNC_LOST in [each.text_id for each in messages]


def test_a_silent_mailbox_does_not_harm_the_loop(servo: Servo) -> None:
    segment = Segment([Coupler(), servo])
    with cat.MainDevice(segment) as main:
        main.scan()
        with open_loop(main) as loop:
            events_after(loop, main)
            segment.inject(mailbox_silent(1, for_=5.0))
            events_after(loop, main, 6.0)
            servo.store_diagnosis(3)
            assert 3 in text_ids(events_after(loop, main, 30.0))
            assert loop.timing.counters["lost"] == 0


class Device:
    """Device with objects in a dictionary. An integer is the abort code of a refusal."""

    def __init__(self) -> None:
        self.objects: dict[tuple[int, int], bytes | int] = {}
        self.failing: set[int] = set()  # indices
        self.sdo = SimpleNamespace(upload_small=self.upload)
        self.description = SimpleNamespace(coe=True)
        self.diagnosis = SimpleNamespace(texts={})
        self.channel: SimpleNamespace | None = None
        self.state, self.station = AlState.OP, "device 1"
        self.asked: list[tuple[int, int]] = []
        self.events: list[Event] = []
        self.steps = DiagnosisWatch(
            [self],  # type: ignore[list-item]
            1.0,
            put=self.events.append,
            now=lambda: 0.0,
        ).run()

    def upload(self, index: int, subindex: int) -> Procedure[bytes]:
        self.asked.append((index, subindex))
        if index in self.failing:
            raise MailboxError("malformed answer")
        found = self.objects.get((index, subindex), 0x0602_0000)
        if isinstance(found, int):
            raise SdoAbort("refused", position=1, index=index, subindex=subindex, code=found)
        return found
        yield []

    def store(self, *text_ids: int) -> None:
        messages = [DiagnosisMessage(0xE000, 0, each, 0).encode() for each in text_ids]
        self.objects |= {(0x10F3, n): data for n, data in enumerate(messages, 6)}
        self.objects |= {(0x10F3, 1): b"\x10", (0x10F3, 2): bytes((5 + len(messages),))}
        self.objects |= {(0x10F3, 3): b"\0", (0x10F3, 4): b"\1", (0x10F3, 5): b"\0\0"}

    def read(self) -> list[Event]:
        """Make one reading, and return its events."""
        self.events.clear()
        self.asked.clear()
        next(self.steps)
        return list(self.events)


def test_a_refusal_for_now_does_not_end_the_watch() -> None:
    device = Device()
    device.store(1)
    assert device.read() == []
    for place in ((0x10F3, 2), (0x10F3, 4)):
        device.objects[place] = 0x0800_0022  # not in the present state
    assert device.read() == []
    device.store(1, 2)
    assert text_ids(device.read()) == [2]


def test_a_counter_that_is_refused_for_now_keeps_its_count() -> None:
    device = Device()
    counter = 0x1C32, 0x0B
    device.objects = {counter: b"\x07\0", (0x1C32, 0x0C): b"\0\0"}
    assert device.read() == []
    device.objects[counter] = 0x0800_0022
    assert device.read() == []
    device.objects[counter] = b"\x09\0"
    [event] = device.read()
    assert isinstance(event, SynchronisationFault)
    assert (event.count, event.total) == (2, 9)


def test_counters_that_fail_do_not_hide_the_messages() -> None:
    device = Device()
    device.store(1)
    device.failing = {0x1C32}
    assert device.read() == []
    device.store(1, 2)
    assert text_ids(device.read()) == [2]


def test_a_reading_asks_for_no_object_twice() -> None:
    device = Device()
    device.store(1)
    device.read()
    device.store(1, 2)
    assert text_ids(device.read()) == [2]
    assert len(device.asked) == len(set(device.asked))


def test_a_long_transfer_delays_the_other_devices_only_briefly() -> None:
    device = Device()
    transfer = object()
    device.channel = SimpleNamespace(turns=deque([transfer]))
    for _ in range(round(TURN_MAX / TURN)):
        assert next(device.steps) == after(TURN)
    assert next(device.steps) != after(TURN)  # the pause before the next device
    assert device.asked == []
    assert list(device.channel.turns) == [transfer]


def test_a_device_without_these_objects_is_read_once() -> None:
    device = Device()
    assert device.read() == []
    assert device.asked == [
        (0x10F3, 2),
        *((index, n) for index in (0x1C32, 0x1C33) for n in SyncCounter),
    ]
    with pytest.raises(StopIteration):
        device.read()


def test_a_device_with_impossible_numbers_is_left_out() -> None:
    device = Device()
    device.store(1)
    device.objects[0x10F3, 2] = b"\x2c\x01"  # 300
    for _ in range(FAILURES_MAX):
        assert device.read() == []
        assert device.asked
    assert device.read() == []
    assert device.asked == []


@pytest.mark.parametrize("interval", [0.0, -1.0, float("nan"), 1e6])
def test_an_impossible_interval_is_refused(main: cat.MainDevice, interval: float) -> None:
    arm = cat.Drives(main.subs.drives, **ARM)
    with pytest.raises(ValueError, match="diagnosis="):
        cat.Loop(arm, diagnosis=interval)


@pytest.mark.parametrize(
    ("before", "now", "increase"), [(0, 0, 0), (3, 5, 2), (65534, 1, 3), (40, 2, 2)]
)
def test_counters_wrap_and_restart(before: int, now: int, increase: int) -> None:
    assert _increase(before, now) == increase
