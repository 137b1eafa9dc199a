"""Words in shared memory: addresses and bounds.

No test on x86 can show the memory ordering. tests/share/test_lease.py tests the protocol on top.
"""

from __future__ import annotations

import pytest

from catenary.share._atomic_words import Words


def test_words_are_at_their_offsets() -> None:
    memory = bytearray(8 + 2 * 24 + 8)
    words = Words(memory, 8, 3, 24)
    for k in range(3):
        words.store(k, 2**63 + k)
    assert words.load_all() == [2**63, 2**63 + 1, 2**63 + 2]
    assert words.load(2) == int.from_bytes(memory[-8:], "little")
    assert sum(memory[:8]) == 0


@pytest.mark.parametrize("k", [3, 2**63])
def test_word_out_of_range_raises_index_error(k: int) -> None:
    words = Words(bytearray(24), 0, 3)
    with pytest.raises(IndexError, match=f"word {k}"):
        words.load(k)
    with pytest.raises(IndexError, match=f"word {k}"):
        words.store(k, 0)


@pytest.mark.parametrize(
    "place",
    [(0, 4, 8), (8, 3, 8), (4, 1, 8), (0, 2, 12), (0, 2, 24), (0, 0, 8), (0, 1, 0), (32, 1, 8)],
)
def test_words_outside_of_the_memory_are_refused(place: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="words"):
        Words(bytearray(24), *place)
