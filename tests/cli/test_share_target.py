"""Commands with the target share:NAME, next to a running loop."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from catenary.cli.main import main
from tests.remote.programs import Running, program

SERVO = "1"


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    with program() as found:
        yield found


@pytest.fixture
def target(running: Running) -> str:
    return f"share:{running.name}"


Capture = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    "line",
    [
        "scan TARGET",
        "state TARGET",
        "messages TARGET",
        "sdo read TARGET POSITION 0x1018:1",
        "sdo list TARGET POSITION --values",
        "reg read TARGET POSITION AL_STATUS",
    ],
)
def test_json_has_the_same_keys_as_for_a_segment(line: str, target: str, capsys: Capture) -> None:
    found = []
    for name, position in ((target, "1"), ("virtual", "2")):
        call = line.replace("TARGET", name).replace("POSITION", position)
        assert main([*call.split(), "--json"]) == 0
        value = json.loads(capsys.readouterr().out)
        found.append(list(value[-1] if isinstance(value, list) else value))
    assert found[0] == found[1]


def test_scan_lists_the_devices(target: str, capsys: Capture) -> None:
    assert main(["scan", target]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4
    assert lines[1].endswith("OP")


def test_scan_as_json(target: str, capsys: Capture) -> None:
    assert main(["scan", target, "--json"]) == 0
    assert [each["position"] for each in json.loads(capsys.readouterr().out)] == [0, 1, 2]


def test_state_shows_one_device(target: str, capsys: Capture) -> None:
    assert main(["state", target, "--position", SERVO, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["position"], found["state"], found["error"]) == (1, "OP", False)


def test_a_state_needs_a_position(target: str, capsys: Capture) -> None:
    assert main(["state", target, "PREOP"]) == 2
    assert "--position" in capsys.readouterr().err


def test_a_state_of_an_enabled_axis_is_refused(target: str, capsys: Capture) -> None:
    assert main(["state", target, "PREOP", "--position", SERVO, "--force"]) == 1
    assert "enabled" in capsys.readouterr().err


def test_an_object_is_read_with_the_type_of_the_device(target: str, capsys: Capture) -> None:
    assert main(["sdo", "read", target, SERVO, "0x1018:1"]) == 0
    assert int(capsys.readouterr().out) > 0


def test_an_object_is_written_and_read(target: str, capsys: Capture) -> None:
    assert main(["sdo", "write", target, SERVO, "0x6065", "1234"]) == 0
    assert main(["sdo", "read", target, SERVO, "0x6065", "--type", "UDINT", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["data"], found["value"]) == ("d2040000", 1234)


def test_the_objects_are_listed_with_values(target: str, capsys: Capture) -> None:
    assert main(["sdo", "list", target, SERVO, "--json", "--values"]) == 0
    rows = {(each["index"], each["subindex"]): each for each in json.loads(capsys.readouterr().out)}
    assert rows[0x1000, 0]["value"] & 0xFFFF == 402
    assert len(rows) > 100


def test_a_register_is_read(target: str, capsys: Capture) -> None:
    assert main(["reg", "read", target, SERVO, "AL_STATUS"]) == 0
    assert "OP" in capsys.readouterr().out


def test_diag_finds_no_fault(target: str, capsys: Capture) -> None:
    assert main(["diag", target, "--clear"]) == 0
    assert "no faults" in capsys.readouterr().out
    assert main(["diag", target, "--seconds", "1"]) == 2


@pytest.mark.parametrize("command", [["graph"], ["reg", "write"], ["init"]])
def test_other_commands_refuse_a_share(target: str, capsys: Capture, command: list[str]) -> None:
    rest = ["1", "0x0310", "0", "--size", "1"] if command[0] == "reg" else []
    assert main([*command, target, *rest]) == 1
    assert "running program" in capsys.readouterr().err


def test_a_share_that_does_not_exist(capsys: Capture) -> None:
    assert main(["scan", "share:no-such-share"]) == 1
    assert "no program serves" in capsys.readouterr().err
