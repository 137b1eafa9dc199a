"""Checks of permissions (locked memory, priorities, raw frames) and of limits in a container."""

from __future__ import annotations

from catenary.doctor.change import FOLDER, Change
from catenary.doctor.check import Check, failed, passed, skipped, warned
from catenary.doctor.machine import (
    CAP_IPC_LOCK,
    CAP_NET_RAW,
    CAP_SYS_NICE,
    Machine,
    as_list,
)
from catenary.doctor.share_folder import ABSENT, MODE, expected, read_folder

ENOUGH_LOCKED = 2**30  # [bytes] a Python with NumPy and Numba maps several hundred MiB
HUGE_PAGES = "/sys/kernel/mm/transparent_hugepage/enabled"
LIMITS = "/etc/security/limits.d/realtime.conf"
UNLIMITED = "unlimited"
SHARES = "/run/catenary"
SHARE_GROUPS = ("catenary", "realtime")


def limits_line(what: str) -> str:
    return (
        f"add `@realtime - {what}` to {LIMITS}, add your user to the group realtime and log in "
        "again"
    )


def memory_lock(machine: Machine) -> Check:
    id = "limit-memlock"
    if machine.in_user_namespace:
        return namespace(machine, id, "Max locked memory", ENOUGH_LOCKED)
    if machine.capable(CAP_IPC_LOCK):
        return passed(id, "this process may lock all memory (CAP_IPC_LOCK)")
    limit = machine.limit("Max locked memory")
    if limit is None:
        return skipped(id, machine.lack("/proc/self/limits"))
    if limit == UNLIMITED or int(limit) >= ENOUGH_LOCKED:
        return passed(id, f"limit of locked memory [bytes]: {limit}")
    return failed(
        id,
        f"this process may lock only {int(limit) // 1024} KiB; page faults will delay the loop",
        f"run once: {machine.permission_command}; or {limits_line('memlock unlimited')}",
    )


def priority(machine: Machine) -> Check:
    """Check RLIMIT_RTPRIO and RLIMIT_RTTIME, setrlimit(2)."""
    id = "limit-rtprio"
    if machine.in_user_namespace:
        return namespace(machine, id, "Max realtime priority", machine.priority)
    timeout = machine.limit("Max realtime timeout") or UNLIMITED
    if machine.capable(CAP_SYS_NICE):
        return passed(id, "all real-time priorities are permitted (CAP_SYS_NICE)")
    limit = machine.limit("Max realtime priority")
    if limit is None:
        return skipped(id, machine.lack("/proc/self/limits"))
    if limit != UNLIMITED and int(limit) < machine.priority:
        return failed(
            id,
            f"priorities up to {limit} are permitted, but the loop needs SCHED_FIFO "
            f"{machine.priority}",
            f"run once: {machine.permission_command}; or {limits_line('rtprio 95')}",
        )
    if timeout != UNLIMITED:
        return warned(
            id,
            f"the kernel stops a real-time thread that runs for {timeout} us without sleeping",
            "ulimit -R unlimited",
        )
    return passed(id, f"maximum real-time priority: {limit}")


def namespace(machine: Machine, id: str, limit: str, expected: int) -> Check:
    """Check a limit in a user namespace, where capabilities do not extend to the machine.

    Only the limit applies, user_namespaces(7).
    """
    value = machine.limit(limit) or "0"
    if value == UNLIMITED or int(value) >= expected:
        return passed(id, f"{limit.lower()}: {value} (user namespace)")
    return failed(
        id,
        f"root of this user namespace lacks the permission ({limit.lower()}: {value})",
        "run outside of the namespace, or in a rootful container with --cap-add SYS_NICE "
        "--cap-add IPC_LOCK",
    )


def raw_frames(machine: Machine) -> Check:
    id = "permission-raw-socket"
    if machine.capable(CAP_NET_RAW):
        return passed(id, "raw Ethernet frames are permitted (CAP_NET_RAW)")
    return failed(
        id,
        "raw Ethernet frames are not permitted, so network interfaces cannot be opened",
        f"run as root, or run once: {machine.permission_command}",
    )


def huge_pages(machine: Machine) -> Check:
    """Check transparent huge pages: Documentation/admin-guide/mm/transhuge.rst."""
    id = "memory-huge-pages"
    text = machine.text(HUGE_PAGES)
    if text is None:
        return skipped(id, machine.lack(HUGE_PAGES))
    if "[always]" not in text:
        return passed(id, "only programs that request them get transparent huge pages")
    return warned(
        id,
        "all programs get transparent huge pages: the kernel moves their memory while they run",
        f"echo madvise | sudo tee {HUGE_PAGES}",
        (Change(HUGE_PAGES, "madvise"),),
    )


def container(machine: Machine) -> Check:
    """Check the processor limits of the control group."""
    id = "container"
    if quota := processor_quota(machine):
        return failed(
            id,
            f"the CPU limit is {quota}; the loop stops for the rest of each period",
            "remove the limit: `--cpus` of docker, `limits.cpu` of Kubernetes, or `CPUQuota=` of "
            "systemd",
        )
    if realtime_runtime(machine) == 0:
        return failed(
            id,
            "this control group has no real-time runtime (CONFIG_RT_GROUP_SCHED), so SCHED_FIFO is "
            "refused even to root",
            "docker run --cpu-rt-runtime=950000 --ulimit rtprio=95; or add rt_group_sched=0 to the "
            "kernel's command line (Linux 6.13 or later)",
        )
    where = f"in a container ({machine.container})" if machine.container else "none detected"
    few = machine.cpus - machine.allowed_cpus - machine.isolated_cpus
    if few and machine.allowed_cpus:
        where += f"; this process may use only CPU {as_list(machine.allowed_cpus)}"
    return passed(id, where)


def groups(machine: Machine, controller: str) -> list[str]:
    """Return the folders of this process's control group and of its parents, cgroups(7)."""
    folders = []
    for line in (machine.text("/proc/self/cgroup") or "").splitlines():
        number, controllers, path = line.split(":", 2)
        if number == "0":
            top = "/sys/fs/cgroup"
        elif controller in controllers.split(","):
            top = f"/sys/fs/cgroup/{controllers}"
        else:
            continue
        parts = [part for part in path.split("/") if part]
        folders += ["/".join([top, *parts[:depth]]) for depth in range(len(parts), -1, -1)]
    return folders


def processor_quota(machine: Machine) -> str:
    """Return the processor quota as text; "" if there is none."""
    for folder in groups(machine, "cpu"):
        quota, _, period = (machine.text(f"{folder}/cpu.max") or "max").partition(" ")
        if quota != "max":
            return f"{int(quota) / 1e3:g} ms in every {int(period) / 1e3:g} ms"
        old = machine.number(f"{folder}/cpu.cfs_quota_us") or -1
        if old > 0:
            length = machine.number(f"{folder}/cpu.cfs_period_us") or 100_000
            return f"{old / 1e3:g} ms in every {length / 1e3:g} ms"
    return ""


def realtime_runtime(machine: Machine) -> int | None:
    """Return the real-time runtime of the control group [us] (version 1); None if unknown."""
    for folder in groups(machine, "cpu"):
        runtime = machine.number(f"{folder}/cpu.rt_runtime_us")
        if runtime is not None:
            return runtime
    return None


def share_folder(machine: Machine) -> Check:
    """Check the folder in which several users share memory, docs/how_to/share.md."""
    id = "share-folder"
    here = machine.path(SHARES)
    known = machine.text("/etc/group")
    if known is None:
        return skipped(id, machine.lack("/etc/group"))
    groups = {line.partition(":")[0] for line in known.splitlines()}
    group = next((name for name in SHARE_GROUPS if name in groups), None)
    try:
        now = read_folder(here)
    except OSError as error:  # not a folder
        now = error.strerror or str(error)
    if now in [expected(name) for name in SHARE_GROUPS]:
        return passed(id, f"group {now.rpartition(':')[2]} shares memory in {SHARES}")
    if group is None or not in_memory(machine, "/run"):
        return passed(
            id,
            "each user shares memory in /dev/shm/catenary-UID",
            ""
            if group
            else "to share it among users: sudo groupadd --system catenary; sudo usermod -aG "
            "catenary USER; then run with --apply",
        )
    change = (Change(f"{FOLDER}{SHARES}", expected(group)),)
    if now != ABSENT:
        return warned(
            id,
            f"{SHARES} is {now}, expected {expected(group)}; programs do not use it",
            f"sudo chown root:{group} {SHARES}; sudo chmod {MODE:o} {SHARES}",
            change,
        )
    return passed(id, f"--apply creates {SHARES} for group {group}", "", change)


def in_memory(machine: Machine, folder: str) -> bool:
    """Return True if the folder is a tmpfs, so that a cycle does not wait for a disk."""
    mounts = (line.split() for line in (machine.text("/proc/mounts") or "").splitlines())
    return any(words[1:3] == [folder, "tmpfs"] for words in mounts)


CHECKS = (memory_lock, priority, raw_frames, huge_pages, container, share_folder)
