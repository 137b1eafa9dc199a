"""Operating modes and presets: names, requests and their answers."""

from __future__ import annotations

import mmap
from collections.abc import Iterable

import pytest

from catenary.errors import RequestRefused
from catenary.share.choice import CHOICES_MAX, Choice, make_choices
from catenary.share.operation import Operation
from catenary.share.operator_request import REASON_MAX

MODES = ("damping", "stand", "balance")


def operation() -> Operation:
    return Operation(MODES, {"wave": "wave with the left arm"})


def test_choices_keep_their_order_and_descriptions() -> None:
    made = operation()
    assert [each.name for each in made.modes] == list(MODES)
    assert made.presets == (Choice("wave", "wave with the left arm"),)


@pytest.mark.parametrize(
    "names",
    [("",), (" a",), ("a\n",), ("a\x1b[2Jb",), ("é",), ("x" * 33,), ("a", "a"), {"a": "x\ny"}],
)
def test_invalid_names_are_refused(names: Iterable[str]) -> None:
    with pytest.raises(ValueError, match="mode"):
        make_choices("mode", names)  # type: ignore[arg-type]


def test_too_many_names_are_refused() -> None:
    with pytest.raises(ValueError, match="at most 32"):
        make_choices("preset", [f"p{n}" for n in range(CHOICES_MAX + 1)])


def test_a_single_text_is_not_a_list_of_names() -> None:
    with pytest.raises(TypeError, match=r"\('stand',\)"):
        make_choices("mode", "stand")
    with pytest.raises(TypeError, match="texts"):
        make_choices("mode", [7])  # type: ignore[list-item]


def test_nothing_is_taken_before_a_request() -> None:
    assert operation().take() == ()


def test_a_request_is_taken_once_and_its_first_answer_counts() -> None:
    made = operation()
    submitted = made.submit("mode", "balance", "process 1")
    (request,) = made.take()
    assert request is submitted
    assert (request.kind, request.name, request.client) == ("mode", "balance", "process 1")
    assert made.take() == ()
    assert request.accept()
    assert not request.refuse("too late")
    assert request.withdraw().accepted


def test_a_late_answer_is_reported_to_the_program() -> None:
    made = operation()
    request = made.submit("preset", "wave", "process 1")
    assert request.withdraw().withdrawn
    assert not request.accept()
    assert not request.refuse("no")
    assert made.take() == ()


def test_only_one_request_is_open() -> None:
    made = operation()
    first = made.submit("mode", "stand", "process 1")
    with pytest.raises(RequestRefused, match="another request is open: mode 'stand' of process 1"):
        made.submit("preset", "wave", "process 2")
    first.withdraw()
    second = made.submit("preset", "wave", "process 2")
    assert made.take() == (second,)


def test_thousands_of_requests_leave_one() -> None:
    made = operation()
    for _ in range(5000):
        made.submit("mode", "stand", "process 1").withdraw()
    last = made.submit("mode", "balance", "process 1")
    assert made.take() == (last,)
    assert made.take() == ()


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"unknown mode 'fly'; modes: damping, stand, balance"):
        operation().submit("mode", "fly", "process 1")
    with pytest.raises(ValueError, match="the program offers no presets"):
        Operation(MODES).submit("preset", "\x1b[2J", "process 1")


def test_the_reason_of_a_refusal_has_one_printable_line() -> None:
    request = operation().submit("mode", "stand", "process 1")
    assert request.refuse("fallen\n\x1b[2J" + "x" * 1000)
    reason = request.withdraw().reason
    assert reason.startswith("fallen??[2Jx")
    assert len(reason) == REASON_MAX


def test_a_refusal_always_has_a_reason() -> None:
    request = operation().submit("mode", "stand", "process 1")
    request.refuse("")
    assert request.withdraw().reason


def test_the_mode_is_published_as_a_number() -> None:
    made, memory = operation(), mmap.mmap(-1, 8)
    made.attach(memory, 3)
    assert memory[3] == 0
    assert made.change_mode("balance") is None
    assert memory[3] == 3
    assert made.change_mode("stand") == "balance"
    other = mmap.mmap(-1, 8)
    made.detach()
    made.attach(other, 0)
    assert (other[0], memory[3]) == (2, 2)


def test_an_unknown_mode_changes_nothing() -> None:
    made = operation()
    made.change_mode("stand")
    with pytest.raises(ValueError, match="unknown mode 'run'"):
        made.change_mode("run")
    assert made.mode == "stand"


def test_the_end_of_the_loop_withdraws_the_open_request() -> None:
    made = operation()
    request = made.submit("mode", "stand", "process 1")
    made.detach()
    assert request.answer is not None
    assert request.answer.withdrawn
