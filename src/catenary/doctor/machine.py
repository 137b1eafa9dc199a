"""Machine: properties that the kernel reports in files, below a root folder that tests replace."""

from __future__ import annotations

import gzip
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from catenary.doctor.card import Card
from catenary.doctor.clock_state import ClockState
from catenary.doctor.ptp_state import PtpState
from catenary.realtime.system.preparation import SET_CAPABILITIES

INITIAL_USER_NAMESPACE = (0, 0, 2**32 - 1)  # /proc/self/uid_map, user_namespaces(7)
CAP_NET_RAW, CAP_IPC_LOCK, CAP_SYS_NICE = 13, 14, 23  # linux/capability.h


@dataclass(frozen=True)
class Machine:
    """A read-only view of a machine.

    card: settings of the network card; None if no card was given.
    clock: adjustment of the kernel's clock; None if the kernel does not report it.
    ptp: state of ptp4l; None if it does not answer.
    wanted_cpu: CPU of the loop; None if the user gave none.
    period: period of the loop [s]. priority: SCHED_FIFO priority of its thread.
    watched: time for which the sent frames of the card were counted [s].
    sent: number of frames that the card sent in this time; None if not counted.
    """

    root: Path = Path("/")
    card: Card | None = None
    clock: ClockState | None = None
    ptp: PtpState | None = None
    wanted_cpu: int | None = None
    period: float = 1e-3
    priority: int = 80
    watched: float = 0.0
    sent: int | None = None
    architecture: str = field(default_factory=lambda: os.uname().machine)
    permission_command: str = SET_CAPABILITIES

    # files

    def path(self, path: str) -> Path:
        return self.root / path.lstrip("/")

    def text(self, path: str) -> str | None:
        """Return the text of a file, stripped; None if it cannot be read (see `lack`)."""
        try:
            return self.path(path).read_text(errors="replace").strip()
        except OSError:
            return None

    def number(self, path: str) -> int | None:
        """Return the number in a file; None if it contains no number."""
        text = self.text(path)
        return int(text) if text is not None and re.fullmatch(r"-?\d+", text) else None

    def lack(self, path: str) -> str:
        """Return the reason why a file has no usable text."""
        try:
            self.path(path).read_bytes()
        except PermissionError:
            return f"this user may not read {path}"
        except FileNotFoundError:
            return f"this kernel has no {path}"
        except OSError as error:
            return f"{path}: {error.strerror}"
        return f"{path} contains {self.text(path)!r}"

    def matching(self, pattern: str) -> list[str]:
        """Return the matching paths, without the root folder, in natural order."""
        found = (f"/{path.relative_to(self.root)}" for path in self.root.glob(pattern.lstrip("/")))
        return sorted(found, key=natural)

    def exists(self, path: str) -> bool:
        return self.path(path).exists()

    # properties that several checks use

    @cached_property
    def command_line(self) -> dict[str, str]:
        """Command line of the kernel, `name=value`; a bare word has the value ""."""
        words = (self.text("/proc/cmdline") or "").split()
        return {name: value for name, _, value in (word.partition("=") for word in words)}

    @cached_property
    def configuration(self) -> dict[str, str]:
        """CONFIG_... options of the kernel; empty if not available."""
        release = self.text("/proc/sys/kernel/osrelease") or ""
        text = self.text(f"/boot/config-{release}") or self._packed("/proc/config.gz")
        return dict(re.findall(r"^(CONFIG_\w+)=(\S+)", text, re.MULTILINE))

    def _packed(self, path: str) -> str:
        try:
            return gzip.decompress(self.path(path).read_bytes()).decode(errors="replace")
        except (OSError, EOFError):
            return ""

    @cached_property
    def processes(self) -> frozenset[str]:
        """Names of the running programs that this process can see."""
        names = (self.text(path) for path in self.matching("/proc/[0-9]*/comm"))
        return frozenset(name for name in names if name)

    @cached_property
    def commands(self) -> dict[str, list[tuple[str, ...]]]:
        """Arguments of the visible processes, by the name of the program."""
        found: dict[str, list[tuple[str, ...]]] = {}
        for path in self.matching("/proc/[0-9]*/cmdline"):
            program, *words = (self.text(path) or "").split("\0")
            found.setdefault(program.rpartition("/")[2], []).append(tuple(words))
        return found

    def frames_sent(self) -> int | None:
        """Return the number of frames that the card has sent: /proc/net/dev, proc(5)."""
        if self.card is None:
            return None
        name = re.escape(self.card.name)
        text = self.text("/proc/net/dev") or ""
        found = re.search(rf"^\s*{name}:(?:\s*\d+){{8}}\s+\d+\s+(\d+)", text, re.MULTILINE)
        return int(found[1]) if found else None

    @cached_property
    def cpus(self) -> frozenset[int]:
        """Online CPUs."""
        online = self.text("/sys/devices/system/cpu/online")
        return cpu_list(online) or self.allowed_cpus or frozenset({0})

    @cached_property
    def allowed_cpus(self) -> frozenset[int]:
        """CPUs that this process may use by default; isolated CPUs are usually not among them."""
        return cpu_list(self.status_field("Cpus_allowed_list"))

    @cached_property
    def isolated_cpus(self) -> frozenset[int]:
        """CPUs isolated by the kernel's command line or by a cpuset."""
        by_command_line = cpu_list(self.text("/sys/devices/system/cpu/isolated"))
        return by_command_line | cpu_list(self.text("/sys/fs/cgroup/cpuset.cpus.isolated"))

    @cached_property
    def loop_cpu(self) -> int:
        """CPU of the loop: the one given, else the last isolated CPU, else the last CPU."""
        if self.wanted_cpu is not None:
            return self.wanted_cpu
        return max(self.isolated_cpus or self.allowed_cpus or self.cpus)

    @cached_property
    def other_cpus(self) -> frozenset[int]:
        """CPUs for everything except the loop; empty if there is only one CPU."""
        return self.cpus - self.isolated_cpus - {self.loop_cpu}

    def status_field(self, name: str) -> str | None:
        found = re.search(rf"^{name}:\s*(.*)", self.text("/proc/self/status") or "", re.MULTILINE)
        return found[1].strip() if found else None

    def limit(self, name: str) -> str | None:
        """Return a soft limit of /proc/self/limits as text."""
        text = self.text("/proc/self/limits") or ""
        found = re.search(rf"^{re.escape(name)}\s+(\S+)", text, re.MULTILINE)
        return found[1] if found else None

    def capable(self, capability: int) -> bool:
        """Return True if this process has the capability, capabilities(7)."""
        return bool(int(self.status_field("CapEff") or "0", 16) >> capability & 1)

    @cached_property
    def in_user_namespace(self) -> bool:
        """True in a user namespace, whose capabilities do not extend to scheduling and memory."""
        text = self.text("/proc/self/uid_map")
        return text is not None and tuple(map(int, text.split())) != INITIAL_USER_NAMESPACE

    @cached_property
    def virtual(self) -> str:
        """Name or kind of the hypervisor; empty on real hardware."""
        if kind := self.text("/sys/hypervisor/type"):
            return kind
        if self.exists("/proc/device-tree/hypervisor"):
            return "unknown hypervisor, device tree"
        if re.search(r"^flags\s*:.*\bhypervisor\b", self.text("/proc/cpuinfo") or "", re.MULTILINE):
            names = (self.text(f"/sys/class/dmi/id/{name}") for name in DMI_NAMES)
            return " ".join(filter(None, names)) or "unknown hypervisor, /proc/cpuinfo"
        return ""

    @cached_property
    def container(self) -> str:
        """Kind of this container; empty if none is detected."""
        for path, kind in CONTAINER_FILES.items():
            if self.exists(path):
                return kind or self.text(path) or "of some kind"
        found = re.search(r"docker|kubepods|libpod|lxc", self.text("/proc/1/cgroup") or "")
        return found[0] if found else ""


DMI_NAMES = ("sys_vendor", "product_name")
CONTAINER_FILES = {  # as in systemd-detect-virt; "" if the file's text is the kind
    "/run/systemd/container": "",
    "/run/.containerenv": "podman",
    "/.dockerenv": "docker",
}


def natural(text: str) -> list[tuple[int, str]]:
    """Return a sort key that puts cpu2 before cpu10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", text)]


def cpu_list(text: str | None) -> frozenset[int]:
    """Parse a list such as `0-3,8`, cpuset(7). No text and `(null)` give an empty set."""
    cpus: set[int] = set()
    for part in (text or "").split(","):
        if found := re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part):
            cpus |= set(range(int(found[1]), int(found[2] or found[1]) + 1))
    return frozenset(cpus)


def as_list(cpus: Iterable[int]) -> str:
    """Format CPUs as the shortest list that the kernel accepts, such as `0-3,8`."""
    runs: list[list[int]] = []
    for cpu in sorted(cpus):
        if runs and cpu == runs[-1][1] + 1:
            runs[-1][1] = cpu
        else:
            runs.append([cpu, cpu])
    return ",".join(f"{first}" if first == last else f"{first}-{last}" for first, last in runs)
