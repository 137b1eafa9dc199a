"""Checks of the kernel: preemption, limits of real-time threads, timers, virtualisation."""

from __future__ import annotations

import re

from catenary.doctor.check import Check, failed, passed, skipped, warned
from catenary.doctor.machine import Machine

CONFIGURED = {  # default model by configuration option, kernel/Kconfig.preempt
    "CONFIG_PREEMPT_RT": "rt",
    "CONFIG_PREEMPT": "full",
    "CONFIG_PREEMPT_LAZY": "lazy",
    "CONFIG_PREEMPT_VOLUNTARY": "voluntary",
    "CONFIG_PREEMPT_NONE": "none",
}
DEBIAN_ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64"}
SHARP_TIMERS = 1e-6  # [s]


def preemption_model(machine: Machine) -> str:
    """Return rt, full, lazy, voluntary or none; "" if the kernel does not report it."""
    version = machine.text("/proc/version") or ""
    if machine.number("/sys/kernel/realtime") == 1 or re.search(r"PREEMPT[_ ]RT", version):
        return "rt"
    if chosen := re.search(r"\((\w+)\)", machine.text("/sys/kernel/debug/sched/preempt") or ""):
        return chosen[1]
    if machine.command_line.get("preempt"):
        return machine.command_line["preempt"]
    for option, model in CONFIGURED.items():
        if machine.configuration.get(option) == "y":
            return model
    return "full" if re.search(r"\bPREEMPT\b", version) else ""


def preemption(machine: Machine) -> Check:
    id = "kernel-preemption"
    release = machine.text("/proc/sys/kernel/osrelease") or "this kernel"
    model = preemption_model(machine)
    if model == "rt":
        return passed(id, f"PREEMPT_RT ({release})")
    if model in ("full", "lazy"):  # both preempt system calls for real-time threads at once
        return warned(
            id, f"{model} preemption, not PREEMPT_RT ({release})", realtime_kernel(machine)
        )
    if model:
        return failed(id, f"preemption model: {model} ({release})", realtime_kernel(machine))
    return warned(
        id, f"not PREEMPT_RT, preemption model unknown ({release})", realtime_kernel(machine)
    )


def realtime_kernel(machine: Machine) -> str:
    """Return the advice for a real-time kernel on this distribution."""
    if machine.virtual or machine.container:
        return "use a PREEMPT_RT kernel on the host; its latency limits all guests and containers"
    found = re.search(r'^ID="?(\w+)', machine.text("/etc/os-release") or "", re.MULTILINE)
    distribution = found[1] if found else ""
    if distribution == "debian":
        architecture = DEBIAN_ARCHITECTURES.get(machine.architecture, machine.architecture)
        return f"sudo apt install linux-image-rt-{architecture}; then reboot into it"
    if distribution == "ubuntu":
        return "sudo pro enable realtime-kernel; then reboot (Ubuntu Pro, free for personal use)"
    return "use a kernel with CONFIG_PREEMPT_RT=y: your distribution's, or mainline from 6.12"


def throttling(machine: Machine) -> Check:
    """Check the share of each period that all real-time threads may use together, sched(7)."""
    id, path = "kernel-rt-throttling", "/proc/sys/kernel/sched_rt_runtime_us"
    runtime = machine.number(path)
    if runtime is None:
        return skipped(id, machine.lack(path))
    period = machine.number("/proc/sys/kernel/sched_rt_period_us") or 1_000_000
    if runtime < 0:
        return passed(id, "real-time threads are not limited")
    share = 100 * runtime / period
    if share >= 90:
        return passed(
            id,
            f"real-time threads may use {share:.0f} % of every {period / 1e6:g} s; this is enough, "
            "because a loop sleeps in every cycle",
        )
    return failed(
        id,
        f"the kernel stops real-time threads after {share:.0f} % of every {period / 1e6:g} s",
        "sudo sysctl kernel.sched_rt_runtime_us=950000",
    )


def timers(machine: Machine) -> Check:
    id = "kernel-timers"
    if machine.clock is None:
        return skipped(id, "the kernel does not report the resolution of its timers")
    resolution = machine.clock.resolution
    if resolution <= SHARP_TIMERS:
        return passed(id, f"high resolution ({resolution * 1e9:.0f} ns)")
    return failed(
        id,
        f"timers have a resolution of {resolution * 1e3:g} ms, so shorter periods are impossible",
        "use a kernel with CONFIG_HIGH_RES_TIMERS=y, and do not start it with highres=off",
    )


def virtual_machine(machine: Machine) -> Check:
    id = "virtual-machine"
    if not machine.virtual:
        return passed(id, "none detected")
    return warned(
        id,
        f"virtual machine ({machine.virtual}): its host may stop it for milliseconds",
        "run motors from real hardware; use a virtual machine for virtual segments "
        '(cat.MainDevice("virtual"))',
    )


CHECKS = (preemption, throttling, timers, virtual_machine)
