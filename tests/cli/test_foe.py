"""`foe` and `firmware` on a virtual segment: text, JSON, exit status and errors."""

from __future__ import annotations

import io
import json
import shlex
from pathlib import Path

import pytest

from catenary.cli.main import main
from catenary.cli.progress import TransferProgress, transfer_text
from catenary.virtual import make_firmware

PRODUCT = 0x0004_0002
CELL = """
[[device]]
kind = "coupler"

[[device]]
kind = "analog_inputs"

[device.files]
contents = { "log.txt" = "started", "boot.log" = "boot" }
password = 0x1234
bootstrap_only = ["boot.log"]
size_limit = 50000
firmware = { name = "app.efw", version = "1.2" }
"""
PASSWORD = "--password 0x1234"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "app.efw").write_bytes(make_firmware(PRODUCT, "2.0", revision=9, size=10_000))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_read_writes_a_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(f"foe read virtual:cell.toml 1 log.txt {PASSWORD}", capsys)
    assert (status, (folder / "log.txt").read_bytes()) == (0, b"started")
    assert out.endswith("7 bytes read: log.txt\n")


def test_read_to_stdout(folder: Path, capsysbinary: pytest.CaptureFixture[bytes]) -> None:
    assert main(shlex.split(f"foe read virtual:cell.toml 1 - --name log.txt {PASSWORD}")) == 0
    assert capsysbinary.readouterr().out == b"started"


def test_read_in_boot(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = f"foe read virtual:cell.toml 1 boot.log {PASSWORD}"
    status, _, err = call(line, capsys)
    assert (status, "access only in the state BOOT" in err) == (1, True)
    assert call(f"{line} --boot --json", capsys)[:2] == (
        0,
        '{"position": 1, "name": "boot.log", "size": 4}\n',
    )
    assert (folder / "boot.log").read_bytes() == b"boot"


def test_write_to_a_device_that_restarts_after_boot(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = CELL.replace('version = "1.2"', 'version = "1.2", restart = "power"')
    (folder / "cell.toml").write_text(cell)
    status, out, err = call(f"foe write virtual:cell.toml 1 app.efw {PASSWORD} --boot", capsys)
    assert (status, "10000 bytes written" in out, "catenary:" in err) == (0, True, False)


def test_write(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(
        f"foe write virtual:cell.toml 1 cell.toml --name PARAM {PASSWORD}", capsys
    )
    assert (status, out) == (
        0,
        f"device 1 (Catenary virtual 2-channel analogue input): {len(CELL)} bytes written: PARAM\n",
    )


def test_write_from_stdin(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"abc")))
    status, out, _ = call(f"foe write virtual:cell.toml 1 - --name PARAM {PASSWORD}", capsys)
    assert (status, out.endswith("3 bytes written: PARAM\n")) == (0, True)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"abc")))
    monkeypatch.setattr("catenary.procedure.foe.MAX_SIZE", 2)
    status, _, err = call(f"foe write virtual:cell.toml 1 - --name PARAM {PASSWORD}", capsys)
    assert (status, "stdin exceeds 2 bytes" in err) == (2, True)


@pytest.mark.parametrize(
    ("line", "status", "message"),
    [
        ("foe read virtual:cell.toml 1 log.txt", 1, "wrong password"),
        (f"foe read virtual:cell.toml 1 x {PASSWORD}", 1, "file not found"),
        (f"foe read virtual:cell.toml 1 log.txt {PASSWORD} --max-size 3", 1, "larger than 3 bytes"),
        ("foe read virtual:cell.toml 0 log.txt", 1, "has no mailbox"),
        (f"foe read virtual:cell.toml 1 missing/log.txt {PASSWORD}", 2, "missing does not exist"),
        ("foe read virtual:cell.toml 1 missing/log.txt", 2, "missing does not exist"),
        ("foe read virtual:cell.toml 1 . --name log.txt", 2, "a file is needed"),
        ("foe write virtual:cell.toml 1 -", 2, "add --name NAME"),
        ("firmware virtual:cell.toml 1 empty.efw --name app.efw", 2, "empty.efw is empty"),
        ("foe write virtual:cell.toml 1 app.efw --password 0x1234", 1, "--boot"),
        ("foe write virtual:cell.toml 1 missing", 1, "No such file"),
        ("foe read virtual:cell.toml 5 log.txt", 2, "there is no device 5"),
        ("foe read virtual:cell.toml 1 -", 2, "add --name NAME"),
        ("foe read share:arm 1 log.txt", 2, "a share offers no files"),
        ("firmware share:arm 1 app.efw", 2, "a share offers no files"),
        ("firmware virtual:cell.toml 9 app.efw", 2, "there is no device 9"),
        ("firmware virtual:cell.toml 1 missing", 1, "No such file"),
    ],
)
def test_errors(
    folder: Path, line: str, status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "empty.efw").write_bytes(b"")
    found, _, err = call(line, capsys)
    assert (found, message in err) == (status, True), err
    assert not (folder / "log.txt").exists()


@pytest.mark.parametrize("option", ["--password 0x100000000", "--password x", "--timeout 0"])
def test_options_out_of_range(folder: Path, option: str) -> None:
    with pytest.raises(SystemExit) as caught:
        main(shlex.split(f"foe read virtual:cell.toml 1 log.txt {option}"))
    assert caught.value.code == 2


def test_firmware_prints_both_versions(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call(
        f"firmware virtual:cell.toml 1 app.efw {PASSWORD} --expect-version 2.0 --product {PRODUCT}",
        capsys,
    )
    lines = [line.split(maxsplit=1) for line in out.splitlines()[1:]]
    assert (status, [label for label, _ in lines]) == (0, ["before:", "written:", "now:"])
    assert "version 1.2" in lines[0][1]
    assert "10000 bytes" in lines[1][1]
    assert lines[2][1] == "version 2.0, revision 0x00000009"
    assert "catenary:" not in err


def test_firmware_as_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(f"firmware virtual:cell.toml 1 app.efw {PASSWORD} --json", capsys)
    found = json.loads(out)
    assert status == 0
    assert (found["before"]["version"], found["now"]["version"]) == ("1.2", "2.0")
    assert (found["state"], found["step"], found["error"]) == ("PRE-OP", "verification", None)
    assert found["size"] == 10_000
    assert found["seconds"] > 0


def test_a_failure_names_the_state_and_the_next_step(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "app.efw").write_bytes(make_firmware(PRODUCT, "2.0", size=60_000))
    status, _, err = call(f"firmware virtual:cell.toml 1 app.efw {PASSWORD}", capsys)
    assert status == 1
    assert "catenary: write failed: device 1" in err
    assert "0x8003: disk full" in err
    assert "state: it reached INIT" in err
    assert "next:  only its boot loader runs: repeat the update with a valid file" in err


def test_a_wrong_product_stops_before_the_write(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"firmware virtual:cell.toml 1 app.efw {PASSWORD} --product 5 --json"
    status, out, _ = call(line, capsys)
    found = json.loads(out)
    assert (status, found["step"], found["state"]) == (1, "identity check", "PRE-OP")
    assert found["now"] == found["before"]
    assert "Nothing was written" in found["error"]


@pytest.mark.parametrize(
    ("done", "total", "seconds", "text"),
    [
        (0, 4096, 0.0, "0.0 of 4.0 KiB, 0 %"),
        (1024, 4096, 0.5, "1.0 of 4.0 KiB, 25 %, 2.0 KiB/s, 2 s left"),
        (4096, 4096, 2.0, "4.0 of 4.0 KiB, 100 %, 2.0 KiB/s, 0 s left"),
        (0, 0, 0.0, "0.0 of 0.0 KiB, 100 %"),
        (2048, None, 2.0, "2.0 KiB, 1.0 KiB/s"),
    ],
)
def test_progress_has_the_rate_and_the_remaining_time(
    done: int, total: int | None, seconds: float, text: str
) -> None:
    assert transfer_text(done, total, seconds) == text


def test_progress_in_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    times = iter([10.0, 12.0, 14.0])
    with TransferProgress("writing", lambda: next(times)) as progress:
        progress.report(0, 2048)
        progress.report(1024, 2048)
        progress.report(1024, 2048, "30/100 erase")
        progress.show("restart")
    lines = capsys.readouterr().err.split("\r\x1b[K")[1:]
    assert lines == [
        "writing: 0.0 of 2.0 KiB, 0 %",
        "writing: 1.0 of 2.0 KiB, 50 %, 0.5 KiB/s, 2 s left",
        "writing: 1.0 of 2.0 KiB, 50 %, 0.2 KiB/s, 4 s left, busy 30/100 erase",
        "restart ...",
        "",
    ]
