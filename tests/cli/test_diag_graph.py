"""`diag` and `graph` on a virtual segment that several commands share."""

from __future__ import annotations

import json
import shlex

import pytest

import catenary as cat
from catenary.cli.main import main


@pytest.fixture
def segment(monkeypatch: pytest.MonkeyPatch) -> cat.Segment:
    segment = cat.Segment(
        [cat.virtual.Coupler(), cat.virtual.Servo(name="elbow"), cat.virtual.Servo(name="wrist")]
    )
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)
    return segment


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_no_fault_found(segment: cat.Segment, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call("diag eth9", capsys)
    assert (status, err) == (0, "")
    assert out.startswith("no fault found: 3 devices counted no error since")


def test_a_faulty_cable_is_named(segment: cat.Segment, capsys: pytest.CaptureFixture[str]) -> None:
    segment.core.poke(2, 0x0300, b"\x09\x02")
    status, out, _ = call("diag eth9", capsys)
    assert status == 1
    assert "the cable between device 1 (elbow) port 1 and device 2 (wrist) port 0: 9 broken" in out
    assert out.splitlines()[-1].split() == [
        "2",
        "0",
        "9",
        "2",
        "0",
        "0",
        *["device", "1", "(elbow)", "port", "1"],
    ]


def test_seconds_reports_only_new_errors(
    segment: cat.Segment, capsys: pytest.CaptureFixture[str]
) -> None:
    segment.core.poke(2, 0x0300, b"\x09\x02")
    status, out, _ = call("diag eth9 --seconds 0.2", capsys)
    assert status == 0
    assert "counted no error within 0.2 s (" in out


def test_clear_resets_the_counters(
    segment: cat.Segment, capsys: pytest.CaptureFixture[str]
) -> None:
    segment.core.poke(2, 0x0300, b"\x09\x02")
    assert call("diag eth9 --clear", capsys)[0] == 1
    assert call("diag eth9", capsys)[0] == 0


def test_diag_as_json(segment: cat.Segment, capsys: pytest.CaptureFixture[str]) -> None:
    segment.core.poke(2, 0x0300, b"\x09\x02")
    status, out, _ = call("diag eth9 --json", capsys)
    found = json.loads(out)
    assert status == 1
    assert [(each["kind"], each["devices"]) for each in found["findings"]] == [("cable", [1, 2])]
    assert found["devices"][2]["ports"][0] == {
        "invalid_frames": 9,
        "symbol_errors": 2,
        "forwarded": 0,
        "lost_links": 0,
    }


def test_diag_does_not_change_states(
    segment: cat.Segment, capsys: pytest.CaptureFixture[str]
) -> None:
    call("state eth9 SAFEOP", capsys)
    call("diag eth9", capsys)
    call("graph eth9", capsys)
    assert [segment.core.peek(n, 0x0130, 1)[0] for n in range(3)] == [4, 4, 4]


def test_graph_of_a_line(segment: cat.Segment, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("graph eth9", capsys)
    lines = out.splitlines()
    assert status == 0
    assert lines[1].startswith("0 Catenary virtual coupler  eth9")
    assert lines[3].startswith("2 wrist")
    assert "1 port 1" in lines[3]
    assert " ns " in lines[3]


def test_graph_for_graphviz(segment: cat.Segment, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("graph eth9 --dot", capsys)
    assert status == 0
    assert out.startswith("graph segment {")
    assert out.rstrip().endswith("}")


def test_graph_reports_contradicting_ports(
    segment: cat.Segment, capsys: pytest.CaptureFixture[str]
) -> None:
    status = segment.core.peek(2, 0x0110, 2)
    open_too = int.from_bytes(status, "little") & ~0x0C00 | 0x0800 | 0x0020
    segment.core.poke(2, 0x0110, open_too.to_bytes(2, "little"))
    found, out, _ = call("graph eth9", capsys)
    assert found == 1
    assert "! device 2 port 1 is open, but no device answers behind it" in out
    assert call("diag eth9", capsys)[0] == 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("diag nosuchnic", "there is no network interface 'nosuchnic'"),
        ("graph virtual:nosuchfile.toml", "nosuchfile.toml"),
    ],
)
def test_errors_name_the_cause(line: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call(line, capsys)
    assert (status, out) == (1, "")
    assert message in err
    assert "internal error" not in err


@pytest.mark.parametrize("words", ["diag", "diag eth9 --seconds soon", "diag eth9 --seconds 0"])
def test_a_usage_error_names_the_help(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words.split())
    assert stop.value.code == 2
    assert "catenary diag --help" in capsys.readouterr().err
