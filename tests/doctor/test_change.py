"""Changes are noted before they are made, and taken back."""

from __future__ import annotations

import errno
import os

import pytest

from catenary.doctor.change import Change, MachineGround, State, StateError, apply, chosen, undo


class Ground:
    """Owns values; those in `refused` cannot be written."""

    def __init__(self, refused: str = "", **values: str) -> None:
        self.values = values
        self.refused = refused

    def read(self, target: str) -> str:
        if target not in self.values:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT), target)
        return self.values[target]

    def write(self, target: str, value: str) -> None:
        if target == self.refused:
            raise OSError(errno.EACCES, os.strerror(errno.EACCES), target)
        self.values[target] = value


@pytest.fixture
def state(tmp_path):
    return State(tmp_path / "state" / "doctor.json", "boot 1")


def test_applied_and_undone(state):
    ground = Ground(a="1", b="2")
    assert list(apply([Change("a", "8"), Change("b", "9")], ground, state)) == [
        "done: a = 8 (was 1)",
        "done: b = 9 (was 2)",
    ]
    assert ground.values == {"a": "8", "b": "9"}
    assert list(undo(ground, state)) == ["undone: b = 2", "undone: a = 1"]
    assert ground.values == {"a": "1", "b": "2"}
    assert state.load() == []


def test_twice_applied_goes_back_to_what_was_there_first(state):
    ground = Ground(a="1")
    list(apply([Change("a", "8")], ground, state))
    assert list(apply([Change("a", "8")], ground, state)) == ["as it should be already: a = 8"]
    list(apply([Change("a", "9")], ground, state))
    list(undo(ground, state))
    assert ground.values == {"a": "1"}


def test_what_is_refused_is_said_and_not_noted(state):
    ground = Ground(refused="a", a="1", b="2")
    lines = list(apply([Change("a", "8"), Change("gone", "8"), Change("b", "9")], ground, state))
    assert lines == [
        "REFUSED (Permission denied): a = 8",
        "REFUSED (No such file or directory): gone = 8",
        "done: b = 9 (was 2)",
    ]
    assert [made.target for made in state.load()] == ["b"]


def test_what_somebody_else_changed_since_is_left(state):
    ground = Ground(a="1")
    list(apply([Change("a", "8")], ground, state))
    ground.values["a"] = "5"
    assert list(undo(ground, state)) == ["left, since it was changed by somebody else: a"]
    assert ground.values == {"a": "5"}


def test_what_cannot_be_undone_now_stays_noted(state):
    ground = Ground(a="1")
    list(apply([Change("a", "8")], ground, state))
    ground.refused = "a"
    assert list(undo(ground, state)) == ["REFUSED (Permission denied): a = 1"]
    ground.refused = ""
    assert list(undo(ground, state)) == ["undone: a = 1"]


def test_it_is_noted_before_it_is_made(state):
    """Killed between the two, it can still be undone."""

    class Killed(Ground):
        def write(self, target: str, value: str) -> None:
            super().write(target, value)
            raise KeyboardInterrupt

    ground = Killed(a="1")
    with pytest.raises(KeyboardInterrupt):
        list(apply([Change("a", "8")], ground, state))
    assert list(undo(Ground(**ground.values), state)) == ["undone: a = 1"]


def test_after_a_reboot_there_is_nothing_to_undo(state):
    list(apply([Change("a", "8")], Ground(a="1"), state))
    assert State(state.path, "boot 2").load() == []


def test_where_nothing_can_be_noted_nothing_is_changed(state, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    ground = Ground(a="1")
    with pytest.raises(StateError, match=r"No space left on device.*so nothing is changed"):
        list(apply([Change("a", "8")], ground, state))
    assert ground.values == {"a": "1"}


def test_a_damaged_note_is_an_error_and_not_silence(state):
    state.path.parent.mkdir()
    state.path.write_text('{"boot": "boot 1", "made": [{"target": 1}]}')
    with pytest.raises(StateError, match="does not tell what was changed"):
        state.load()


def test_files_of_a_machine(tmp_path, state):
    pages = tmp_path / "sys" / "enabled"
    pages.parent.mkdir()
    pages.write_text("[always] madvise never\n")
    ground = MachineGround(tmp_path)
    assert list(apply([Change("/sys/enabled", "madvise")], ground, state)) == [
        "done: /sys/enabled = madvise (was always)"
    ]
    assert pages.read_text() == "madvise"
    list(undo(ground, state))
    assert pages.read_text() == "always"


@pytest.mark.parametrize(
    ("text", "word"), [("always [madvise] never", "madvise"), ("performance", "performance")]
)
def test_the_chosen_one_of_several(text, word):
    assert chosen(text) == word
