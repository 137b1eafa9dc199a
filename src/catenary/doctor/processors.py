"""Checks of the processors: isolation of the loop's CPU, steady speed, idle states."""

from __future__ import annotations

from catenary.doctor.change import Change
from catenary.doctor.check import Check, passed, skipped, warned
from catenary.doctor.machine import Machine, as_list, cpu_list

CPU = "/sys/devices/system/cpu"
SLOW_WAKE_US = 10  # to leave an idle state; a tenth of what 10 kHz have
REBOOT = "in GRUB_CMDLINE_LINUX of /etc/default/grub; sudo update-grub; reboot"


def boot_words(machine: Machine, *names: str, **others: str) -> str:
    """Return the options to add to the kernel's command line.

    Args:
        machine: the machine.
        names: options whose value is the loop's CPU.
        others: options with their values.
    """
    words = [f"{name}={machine.loop_cpu}" for name in names]
    words += [f"{name}={cpus}" for name, cpus in others.items()]
    return f"`{' '.join(words)}` {REBOOT}"


def isolated(machine: Machine) -> Check:
    id = "cpu-isolated"
    if machine.isolated_cpus:
        cpus = as_list(machine.isolated_cpus)
        if machine.loop_cpu in machine.isolated_cpus:
            return passed(id, f"CPU {cpus} kept free; run the loop on CPU {machine.loop_cpu}")
        return warned(
            id,
            f"CPU {cpus} is kept free, but the loop would run on CPU {machine.loop_cpu}",
            f"run it on CPU {max(machine.isolated_cpus)}: taskset -c {max(machine.isolated_cpus)}",
        )
    if not machine.other_cpus:
        return warned(id, "one CPU for the loop and everything else", "a machine with two or more")
    return warned(
        id,
        f"none of {len(machine.cpus)} CPUs is kept free of other programs",
        boot_words(machine, "isolcpus", "rcu_nocbs", irqaffinity=as_list(machine.other_cpus)),
    )


def nohz_full(machine: Machine) -> Check:
    id, path = "cpu-nohz-full", f"{CPU}/nohz_full"
    text = machine.text(path)
    if text is None and machine.configuration.get("CONFIG_NO_HZ_FULL") != "y":
        return skipped(id, f"{machine.lack(path)}: the tick cannot be stopped (a few us each)")
    cpus = cpu_list(text)
    if machine.loop_cpu in cpus:
        return passed(id, f"no tick on CPU {as_list(cpus)} while one thread runs there")
    rate = machine.configuration.get("CONFIG_HZ", "100 to 1000")
    return warned(
        id,
        f"the tick interrupts CPU {machine.loop_cpu} {rate} times a second",
        boot_words(machine, "nohz_full"),
    )


def smt(machine: Machine) -> Check:
    id, path = "cpu-smt", f"{CPU}/smt/active"
    active = machine.number(path)
    if active is None:
        return skipped(id, machine.lack(path))
    if active == 0:
        return passed(id, "no two CPUs share a core")
    siblings = cpu_list(machine.text(f"{CPU}/cpu{machine.loop_cpu}/topology/thread_siblings_list"))
    beside = (siblings & machine.cpus) - {machine.loop_cpu}
    if not beside:
        return passed(id, f"on, but CPU {machine.loop_cpu} has its core to itself")
    return warned(
        id,
        f"CPU {machine.loop_cpu} shares its core with CPU {as_list(beside)}",
        f"echo 0 | sudo tee {CPU}/cpu{min(beside)}/online; or off in the BIOS; or `nosmt` {REBOOT}",
        # not by --apply: a CPU that comes back has lost its interrupts and cpusets
    )


def governor(machine: Machine) -> Check:
    id = "cpu-governor"
    governors = {
        path: machine.text(path)
        for path in machine.matching(f"{CPU}/cpu[0-9]*/cpufreq/scaling_governor")
    }
    if not governors:
        return skipped(id, f"{CPU}/cpu*/cpufreq is not there: the kernel does not change the speed")
    slow = {path: name for path, name in governors.items() if name != "performance"}
    if not slow:
        return passed(id, "performance on all CPUs")
    names = "/".join(sorted({name or "?" for name in slow.values()}))
    return warned(
        id,
        f"{names} on {len(slow)} of {len(governors)} CPUs: the speed follows the load",
        f"echo performance | sudo tee {CPU}/cpu*/cpufreq/scaling_governor",
        tuple(Change(path, "performance") for path in slow),
    )


def idle_states(machine: Machine) -> Check:
    """Check idle states: `latency` is [us] to wake up, Documentation/admin-guide/pm/cpuidle.rst."""
    id = "cpu-idle-states"
    if machine.command_line.get("idle") == "poll":
        return passed(id, "idle=poll: CPUs never sleep")
    states = machine.matching(f"{CPU}/cpu[0-9]*/cpuidle/state[0-9]*")
    if not states:
        why = "the hypervisor decides" if machine.virtual else "the kernel has no idle states"
        return skipped(id, f"{CPU}/cpu*/cpuidle is not there: {why}")
    slow = {
        state: latency
        for state in states
        if (latency := machine.number(f"{state}/latency") or 0) > SLOW_WAKE_US
        and machine.number(f"{state}/disable") == 0
    }
    if not slow:
        return passed(id, f"no state takes longer than {SLOW_WAKE_US} us to leave")
    deepest = max(slow, key=lambda state: slow[state])
    return warned(
        id,
        f"idle CPUs sleep so deeply ({machine.text(f'{deepest}/name')}) that waking takes "
        f"{slow[deepest]} us",
        "`with realtime.session():` in the program keeps them awake while it runs; for all: "
        f"`intel_idle.max_cstate=1 processor.max_cstate=1` {REBOOT}",
        tuple(Change(f"{state}/disable", "1") for state in slow),
    )


CHECKS = (isolated, nohz_full, smt, governor, idle_states)
