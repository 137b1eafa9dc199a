"""The rate of file transfers: bound and ratios. The transfers need interfaces: test_peers.py."""

from __future__ import annotations

import pytest

from benchmarks.foe import WAYS, Transfer, accepted, bound, checked, content, ratios
from catenary.errors import CatenaryError


def test_the_bound_is_two_cycles_per_packet() -> None:
    assert bound(1012 * 10) == pytest.approx(11 * 2e-3)  # the last packet is empty
    assert bound(1) == pytest.approx(2e-3)


def test_ratios_are_rates() -> None:
    seconds = dict(zip(WAYS, (1.0, 2.0, 1.0, 0.5, 4.0, 8.0), strict=True))
    size = 1012 * 1000 - 1
    medians = {name: Transfer(name, size, each) for name, each in seconds.items()}
    assert ratios(medians) == {
        "idle read: rate / PySOEM": 2.0,
        "read next to a loop: rate / bound": 0.5,
        "idle write: rate / PySOEM": 0.5,
        "write next to a loop: rate / bound": 0.25,
    }
    assert "512 kB/s" in str(Transfer("catenary-read", 1024 * 512, 1.024))


def test_a_wrong_file_is_refused() -> None:
    checked(content(1000), content(1000))
    with pytest.raises(CatenaryError, match="differ"):
        checked(content(1000), content(999))


def test_an_error_code_of_pysoem_is_refused() -> None:
    accepted(1)
    with pytest.raises(CatenaryError, match="-7"):
        accepted(-7)
