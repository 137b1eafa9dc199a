"""`catenary report` on virtual segments, and archives that are not reports."""

from __future__ import annotations

import json
import shlex
import zipfile
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

import catenary as cat
from catenary.cli import report_archive, report_parts
from catenary.cli.main import main
from catenary.cli.report_privacy import Redactor
from catenary.cli.report_segment import Job
from catenary.errors import ConfigurationError, LinkError
from catenary.line import read_line
from catenary.operate import devices
from catenary.wire.capture import decode_capture

SHORT = "--seconds 0.05"


@pytest.fixture
def target(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace `virtual` by a segment with a digital output, a servo and a second servo."""
    parts = [cat.virtual.DigitalOutputs(), cat.virtual.Servo(serial=4711), cat.virtual.Servo()]
    replace_target(monkeypatch, cat.Segment(parts))


def replace_target(monkeypatch: pytest.MonkeyPatch, segment: cat.Segment) -> None:
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def parts_of(manifest: dict[str, list[dict[str, str]]]) -> dict[str, str]:
    return {part["name"]: part["status"] for part in manifest["parts"]}


@pytest.mark.usefixtures("target")
def test_the_archive_has_all_parts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "r.zip"
    status, out, _ = call(f"report virtual {SHORT} -o {path} --json", capsys)
    manifest = json.loads(out)
    assert status == 0
    assert parts_of(manifest) == dict.fromkeys(
        ("doctor", "scan", "clone", "timing", "capture"), "done"
    )
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "r")
        assert json.loads(archive.read("manifest.json")) == manifest
        sizes = {each.filename: each.file_size for each in archive.infolist()}
    assert manifest["files"] == {name: sizes[name] for name in sizes if name != "manifest.json"}
    line = read_line(tmp_path / "r" / "clone")
    assert line.complete
    assert (line.serials, line.devices[1].identity.serial) == (False, 0)
    scan = json.loads((tmp_path / "r" / "scan.json").read_text())
    assert [device["serial"] for device in scan["devices"]] == [None] * 3
    timing = json.loads((tmp_path / "r" / "timing.json").read_text())
    assert timing["counters"]["cycles"] >= 50
    assert decode_capture((tmp_path / "r" / "capture.pcapng").read_bytes()).packets


def test_no_axis_is_enabled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drives: list[cat.Drives] = []
    enabled: list[bool] = []

    def make(*arguments: object) -> cat.Drives:
        drives.append(make_drives(*arguments))
        return drives[-1]

    def watched(loop: cat.Loop) -> Iterator[cat.Cycle]:
        for cycle in iterate(loop):
            enabled.extend(drive.enabled.any() for drive in drives)
            yield cycle

    make_drives, iterate = devices.make_drives, cat.Loop.__iter__
    monkeypatch.setattr(devices, "make_drives", make)
    monkeypatch.setattr(cat.Loop, "__iter__", watched)
    replace_target(monkeypatch, cat.Segment([cat.virtual.Servo()]))
    status, _, _ = call(f"report virtual {SHORT} --no-clone -o {tmp_path}/r.zip", capsys)
    assert status == 0
    assert len(enabled) >= 100  # cycles of the timing and of the capture
    assert not any(enabled)


def test_outputs_of_unknown_devices_need_consent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    other = cat.virtual.SafetyTerminal(size=4)
    replace_target(monkeypatch, cat.Segment([cat.virtual.Servo(), other]))
    line = f"report virtual {SHORT} --no-clone -o {tmp_path}/r.zip --json"
    status, out, _ = call(line, capsys)
    manifest = json.loads(out)
    assert status == 1
    assert parts_of(manifest) == {
        **{"doctor": "done", "scan": "done", "clone": "skipped"},
        **{"timing": "incomplete", "capture": "incomplete"},
    }
    assert "device 1 (Catenary virtual" in manifest["parts"][3]["reason"]
    status, out, _ = call(f"{line} --zero-outputs", capsys)
    assert (status, parts_of(json.loads(out))["timing"]) == (0, "done")


def test_no_file_contains_a_serial_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    serial = 0x5EC2E71A
    replace_target(monkeypatch, cat.Segment([cat.virtual.Servo(serial=serial)]))
    texts = [serial.to_bytes(4, "little"), str(serial).encode(), f"{serial:x}".encode()]
    for options, expected in (("", set()), ("--serials", {"scan.json", "capture.pcapng"})):
        line = f"report virtual {SHORT} -o {tmp_path}/r.zip {options}"
        status, _, err = call(line, capsys)
        assert status == 0
        assert "brought to OP with outputs of 0; no axis is enabled" in err
        with zipfile.ZipFile(tmp_path / "r.zip") as archive:
            contents = {name: archive.read(name).lower() for name in archive.namelist()}
        found = {name for name in contents if any(text in contents[name] for text in texts)}
        assert found >= expected
        assert bool(found) == bool(expected)


def test_a_part_that_fails_does_not_end_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: Job) -> str:
        raise LinkError("the cable of eve on build7 is cut", hint="look")

    monkeypatch.setitem(report_parts.PARTS, "scan", fail)
    names = Redactor({"eve": "<user>", "build7": "<host>"})
    monkeypatch.setattr(report_parts, "redactor_of_this_machine", lambda: names)
    line = f"report virtual {SHORT} --no-clone -o {tmp_path}/r.zip"
    status, out, _ = call(line, capsys)
    assert status == 1
    assert "scan     failed" in out
    assert "the cable of <user> on <host> is cut (hint: look)" in out
    assert "timing   done" in out


@pytest.mark.usefixtures("target")
def test_the_clone_has_a_deadline(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report_parts, "CLONE_SECONDS", 0.0)
    status, out, _ = call(f"report virtual {SHORT} -o {tmp_path}/r.zip", capsys)
    assert status == 1
    assert "clone    incomplete" in out
    assert "ended after 0 s at" in out
    assert "timing   done" in out


@pytest.mark.usefixtures("target")
def test_large_files_are_omitted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report_archive, "FILE_BYTES", 20_000)
    status, out, _ = call(f"report virtual {SHORT} --no-clone -o {tmp_path}/r.zip --json", capsys)
    manifest = json.loads(out)
    assert status == 0
    assert "capture.pcapng" in manifest["omitted"]
    assert "capture.pcapng" not in zipfile.ZipFile(tmp_path / "r.zip").namelist()
    assert all(size <= 20_000 for size in manifest["files"].values())


def test_show_prints_the_summary(
    target: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, written, _ = call(f"report virtual {SHORT} --no-clone -o {tmp_path}/r.zip", capsys)
    status, shown, _ = call(f"report --show {tmp_path}/r.zip", capsys)
    assert status == 0
    assert written.startswith(shown.rstrip())
    assert "clone    skipped  0.0 s" in shown


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "not a zip file"),
        ({}, "contains no manifest.json"),
        ({"manifest.json": b"{"}, "manifest.json: "),
        ({"manifest.json": b'{"format": "x"}'}, "manifest.json: "),
        ({"manifest.json": b" " * (report_archive.MANIFEST_BYTES + 1)}, "more than 1048576 bytes"),
    ],
)
def test_show_refuses_other_files(
    content: dict[str, bytes] | None,
    reason: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "r.zip"
    path.write_bytes(b"text")
    if content is not None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in content.items():
                archive.writestr(name, data)
    status, out, err = call(f"report --show {path}", capsys)
    assert (status, out) == (1, "")
    assert reason in err


@pytest.mark.parametrize(
    "compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
)
def test_damaged_archives_are_refused(compression: int, tmp_path: Path) -> None:
    path, random = tmp_path / "r.zip", Random(1)
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("manifest.json", b'{"format": 1, "date": "2026"}')
    whole = path.read_bytes()
    for _ in range(500):
        damaged = bytearray(whole)
        damaged[random.randrange(len(whole))] = random.randrange(256)
        path.write_bytes(damaged)
        with pytest.raises(ConfigurationError, match=r"r\.zip"):
            report_archive.read_manifest(path)


@pytest.mark.parametrize("line", ["report", "report virtual --show x", "report x --seconds 121"])
def test_impossible_command_lines_are_refused(line: str) -> None:
    try:
        status = main(shlex.split(line))
    except SystemExit as end:
        status = end.code
    assert status == 2


def test_a_folder_without_permission_is_refused_before_the_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.access", lambda *_: False)
    status, out, err = call("report virtual", capsys)
    assert (status, out) == (2, "")
    assert "cannot be written: no permission\n  hint: --out FILE" in err


def test_private_names_are_replaced() -> None:
    redactor = Redactor({"eve": "<user>", "eve-laptop": "<host>", "/srv/eve": "<home>", "x": "?"})
    text = "eve never on eve-laptop: /home/mallory/a.toml, /srv/eve/b, x"
    assert redactor.text(text) == ("<user> never on <host>: /home/<user>/a.toml, <home>/b, x")
    assert redactor.value({"eve": ["eve", 1, None]}) == {"eve": ["<user>", 1, None]}


@pytest.mark.wire
def test_a_report_of_a_wire_names_the_card(
    veth: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No device answers: doctor is done, all other parts have the reason."""
    status, out, _ = call(f"report {veth[0]} {SHORT} -o {tmp_path}/r.zip --json", capsys)
    manifest = json.loads(out)
    assert status == 1
    assert [card["driver"] for card in manifest["machine"]["network_cards"]] == ["veth"]
    assert parts_of(manifest) == {"doctor": "done"} | dict.fromkeys(
        ("scan", "clone", "timing", "capture"), "failed"
    )
    _, shown, _ = call(f"report --show {tmp_path}/r.zip", capsys)
    assert f"network card: {veth[0]}, driver veth" in shown
