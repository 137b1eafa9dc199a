"""`eoe` on a virtual segment: text, JSON, exit status and errors."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from catenary.cli.main import main
from catenary.link.tap import Tap

CELL = """
[[device]]
kind = "coupler"

[[device]]
kind = "servo"
mailbox_bytes = 512
ethernet = { gateway = "192.168.7.1" }
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "cell.toml").write_text(CELL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_addresses_as_text(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("eoe address virtual:cell.toml 1", capsys)
    assert status == 0
    assert out.splitlines()[1:] == [
        "  IP:      192.168.7.2",
        "  mask:    255.255.255.0",
        "  gateway: 192.168.7.1",
        "  DNS:     not reported",
        "  MAC:     02:00:00:00:07:02",
        "  name:    virtual",
    ]


def test_addresses_are_set(capsys: pytest.CaptureFixture[str]) -> None:
    line = "eoe address virtual:cell.toml 1 --ip 10.0.0.2/8 --name arm --json"
    status, out, _ = call(line, capsys)
    assert status == 0
    assert json.loads(out) == {
        "ip": "10.0.0.2",
        "mask": "255.0.0.0",
        "gateway": "192.168.7.1",
        "dns": None,
        "mac": "02:00:00:00:07:02",
        "name": "arm",
    }


@pytest.mark.parametrize(
    ("line", "status", "message"),
    [
        ("eoe address virtual:cell.toml 1 --ip 10.0.0", 2, "10.0.0"),
        ("eoe address virtual:cell.toml 1 --mac 1:2", 2, "is not the MAC address"),
        ("eoe address virtual:cell.toml 0", 1, "has no mailbox"),
        ("eoe address virtual:cell.toml 5", 2, "there is no device 5"),
        ("eoe address share:arm 1", 2, "a share offers no Ethernet ports"),
        ("eoe up share:arm --tap cat0", 2, "a share offers no Ethernet ports"),
        ("eoe up virtual:cell.toml --tap cat77", 1, "the interface cat77 does not exist"),
        ("eoe up virtual --tap cat77", 1, "no device of the last scan has EoE"),
    ],
)
def test_errors(line: str, status: int, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    found, _, err = call(line, capsys)
    assert found == status
    assert message in err


def test_up_connects_for_a_time(tap: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(f"eoe up virtual:cell.toml 1 --tap {tap} --seconds 0.2", capsys)
    assert status == 0
    assert out.startswith(f"{tap} - device 1 ")
    status, out, _ = call(f"eoe up virtual:cell.toml --tap {tap} --seconds 0.2 --json", capsys)
    assert status == 0
    [device] = json.loads(out)["devices"]
    assert device["position"] == 1
    assert set(device) == {
        *("position", "frames_to_device", "bytes_to_device"),
        *("frames_from_device", "bytes_from_device", "dropped"),
    }


def test_up_ends_with_an_interrupt(
    tap: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("threading.Event.wait", interrupted)
    monkeypatch.setattr("catenary.cli.eoe._print_connections", lambda *_: None)
    monkeypatch.setattr("catenary.bus.segment_eoe.EthernetBridge", _Idle)
    assert call(f"eoe up virtual:cell.toml 1 --tap {tap}", capsys)[0] == 0


class _Idle:
    """Bridge without threads, which would also be interrupted."""

    is_open, counts, positions = False, {}, ()

    def __init__(self, main: object, subs: object, interface: Tap, **_: object) -> None:
        interface.close()

    def close(self) -> None:
        pass

    def __enter__(self) -> _Idle:
        return self

    def __exit__(self, *_: object) -> None:
        pass
