"""`catenary messages`, on a segment and next to a running loop."""

from __future__ import annotations

import json

import pytest

import catenary as cat
from catenary.bus.device_diagnosis import DeviceDiagnosis
from catenary.cli.main import main
from catenary.errors import MailboxError
from catenary.model.diagnosis_history import SyncCounters
from catenary.virtual import Coupler, HistoryOptions, Segment, Servo
from tests.remote.programs import program

NOTE = "note: times are virtual: they come from the segment's clock, not from this machine's\n"
Capture = pytest.CaptureFixture[str]


class Machine:
    """A segment with a servo that has a history, and one that has none."""

    def __init__(self) -> None:
        self.servo = Servo(name="left", diagnosis=HistoryOptions(messages=8))
        self.segment = Segment([Coupler(), self.servo, Servo(name="right")])
        with cat.MainDevice(self.segment) as main_device:
            main_device.scan()  # starts the segment


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine()
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: machine.segment)
    return machine


def test_a_segment_without_messages(machine: Machine, capsys: Capture) -> None:
    assert main(["messages", "virtual"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "1 left: 0 messages",
        "2 right: no diagnosis history",
    ]


def test_messages_and_their_acknowledgement(machine: Machine, capsys: Capture) -> None:
    machine.servo.store_diagnosis(3, [7], severity="warning")
    machine.servo.store_diagnosis(4, code=0x8611_E800)
    assert main(["messages", "virtual", "1", "--acknowledge"]) == 1
    title, first, second = capsys.readouterr().out.splitlines()
    assert title == "1 left: 2 messages"
    assert first.startswith("  warning: code 0x0000E000, text 0x0003, parameters 7 (code 0x0000E")
    assert second.startswith("  error: error 0x8611 (following error), text 0x0004 (code 0x8611")
    assert main(["messages", "virtual", "1", "--clear"]) == 0
    assert capsys.readouterr().out.count("(acknowledged)") == 2
    assert main(["messages", "virtual", "1"]) == 0
    assert capsys.readouterr().out == "1 left: 0 messages\n"


def test_messages_as_json(machine: Machine, capsys: Capture) -> None:
    machine.servo.store_diagnosis(3, [7])
    assert main(["messages", "virtual", "--json"]) == 1
    left, right = json.loads(capsys.readouterr().out)
    (message,) = left["messages"]
    assert (message["severity"], message["text_id"], message["parameters"]) == ("error", 3, [7])
    assert message["age"] > 0
    assert (left["position"], right["messages"]) == (1, None)
    assert left["synchronisation"][0]["direction"] == "outputs"
    assert left["synchronisation"][0]["missed"] == 0


def test_a_missing_device(machine: Machine, capsys: Capture) -> None:
    assert main(["messages", "virtual", "7"]) == 2
    assert "there is no device 7" in capsys.readouterr().err


def test_a_device_that_fails_does_not_hide_the_messages_of_others(
    machine: Machine, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.servo.store_diagnosis(4, severity="info")
    synchronisation = DeviceDiagnosis.synchronisation

    def fail(self: DeviceDiagnosis) -> tuple[SyncCounters, ...]:
        found = synchronisation(self)
        if self._sub.station.position == 2:
            raise MailboxError("device 2 (right): no answer", hint="power-cycle it")
        return found

    monkeypatch.setattr(DeviceDiagnosis, "synchronisation", fail)
    assert main(["messages", "virtual"]) == 1
    out, err = capsys.readouterr()
    assert out.startswith("1 left: 1 message\n  info: ")
    assert out.endswith("2 right: failed\n")
    assert err == "error: device 2 (right): no answer\n  hint: power-cycle it\n" + NOTE
    assert main(["messages", "virtual", "--json"]) == 1
    left, right = json.loads(capsys.readouterr().out)
    assert left["error"] is None
    assert right["error"].startswith("device 2 (right): no answer")


def test_a_device_without_objects_is_shown_if_it_is_chosen(
    machine: Machine, capsys: Capture
) -> None:
    assert main(["messages", "virtual", "0"]) == 0
    assert capsys.readouterr().out.endswith("coupler: no diagnosis history\n")


def test_acknowledge_and_clear_exclude_each_other(capsys: Capture) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["messages", "virtual", "--acknowledge", "--clear"])
    assert caught.value.code == 2


def test_messages_of_a_running_loop(capsys: Capture) -> None:
    servo = Servo(name="left", diagnosis=HistoryOptions(messages=8))
    with program(segment=Segment([Coupler(), servo, Servo(name="right")])) as running:
        servo.store_diagnosis(3, [7], severity="info")
        target = f"share:{running.name}"
        assert main(["messages", target]) == 0
        title, message, other = capsys.readouterr().out.splitlines()
        assert (title, other) == ("1 left: 1 message", "2 right: no diagnosis history")
        assert message.startswith("  info: code 0x0000E000, text 0x0003, parameters 7")
        assert main(["messages", target, "0", "--json"]) == 0
        [coupler] = json.loads(capsys.readouterr().out)
        assert (coupler["position"], coupler["messages"]) == (0, None)
        assert main(["messages", target, "9"]) == 2
        assert main(["messages", target, "1", "--clear"]) == 2
    assert "only read" in capsys.readouterr().err
