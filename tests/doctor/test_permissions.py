"""Checks of permissions and containers."""

from __future__ import annotations

import pytest

from catenary.doctor.permissions import (
    container,
    memory_lock,
    priority,
    raw_frames,
    share_folder,
)
from tests.doctor.machines import ROOT_USERS, limits, make, status

ALL = 2**41 - 1


def user(root, capabilities=0, uid_map=ROOT_USERS, **files):
    given = {"/proc/self/status": status(capabilities=capabilities), "/proc/self/uid_map": uid_map}
    return make(root, {**given, **files})


@pytest.mark.parametrize(
    ("memlock", "rtprio", "verdicts"),
    [
        ("8388608", "0", "FAIL FAIL"),
        ("unlimited", "95", "PASS PASS"),
        ("4294967296", "80", "PASS PASS"),
        ("unlimited", "79", "PASS FAIL"),  # the loop's thread needs 80
    ],
)
def test_limits_of_an_ordinary_user(tmp_path, memlock, rtprio, verdicts):
    machine = user(tmp_path, **{"/proc/self/limits": limits(memlock=memlock, rtprio=rtprio)})
    assert f"{memory_lock(machine).status} {priority(machine).status}" == verdicts


def test_capabilities_override_limits(tmp_path):
    machine = user(tmp_path, ALL, **{"/proc/self/limits": limits(memlock="0", rtprio="0")})
    checks = (memory_lock(machine), priority(machine), raw_frames(machine))
    assert {check.status for check in checks} == {"PASS"}


def test_root_of_a_user_namespace_may_only_send_raw_frames(tmp_path):
    machine = user(
        tmp_path, ALL, "0 1000 1", **{"/proc/self/limits": limits(memlock="8388608", rtprio="0")}
    )
    assert raw_frames(machine).status == "PASS"
    for check in (memory_lock(machine), priority(machine)):
        assert (check.status, "user namespace" in check.found) == ("FAIL", True)


def test_a_real_time_timeout_warns(tmp_path):
    limit = limits(memlock="0", rtprio="95", timeout="200000")
    check = priority(user(tmp_path, **{"/proc/self/limits": limit}))
    assert (check.status, "200000 us" in check.found) == ("WARN", True)


def test_a_missing_permission_gives_the_command(tmp_path):
    check = raw_frames(user(tmp_path))
    assert (check.status, check.advice) == (
        "FAIL",
        "run as root, or run once: sudo setcap ... python",
    )


def test_the_folder_of_shares(tmp_path):
    """The user of the test owns the folder, not root; tests/attack has other states."""
    group = {"/etc/group": "root:x:0:\ncatenary:x:990:alice,bob"}
    mounts = {"/proc/mounts": "tmpfs /run tmpfs rw,nosuid 0 0"}
    alone = share_folder(make(tmp_path / "alone", {**mounts, "/etc/group": "root:x:0:"}))
    assert (alone.status, alone.changes) == ("PASS", ())
    assert "groupadd --system catenary" in alone.advice
    on_disk = share_folder(make(tmp_path / "disk", group))
    assert (on_disk.status, on_disk.changes) == ("PASS", ())
    ready = share_folder(make(tmp_path / "ready", {**group, **mounts}))
    [change] = ready.changes
    assert (ready.status, str(change)) == ("PASS", "folder:/run/catenary = 3771 root:catenary")
    wrong = share_folder(make(tmp_path / "wrong", {**group, **mounts, "/run/catenary/": ""}))
    assert (wrong.status, wrong.changes) == ("WARN", (change,))


@pytest.mark.parametrize(
    ("files", "status", "words"),
    [
        ({"/sys/fs/cgroup/a/b/cpu.max": "max 100000"}, "PASS", "none detected"),
        ({"/sys/fs/cgroup/a/cpu.max": "50000 100000"}, "FAIL", "50 ms in every 100 ms"),
        ({"/sys/fs/cgroup/cpu,cpuacct/d/cpu.cfs_quota_us": "-1"}, "PASS", "none detected"),
        ({"/sys/fs/cgroup/cpu,cpuacct/d/cpu.cfs_quota_us": "20000"}, "FAIL", "20 ms in every"),
        ({"/sys/fs/cgroup/cpu,cpuacct/d/cpu.rt_runtime_us": "0"}, "FAIL", "SCHED_FIFO is refused"),
        ({"/sys/fs/cgroup/cpu,cpuacct/d/cpu.rt_runtime_us": "950000"}, "PASS", "none detected"),
    ],
)
def test_control_groups(tmp_path, files, status, words):
    groups = {"/proc/self/cgroup": "4:memory:/x\n2:cpu,cpuacct:/d\n0::/a/b"}
    check = container(make(tmp_path, {**groups, **files}))
    assert (check.status, words in check.found) == (status, True)
