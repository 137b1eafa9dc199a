"""The call of a law is measured: every round, in nanoseconds."""

import pytest


@pytest.mark.parametrize("name", ["pd", "cascade"])
def test_every_round_is_told(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    from benchmarks import law_call

    monkeypatch.setattr(law_call, "CALLS", 100)
    monkeypatch.setattr(law_call, "ROUNDS", 3)
    times = law_call.call_times(12, getattr(law_call, name))
    assert len(times) == 3
    assert all(time > 0 for time in times)
