"""Changes are saved before they are made, and can be undone."""

from __future__ import annotations

import errno
import grp
import os
import pwd

import pytest

from catenary.doctor.change import (
    Change,
    HostState,
    MachineGround,
    Made,
    StateError,
    apply,
    chosen,
    open_state,
    undo,
)
from catenary.doctor.examination import examine
from catenary.doctor.permissions import HUGE_PAGES
from tests.doctor import machines


class Ground:
    """Simulated machine; targets in `refused` cannot be written."""

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
    return HostState(tmp_path / "state" / "doctor.json", "boot 1")


def test_apply_and_undo(state):
    ground = Ground(a="1", b="2")
    assert list(apply([Change("a", "8"), Change("b", "9")], ground, state)) == [
        "done: a = 8 (was 1)",
        "done: b = 9 (was 2)",
    ]
    assert ground.values == {"a": "8", "b": "9"}
    assert list(undo(ground, state)) == ["undone: b = 2", "undone: a = 1"]
    assert ground.values == {"a": "1", "b": "2"}
    assert state.load() == []


def test_undo_after_two_runs_restores_the_first_values(state):
    ground = Ground(a="1")
    list(apply([Change("a", "8")], ground, state))
    assert list(apply([Change("a", "8")], ground, state)) == ["already set: a = 8"]
    list(apply([Change("a", "9")], ground, state))
    list(undo(ground, state))
    assert ground.values == {"a": "1"}


def test_a_refused_change_is_reported_and_not_saved(state):
    ground = Ground(refused="a", a="1", b="2")
    lines = list(apply([Change("a", "8"), Change("gone", "8"), Change("b", "9")], ground, state))
    assert lines == [
        "REFUSED (Permission denied): a = 8",
        "REFUSED (No such file or directory): gone = 8",
        "done: b = 9 (was 2)",
    ]
    assert [made.target for made in state.load()] == ["b"]


def test_a_value_changed_again_is_not_undone(state):
    ground = Ground(a="1")
    list(apply([Change("a", "8")], ground, state))
    ground.values["a"] = "5"
    assert list(undo(ground, state)) == ["not undone, because its value was changed again: a"]
    assert ground.values == {"a": "5"}


def test_a_refused_undo_stays_in_the_state_file(state):
    ground = Ground(a="1")
    list(apply([Change("a", "8")], ground, state))
    ground.refused = "a"
    assert list(undo(ground, state)) == ["REFUSED (Permission denied): a = 1"]
    ground.refused = ""
    assert list(undo(ground, state)) == ["undone: a = 1"]


def test_a_change_is_saved_before_it_is_made(state):
    """The change can be undone even if the program is killed between the two."""

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
    assert HostState(state.path, "boot 2").load() == []


def test_nothing_is_changed_if_it_cannot_be_saved(state, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    ground = Ground(a="1")
    with pytest.raises(StateError, match=r"No space left on device.*no setting is changed"):
        list(apply([Change("a", "8")], ground, state))
    assert ground.values == {"a": "1"}


def test_a_damaged_state_file_is_an_error(state):
    state.path.parent.mkdir()
    state.path.write_text('{"boot": "boot 1", "made": [{"target": 1}]}')
    with pytest.raises(StateError, match="cannot be read"):
        state.load()


def test_apply_and_undo_on_files(tmp_path, state):
    pages = tmp_path / HUGE_PAGES.lstrip("/")
    pages.parent.mkdir(parents=True)
    pages.write_text("[always] madvise never\n")
    ground = MachineGround(tmp_path)
    assert list(apply([Change(HUGE_PAGES, "madvise")], ground, state)) == [
        f"done: {HUGE_PAGES} = madvise (was always)"
    ]
    assert pages.read_text() == "madvise"
    list(undo(ground, state))
    assert pages.read_text() == "always"


def test_every_change_of_the_checks_can_be_made_and_undone(tmp_path, state):
    """The targets of all changes are in `TARGETS`."""
    laptop = machines.make(tmp_path, machines.LAPTOP)
    changes = examine(laptop).changes
    files = [change for change in changes if not change.target.startswith("ethtool:")]
    assert files
    for line in apply(files, MachineGround(tmp_path), state):
        assert line.startswith("done: ")
    assert all(line.startswith("undone: ") for line in undo(MachineGround(tmp_path), state))


@pytest.mark.parametrize(
    "target",
    [
        "/etc/passwd",
        "/sys/kernel/mm/transparent_hugepage/enabled/../../../../../etc/passwd",
        "/proc/sys/kernel/core_pattern",
        "/proc/irq/../sys/kernel/core_pattern",
        "/proc/sys/net/ipv6/conf/../../../kernel/core_pattern/disable_ipv6",
        "ethtool:../x/eee",
        "ethtool:eth0/features",
        "folder:/etc",
        "",
    ],
)
def test_unknown_targets_are_refused(tmp_path, state, target):
    """Only known targets are written, whatever the state file contains."""
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc" / "passwd").write_text("root")
    for parts in ("etc", "proc/sys/kernel", "sys/kernel/mm/transparent_hugepage/enabled"):
        (tmp_path / parts).mkdir(parents=True, exist_ok=True)
    core = tmp_path / "proc/sys/kernel/core_pattern"
    core.write_text("root")
    with pytest.raises(OSError, match="not a setting that the doctor changes"):
        MachineGround(tmp_path).write(target, "evil")
    assert {(tmp_path / "etc" / "passwd").read_text(), core.read_text()} == {"root"}


def test_undo_reports_and_keeps_unknown_targets(tmp_path, state):
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc" / "passwd").write_text("after")
    state.save([Made("/etc/passwd", "before", "after")])
    assert list(undo(MachineGround(tmp_path), state)) == [
        "REFUSED (not a setting that the doctor changes): /etc/passwd = before"
    ]
    assert (tmp_path / "etc" / "passwd").read_text() == "after"
    assert len(state.load()) == 1


@pytest.mark.parametrize("value", ["", "x", "-1", "1e3", "\u0663"])
def test_a_drivers_setting_is_a_number(value):
    with pytest.raises(OSError, match="is not a number"):
        MachineGround().write("ethtool:eth0/eee", value)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_a_state_file_of_another_user_is_refused(state):
    state.save([Made(HUGE_PAGES, "always", "madvise")])
    os.chown(state.path, 65534, 65534)
    with pytest.raises(StateError, match="belongs to user 65534"):
        state.load()


@pytest.mark.parametrize("mode", [0o620, 0o602])
def test_a_state_file_that_others_can_write_is_refused(state, mode):
    state.save([Made(HUGE_PAGES, "always", "madvise")])
    state.path.chmod(mode)
    with pytest.raises(StateError, match="its content is not trusted"):
        state.load()


def test_a_link_is_not_followed(state, tmp_path):
    """If root followed a link, it would overwrite any file."""
    victim = tmp_path / "victim"
    victim.write_text("mine")
    state.path.parent.mkdir()
    state.path.symlink_to(victim)
    with pytest.raises(StateError, match="cannot be read"):
        state.load()
    state.path.unlink()
    state.path.with_suffix(".new").symlink_to(victim)
    state.save([])
    assert victim.read_text() == "mine"
    assert state.load() == []


def test_the_state_file_of_root_is_not_in_a_group_folder(monkeypatch):
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert str(open_state().path) == "/run/catenary-doctor.json"


def test_a_folder_is_created_and_removed(tmp_path, state):
    me = f"{pwd.getpwuid(os.geteuid()).pw_name}:{grp.getgrgid(os.getegid()).gr_name}"
    ground, target = MachineGround(tmp_path), "folder:/run/catenary"
    (tmp_path / "run").mkdir()
    assert ground.read(target) == "absent"
    list(apply([Change(target, f"3771 {me}")], ground, state))
    assert (tmp_path / "run" / "catenary").stat().st_mode & 0o7777 == 0o3771
    assert ground.read(target) == f"3771 {me}"
    in_use = tmp_path / "run" / "catenary" / "share-arm"
    in_use.touch()
    assert list(undo(ground, state)) == [
        "REFUSED (Directory not empty): folder:/run/catenary = absent"
    ]
    in_use.unlink()
    assert list(undo(ground, state)) == ["undone: folder:/run/catenary = absent"]
    assert not in_use.parent.exists()


@pytest.mark.parametrize("value", ["", "777", "x root:root", "755 nobody-at-all:root", "755 root"])
def test_invalid_folder_states(tmp_path, value):
    (tmp_path / "run").mkdir()
    with pytest.raises(OSError, match=r"invalid folder state|no such user"):
        MachineGround(tmp_path).write("folder:/run/catenary", value)


@pytest.mark.parametrize(
    ("text", "word"), [("always [madvise] never", "madvise"), ("performance", "performance")]
)
def test_the_selected_value_of_several(text, word):
    assert chosen(text) == word
