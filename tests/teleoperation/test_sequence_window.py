from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.teleoperation.refusal import Refusal
from catenary.teleoperation.sequence_window import WIDTH, SequenceWindow


@given(st.lists(st.integers(1, 200), max_size=100))
def test_against_a_set_of_all_numbers(numbers: list[int]) -> None:
    window, received, newest = SequenceWindow(), set(), 0
    for number in numbers:
        if number > newest:
            expected, newest = None, number
        elif number in received or number <= newest - WIDTH:
            expected = Refusal.REPLAYED
        else:
            expected = Refusal.LATE
        received.add(number)
        assert window.accept(number) is expected


def test_numbers_up_to_64_bits() -> None:
    window = SequenceWindow()
    assert window.accept(2**64 - 1) is None
    assert window.accept(2**64 - 1) is Refusal.REPLAYED
    assert window.accept(0) is Refusal.REPLAYED
