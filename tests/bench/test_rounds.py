"""Failed rounds are repeated and reported, up to a limit."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from catenary.bench import rounds
from catenary.bench.job import Body, Job
from catenary.bench.rounds import MOST_FAILED, RoundError, interleave, run_with_retries
from tests.bench.test_statistics import make_round


def outcomes(failures: int) -> Iterator[bool]:
    yield from [False] * failures
    while True:
        yield True


def once(good: Iterator[bool]) -> str:
    if not next(good):
        raise RoundError("the machine stopped")
    return "done"


def test_a_failed_round_is_repeated_and_reported() -> None:
    failed: list[str] = []
    good = outcomes(2)
    assert run_with_retries(lambda: once(good), failed) == "done"
    assert failed == ["the machine stopped"] * 2


def test_the_number_of_repetitions_is_limited() -> None:
    failed: list[str] = []
    good = outcomes(1000)
    with pytest.raises(RoundError, match="the machine stopped"):
        run_with_retries(lambda: once(good), failed)
    assert len(failed) == MOST_FAILED


def test_each_round_starts_with_another_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []

    def run_round(job: Job, _folder: object) -> object:
        ran.append(job.peer)
        return make_round(1, 1, 1)

    monkeypatch.setattr(rounds, "run_round", run_round)
    jobs = [
        Job(
            peer=name,
            module="",
            interface="",
            drives=(1,),
            body=Body.SINE,
            period_ns=1,
            warm_up=0,
            cycles=1,
            cpu=None,
            priority=None,
            counts_per_turn=1,
            rated_torque=1,
        )
        for name in "abc"
    ]
    found = interleave(jobs, 3, lambda *_: None)
    assert "".join(ran) == "abcbcacab"
    assert {name: len(each) for name, each in found.items()} == {"a": 3, "b": 3, "c": 3}
