"""Deadlines."""

from catenary.procedure.exchange import Reply
from catenary.procedure.station import Deadline


def passed(deadline: Deadline, *times: float) -> list[bool]:
    """Return whether the deadline has passed at each of the times [s]."""
    return [deadline.passed(Reply(b"", 1, False, round(time * 1e9))) for time in times]


def test_a_deadline_counts_from_the_first_reply() -> None:
    assert passed(Deadline(1.0), 5.0, 5.2, 5.4, 5.6, 5.8, 6.0, 6.1) == [False] * 6 + [True]


def test_a_halted_program_polls_again_before_the_deadline() -> None:
    assert passed(Deadline(1.0), 0.0, 3.0, 3.1, 3.2, 3.3, 3.4) == [False] * 6
    assert passed(Deadline(1.0), 0.0, 3.0, 6.0, 9.0, 12.0, 15.0) == [False] * 5 + [True]
