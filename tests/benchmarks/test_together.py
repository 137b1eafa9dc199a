"""The soak of everything: it runs, judges growth, and its parts fail for their reasons."""

from __future__ import annotations

import os
from importlib.util import find_spec

import pytest

from benchmarks.cli.main import main
from benchmarks.together import ping, run
from benchmarks.together.activities import Done
from benchmarks.together.resources import Resources, Sample, growth, sample
from benchmarks.together.run import Soaked


def samples(memory: list[int], descriptors: int = 10, threads: int = 3) -> list[Sample]:
    return [Sample(k, kilobytes, descriptors, threads, k) for k, kilobytes in enumerate(memory)]


def test_growth_after_the_warm_up_is_found() -> None:
    flat = [50_000] * 10 + [80_000, 80_500] * 20
    assert growth(samples(flat)) == []
    assert growth(samples([*flat, 200_000])) == []  # one peak
    grown = [80_000 + 500 * k for k in range(50)]
    assert growth(samples(grown)) == ["memory_kb grew from 90250 to 102750"]
    hung = [Sample(k, 1000, 10, 3, 7) for k in range(50)]
    assert growth(hung) == ["no processor time in the last quarter"]
    leaking = [Sample(k, 1000, 10 + k // 5, 3, k) for k in range(50)]
    assert growth(leaking) == ["descriptors grew from 14 to 19"]
    assert growth(samples([1] * 5)) == ["only 5 samples: run for longer"]


def test_this_process_is_sampled_and_a_missing_one_is_reported() -> None:
    found = sample(os.getpid(), 1.0)
    assert found is not None
    assert found.memory_kb > 1000
    assert found.descriptors > 2
    resources = Resources()
    resources.watch("gone", 2**22 + 1)  # above the largest process id
    resources.take(3.0)
    resources.take(4.0)
    assert resources.judge()[0] == "gone ended after 3 s"


def test_pings_are_answered_only_with_their_data() -> None:
    request = ping.ping(7)
    answer = bytearray(ping.MAC + ping.MAC + request[12:])
    answer[ping.HEADER] = ping.ECHO_ANSWER
    assert ping.answered(bytes(answer)) == 7
    answer[-1] ^= 1
    assert ping.answered(bytes(answer)) is None
    assert ping.answered(request) is None


def test_idle_parts_and_failures_are_violations() -> None:
    soaked = Soaked()
    soaked.done.add("cycles", 10)
    soaked.done.fail("files", ValueError("two\nlines"))
    idle = ["objects: none", "file bytes: none", "pings: none", "recordings: none"]
    assert soaked.violations(wire=False) == [*idle, "files: two lines"]
    assert soaked.violations(wire=True) == idle
    soaked.done.add("StateLost events", 2)
    soaked.done.add("clock checks", 10)
    disturbed = ["2 StateLost events", "clocks locked in 0 checks only"]
    assert soaked.violations(wire=False) == [*idle, *disturbed, "files: two lines"]
    assert soaked.violations(wire=True) == idle


def test_failures_are_bounded() -> None:
    done = Done()
    for number in range(100):
        done.fail("objects", number)
    assert done.counts["objects failed"] == 100
    assert len(done.failures) == 5


def test_everything_runs_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short run has too few samples for a judgement, but all parts do something."""
    monkeypatch.setattr(run, "SAMPLE", 0.2)
    monkeypatch.setattr("benchmarks.together.activities.CUT_EVERY", 2.0)
    soaked = run.soak(3.0, wire=False, seed=1)
    counts = soaked.done.counts
    assert (soaked.error, soaked.done.failures, soaked.resources.ended) == ("", [], [])
    assert counts["cycles"] >= 3000
    for name in ("objects", "file bytes", "pings", "cuts", "clock checks locked"):
        assert counts[name], name
    assert counts["not ok"] <= counts["cuts"] * 5
    assert {"loop", "recorder"} <= set(soaked.resources.samples)
    assert ("ROS 2" in soaked.resources.samples) == (find_spec("cyclonedds") is not None)


def test_the_wire_needs_everything(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["soak", "--wire"]) == 2
    assert "--wire needs --everything" in capsys.readouterr().err
