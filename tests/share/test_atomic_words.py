"""Words in shared memory. (That they are stored and loaded in order no test on x86 can show; what
the loop and its clients make of that order is tests/share/test_lease.py.)"""

from __future__ import annotations

import pytest

from catenary.share._atomic_words import Words


def test_words_lie_where_they_are_said_to() -> None:
    memory = bytearray(8 + 2 * 24 + 8)
    words = Words(memory, 8, 3, 24)
    for k in range(3):
        words.store(k, 2**63 + k)
    assert words.load_all() == [2**63, 2**63 + 1, 2**63 + 2]
    assert words.load(2) == int.from_bytes(memory[-8:], "little")
    assert sum(memory[:8]) == 0


@pytest.mark.parametrize("k", [3, 2**63])
def test_a_word_that_is_not_there(k: int) -> None:
    words = Words(bytearray(24), 0, 3)
    with pytest.raises(IndexError, match=f"word {k} of 3"):
        words.load(k)
    with pytest.raises(IndexError, match=f"word {k} of 3"):
        words.store(k, 0)


@pytest.mark.parametrize(
    "place",
    [(0, 4, 8), (8, 3, 8), (4, 1, 8), (0, 2, 12), (0, 2, 24), (0, 0, 8), (0, 1, 0), (32, 1, 8)],
)
def test_words_that_do_not_lie_in_the_memory(place: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="words at"):
        Words(bytearray(24), *place)
