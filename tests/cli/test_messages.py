"""`catenary messages`, on a segment and next to a running loop."""

from __future__ import annotations

import json

import pytest

import catenary as cat
from catenary.cli.main import main
from catenary.virtual import Coupler, HistoryOptions, Segment, Servo
from tests.remote.programs import program

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
        assert (title, other) == ("1 left: 1 messages", "2 right: no diagnosis history")
        assert message.startswith("  info: code 0x0000E000, text 0x0003, parameters 7")
        assert main(["messages", target, "9"]) == 2
        assert main(["messages", target, "1", "--clear"]) == 2
    assert "only read" in capsys.readouterr().err
