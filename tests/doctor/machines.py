"""Simulated machines made of files: a controller, a laptop, a container and a virtual machine."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from catenary.doctor.card import Card, Coalescing, Eee, Link
from catenary.doctor.clock_state import ClockState
from catenary.doctor.machine import Machine

STEADY = ClockState(slew_ppm=12.5, offset=0.0, resolution=1e-9)
CPU = "/sys/devices/system/cpu"
Files = Mapping[str, str]


def make(root: Path, files: Files, **facts: object) -> Machine:
    """Create a machine from files. A path that ends in / is an empty folder."""
    for name, text in files.items():
        path = root / name.lstrip("/")
        if name.endswith("/"):
            path.mkdir(parents=True, exist_ok=True)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n")
    given = {
        "clock": STEADY,
        "permission_command": "sudo setcap ... python",
        **facts,
    }
    return Machine(root=root, **given)  # type: ignore[arg-type]


def status(*, capabilities: int = 0, cpus: str = "0-3") -> str:
    return (
        f"Name:\tpython\nCapEff:\t{capabilities:016x}\nCpus_allowed:\tf\nCpus_allowed_list:\t{cpus}"
    )


def limits(*, memlock: str, rtprio: str, timeout: str = "unlimited") -> str:
    return (
        "Limit                     Soft Limit           Hard Limit           Units     \n"
        f"Max locked memory         {memlock:21}{memlock:21}bytes     \n"
        f"Max realtime priority     {rtprio:21}{rtprio:21}\n"
        f"Max realtime timeout      {timeout:21}{timeout:21}us        "
    )


def each_cpu(name: str, text: str, count: int = 4) -> dict[str, str]:
    return {f"{CPU}/cpu{number}/{name}": text for number in range(count)}


ROOT_USERS = "         0          0 4294967295"

CONTROLLER: Files = {
    "/etc/group": "root:x:0:",
    "/proc/version": "Linux version 6.12.43-rt (debian) #1 SMP PREEMPT_RT Debian 6.12.43-1",
    "/proc/sys/kernel/osrelease": "6.12.43+deb13-rt-amd64",
    "/sys/kernel/realtime": "1",
    "/proc/cmdline": "BOOT_IMAGE=/vmlinuz isolcpus=3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2",
    "/proc/sys/kernel/sched_rt_runtime_us": "-1",
    "/proc/sys/kernel/sched_rt_period_us": "1000000",
    "/proc/cpuinfo": "model name\t: Intel(R) Atom(TM) x6425E\nflags\t\t: fpu tsc",
    f"{CPU}/online": "0-3",
    f"{CPU}/isolated": "3",
    f"{CPU}/nohz_full": "3",
    f"{CPU}/smt/active": "0",
    **each_cpu("cpufreq/scaling_governor", "performance"),
    **each_cpu("cpuidle/state0/latency", "0"),
    **each_cpu("cpuidle/state0/disable", "0"),
    **each_cpu("cpuidle/state1/latency", "170"),
    **each_cpu("cpuidle/state1/disable", "1"),
    "/sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    "/sys/devices/system/clocksource/clocksource0/available_clocksource": "tsc hpet acpi_pm",
    "/proc/self/status": status(capabilities=1 << 13 | 1 << 14 | 1 << 23, cpus="0-2"),
    "/proc/self/limits": limits(memlock="8388608", rtprio="0"),
    "/proc/self/uid_map": ROOT_USERS,
    "/proc/self/cgroup": "0::/user.slice/user-1000.slice",
    "/sys/fs/cgroup/user.slice/cpu.max": "max 100000",
    "/sys/kernel/mm/transparent_hugepage/enabled": "always [madvise] never",
    "/proc/1/comm": "systemd",
    "/proc/640/comm": "chronyd",
    "/etc/chrony/chrony.conf": "pool 2.debian.pool.ntp.org iburst\nmaxslewrate 100",
    "/proc/net/route": "Iface\tDestination\tGateway\nenp1s0\t00000000\t0101A8C0",
    "/proc/sys/net/ipv6/conf/enp2s0/disable_ipv6": "1",
    "/proc/interrupts": "  CPU0 CPU1 CPU2 CPU3\n 130: 1 0 0 0 PCI-MSI 524288-edge enp2s0\n"
    " 131: 9 0 0 0 PCI-MSI 524289-edge enp2s0-TxRx-0\n 140: 9 0 0 0 PCI-MSI 1-edge enp2s00",
    "/proc/irq/130/smp_affinity_list": "2",
    "/proc/irq/130/effective_affinity_list": "2",
    "/proc/irq/131/smp_affinity_list": "2",
    "/proc/irq/131/effective_affinity_list": "2",
    "/sys/class/net/enp1s0/device/": "",
    "/sys/class/net/enp2s0/device/": "",
    "/sys/class/net/enp2s0/gro_flush_timeout": "0",
    "/sys/class/net/enp2s0/napi_defer_hard_irqs": "0",
}
I210 = Card(
    "enp2s0",
    index=3,
    driver="igb",
    bus="0000:02:00.0",
    link=Link(100, True),
    coalescing=Coalescing(0, 0, False),
    eee=Eee(False, False),
    gro=True,
    lro=False,
)


def controller(root: Path, **changed: str) -> Machine:
    return make(root, {**CONTROLLER, **changed}, card=I210)


LAPTOP: Files = {
    "/etc/group": "root:x:0:",
    "/proc/version": "Linux version 6.8.0-45-generic (buildd) #45-Ubuntu SMP PREEMPT_DYNAMIC",
    "/proc/sys/kernel/osrelease": "6.8.0-45-generic",
    "/boot/config-6.8.0-45-generic": "CONFIG_PREEMPT_DYNAMIC=y\nCONFIG_PREEMPT_VOLUNTARY=y\n"
    "CONFIG_NO_HZ_FULL=y\nCONFIG_HZ=1000",
    "/etc/os-release": 'NAME="Ubuntu"\nID=ubuntu\nID_LIKE=debian',
    "/proc/cmdline": "BOOT_IMAGE=/boot/vmlinuz ro quiet splash",
    "/proc/sys/kernel/sched_rt_runtime_us": "950000",
    "/proc/sys/kernel/sched_rt_period_us": "1000000",
    "/proc/cpuinfo": "model name\t: Intel(R) Core(TM) i7\nflags\t\t: fpu tsc",
    f"{CPU}/online": "0-3",
    f"{CPU}/isolated": "",
    f"{CPU}/nohz_full": "(null)",
    f"{CPU}/smt/active": "1",
    f"{CPU}/cpu3/topology/thread_siblings_list": "1,3",
    **each_cpu("cpufreq/scaling_governor", "powersave"),
    **each_cpu("cpuidle/state0/latency", "2"),
    **each_cpu("cpuidle/state0/disable", "0"),
    **each_cpu("cpuidle/state3/name", "C10"),
    **each_cpu("cpuidle/state3/latency", "890"),
    **each_cpu("cpuidle/state3/disable", "0"),
    "/sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    "/proc/self/status": status(),
    "/proc/self/limits": limits(memlock="8388608", rtprio="0"),
    "/proc/self/uid_map": ROOT_USERS,
    "/proc/self/cgroup": "0::/user.slice",
    "/sys/kernel/mm/transparent_hugepage/enabled": "[always] madvise never",
    "/proc/700/comm": "NetworkManager",
    "/proc/701/comm": "avahi-daemon",
    "/proc/702/comm": "irqbalance",
    "/proc/703/comm": "chronyd",
    "/proc/net/route": "Iface\tDestination\tGateway\nwlp3s0\t00000000\t0101A8C0\n"
    "enp0s31f6\t0000FEA9\t00000000",
    "/run/NetworkManager/devices/2": "[device]\nmanaged=true",
    "/proc/sys/net/ipv6/conf/enp0s31f6/disable_ipv6": "0",
    "/proc/net/if_inet6": "fe80000000000000fc00fffe000001 02 40 20 80 enp0s31f6",
    "/proc/interrupts": " 150: 1 2 3 4 IR-PCI-MSI 520192-edge enp0s31f6",
    "/proc/irq/150/smp_affinity_list": "0-3",
    "/proc/irq/150/effective_affinity_list": "3",
    "/sys/class/net/enp0s31f6/device/": "",
    "/sys/class/net/wlp3s0/device/": "",
}
I219 = Card(
    "enp0s31f6",
    index=2,
    driver="e1000e",
    bus="0000:00:1f.6",
    link=Link(1000, True),
    coalescing=Coalescing(3, 0, False),
    eee=Eee(True, True),
    gro=True,
    lro=False,
)


def laptop(root: Path, **changed: str) -> Machine:
    return make(root, {**LAPTOP, **changed}, card=I219)


def container(root: Path) -> Machine:
    """Return a default Docker container with --cpus 1.5 on a well-configured machine."""
    files = {name: text for name, text in CONTROLLER.items() if "enp" not in name}
    return make(
        root,
        {
            **files,
            "/.dockerenv": "",
            "/proc/self/status": status(capabilities=1 << 13, cpus="0-2"),
            "/proc/self/cgroup": "0::/",
            "/sys/fs/cgroup/cpu.max": "150000 100000",
            "/sys/class/net/eth0/": "",
        },
        card=Card("eth0", index=12, driver="veth", link=Link(10000, True)),
    )


GUEST: Files = {
    "/etc/group": "root:x:0:",
    "/proc/version": "Linux version 6.1.0-25-cloud-amd64 #1 SMP PREEMPT_DYNAMIC Debian",
    "/proc/sys/kernel/osrelease": "6.1.0-25-cloud-amd64",
    "/etc/os-release": "ID=debian",
    "/proc/cmdline": "root=/dev/vda1 preempt=full",
    "/proc/sys/kernel/sched_rt_runtime_us": "950000",
    "/proc/cpuinfo": "flags\t\t: fpu tsc hypervisor lahf_lm",
    "/sys/class/dmi/id/sys_vendor": "QEMU",
    "/sys/class/dmi/id/product_name": "Standard PC (Q35 + ICH9, 2009)",
    f"{CPU}/online": "0",
    "/sys/devices/system/clocksource/clocksource0/current_clocksource": "acpi_pm",
    "/sys/devices/system/clocksource/clocksource0/available_clocksource": "kvm-clock acpi_pm",
    "/proc/self/status": status(capabilities=2**41 - 1, cpus="0"),
    "/proc/self/limits": limits(memlock="67108864", rtprio="0"),
    "/proc/self/uid_map": ROOT_USERS,
    "/proc/interrupts": " 41: 3402 PCI-MSIX-0000:00:04.0 1-edge virtio3-rx",
    "/proc/irq/41/smp_affinity_list": "0",
    "/sys/devices/virtio3/": "",
    "/proc/net/route": "Iface\tDestination\nens3\t00000000",
    "/sys/class/net/ens3/": "",
}
VIRTIO = Card(
    "ens3",
    index=2,
    driver="virtio_net",
    bus="0000:00:04.0",
    link=Link(-1, None),
    refusals={"eee": "Operation not supported", "coalescing": "Operation not supported"},
)


def guest(root: Path) -> Machine:
    machine = make(root, GUEST, card=VIRTIO)
    (root / "sys/class/net/ens3/device").symlink_to(root / "sys/devices/virtio3")
    return machine
