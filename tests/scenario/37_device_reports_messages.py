"""Drives store messages and miss SYNC pulses while the loop runs; one floods its history.
With `diagnosis=`, the loop reads them in the acyclic queue, and they become events with texts.
No cycle is lost or late, a request of the program is answered, and nothing is acknowledged.
"""

from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.event_types import DiagnosisReported, SynchronisationFault
from catenary.types import UDINT, USINT
from catenary.virtual import Coupler, HistoryOptions, Segment, Servo
from catenary.virtual.faults import lose_frames
from tests.bus.test_device_diagnosis import with_texts
from tests.esi import servo_file

TEXTS = {3: "Output stage at %u degrees", 4: "Brake not released"}
SERVOS = 8
PERIOD = 1e-3


@pytest.fixture
def servos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Servo]:
    servo_file.write(tmp_path, profile=with_texts(TEXTS))
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path))
    return [Servo(diagnosis=HistoryOptions(messages=60)) for _ in range(SERVOS)]


def test_messages_and_missed_pulses_of_moving_drives(servos: list[Servo]) -> None:
    segment = Segment([Coupler(), *servos])
    messages: list[DiagnosisReported] = []
    faults: list[SynchronisationFault] = []
    with cat.MainDevice(segment) as main:
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0, dc=True)
        with cat.Loop(arm, period=PERIOD, diagnosis=0.2) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 1e-4 * cycle.number
                if cycle.number == 1000:
                    servos[2].store_diagnosis(3, [81], severity="warning")
                    asked = main.subs[3].sdo.request(0x1018, 1, type=UDINT)
                if cycle.number == 1500:
                    segment.inject(lose_frames(1))
                if 2000 <= cycle.number < 2300:
                    servos[5].store_diagnosis(4)  # a message in each cycle
                for event in main.events:
                    if isinstance(event, DiagnosisReported):
                        messages.append(event)
                    elif isinstance(event, SynchronisationFault):
                        faults.append(event)
                if cycle.number == 4000:
                    break
            assert loop.timing.counters["lost"] == 1  # the injected one
            assert asked.result() == 0x43544E59
    warning, *flood = messages
    assert (warning.text, warning.severity) == ("Output stage at 81 degrees", "warning")
    assert warning.sub is not None
    assert warning.sub.position == 3
    assert {(each.text, each.sub.position) for each in flood if each.sub is not None} == {
        ("Brake not released", 6)
    }
    assert 20 <= len(flood) <= 300
    missed = {each.sub.position for each in faults if each.counter == "missed" and each.sub}
    assert missed == set(range(1, SERVOS + 1))
    acknowledged = [servo.application.dictionary.entry(0x10F3, 3).read() for servo in servos]
    assert acknowledged == [USINT.encode(0)] * SERVOS
