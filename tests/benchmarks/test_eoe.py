"""The rate of a web page through EoE: bound and texts. The runs need interfaces."""

from __future__ import annotations

import pytest

from benchmarks.eoe import Run, bound


def test_the_bound_is_two_cycles_per_frame() -> None:
    assert bound() == pytest.approx(730)


def test_a_run_has_a_rate() -> None:
    run = Run("with", 2.0, 2000, 0, 1, 400_000)
    assert run.kilobytes_per_second == pytest.approx(200)
    assert "0 lost, 1 late" in str(run)
