"""The report as text and as JSON."""

from __future__ import annotations

import json
from dataclasses import replace

from catenary.doctor.examination import examine
from catenary.doctor.report import as_json, as_text, wrap
from tests.doctor import machines
from tests.doctor.test_latency import latency


def test_each_check_has_a_line_and_advice(tmp_path):
    lines = as_text(examine(machines.laptop(tmp_path))).splitlines()
    assert lines[:2] == [
        "Kernel",
        "  FAIL  kernel-preemption     preemption model: voluntary (6.8.0-45-generic)",
    ]
    assert lines[2].strip().startswith("> sudo pro enable realtime-kernel")


def test_the_summary_comes_last(tmp_path):
    bad = as_text(examine(machines.laptop(tmp_path / "a"))).splitlines()
    assert bad[-5] == "30 checks: 8 passed, 16 warnings, 4 failed, 2 unknown"
    assert bad[-4].startswith(
        "This machine is not ready for a real-time loop. Fix first: kernel-preem"
    )
    assert bad[-2] == "--apply can change 12 settings; the changes last until the next reboot."
    watched = replace(machines.controller(tmp_path / "b"), watched=3.0, sent=0)
    good = as_text(examine(watched, latency(30e-6))).splitlines()
    assert good[-3] == "30 checks: 30 passed, 0 warnings, 0 failed, 0 unknown"
    assert good[-2] == "This machine is ready for a real-time loop: no check failed or warned."
    unmeasured = as_text(examine(machines.controller(tmp_path / "c"))).splitlines()
    assert unmeasured[-2].endswith("the wake-up latency was not measured.")


def test_a_narrow_terminal(tmp_path):
    words = as_text(examine(machines.laptop(tmp_path)), width=80)
    long = [line.strip(" >") for line in words.splitlines() if len(line) > 80]
    assert long
    assert all(line.startswith(("sudo ", "echo ", "`")) for line in long)


def test_commands_are_not_wrapped():
    command = "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
    assert wrap(f"either {command}; or another machine", 40) == [
        "either",
        f"{command};",
        "or another machine",
    ]


def test_colour_only_on_request(tmp_path):
    examination = examine(machines.laptop(tmp_path))
    assert "\033[" not in as_text(examination)
    assert "\033[31mFAIL\033[0m" in as_text(examination, colour=True)


def test_the_histogram(tmp_path):
    text = as_text(examine(machines.controller(tmp_path), latency(0.3)))
    rows = [line.split() for line in text.splitlines() if line.endswith("#")]
    assert rows == [
        ["2", "to", "5", "us", "2999", "#" * 40],
        ["more", "than", "50000", "us", "1", "#"],
    ]


def test_the_json_has_the_documented_keys(tmp_path):
    examination = examine(machines.controller(tmp_path), latency(30e-6))
    report = json.loads(as_json(examination))
    assert set(report) == {"checks", "latency_us"}
    assert all(list(check) == ["id", "status", "found", "advice"] for check in report["checks"])
    assert [check["id"] for check in report["checks"]] == [check.id for check in examination.checks]
    assert report["latency_us"]["p50"] == 4.0
    assert report["latency_us"]["max"] == 30.0
    assert report["latency_us"]["histogram"] == [[2.0, 4.0, 2999], [30.0, 30.0, 1]]
    assert json.loads(as_json(examine(machines.controller(tmp_path))))["latency_us"] == {}


def test_ids_are_the_headings_of_the_manual(tmp_path):
    from tests.conftest import ROOT

    manual = (ROOT / "docs" / "how_to" / "doctor.md").read_text()
    ids = {check.id for check in examine(machines.controller(tmp_path / "a")).checks}
    ids |= {check.id for check in examine(machines.make(tmp_path / "b", {})).checks}
    with_ptp = machines.make(tmp_path / "c", {"/proc/9/comm": "ptp4l"})
    ids |= {check.id for check in examine(with_ptp).checks}
    headings = {
        line.removeprefix("### ") for line in manual.splitlines() if line.startswith("### ")
    }
    assert headings == ids
