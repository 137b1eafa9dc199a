"""Checks of the processors: isolation of the loop's CPU, constant frequency, idle states."""

from __future__ import annotations

from catenary.doctor.change import Change
from catenary.doctor.check import Check, passed, skipped, warned
from catenary.doctor.machine import Machine, as_list, cpu_list

CPU = "/sys/devices/system/cpu"
SLOW_WAKE_US = 10  # time to leave an idle state: a tenth of the period at 10 kHz
REBOOT = "to GRUB_CMDLINE_LINUX in /etc/default/grub; then `sudo update-grub` and reboot"


def boot_words(machine: Machine, *names: str, **others: str) -> str:
    """Return the advice to add options to the kernel's command line.

    Args:
        machine: the machine.
        names: options whose value is the loop's CPU.
        others: options with their values.
    """
    options = [f"{name}={machine.loop_cpu}" for name in names]
    options += [f"{name}={cpus}" for name, cpus in others.items()]
    return f"add `{' '.join(options)}` {REBOOT}"


def isolated(machine: Machine) -> Check:
    id = "cpu-isolated"
    if machine.isolated_cpus:
        cpus = as_list(machine.isolated_cpus)
        if machine.loop_cpu in machine.isolated_cpus:
            return passed(id, f"CPU {cpus} is isolated; run the loop on CPU {machine.loop_cpu}")
        return warned(
            id,
            f"CPU {cpus} is isolated, but the loop would run on CPU {machine.loop_cpu}",
            f"run it on CPU {max(machine.isolated_cpus)}: taskset -c {max(machine.isolated_cpus)}",
        )
    if not machine.other_cpus:
        return warned(
            id,
            "the only CPU runs the loop and all other programs",
            "use a machine with two or more CPUs",
        )
    return warned(
        id,
        f"none of the {len(machine.cpus)} CPUs is isolated from other programs",
        boot_words(machine, "isolcpus", "rcu_nocbs", irqaffinity=as_list(machine.other_cpus)),
    )


def nohz_full(machine: Machine) -> Check:
    id, path = "cpu-nohz-full", f"{CPU}/nohz_full"
    text = machine.text(path)
    if text is None and machine.configuration.get("CONFIG_NO_HZ_FULL") != "y":
        return skipped(
            id, f"{machine.lack(path)}; the tick cannot be stopped (it takes a few us each time)"
        )
    cpus = cpu_list(text)
    if machine.loop_cpu in cpus:
        return passed(id, f"no tick on CPU {as_list(cpus)} while only one thread runs there")
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
        return passed(id, "off: no two CPUs share a core")
    siblings = cpu_list(machine.text(f"{CPU}/cpu{machine.loop_cpu}/topology/thread_siblings_list"))
    siblings_online = (siblings & machine.cpus) - {machine.loop_cpu}
    if not siblings_online:
        return passed(id, f"on, but CPU {machine.loop_cpu} does not share its core")
    return warned(
        id,
        f"CPU {machine.loop_cpu} shares its core with CPU {as_list(siblings_online)}",
        f"echo 0 | sudo tee {CPU}/cpu{min(siblings_online)}/online; or disable SMT in the BIOS; "
        f"or add `nosmt` {REBOOT}",
        # not by --apply: a CPU loses its interrupts and cpusets while it is offline
    )


def governor(machine: Machine) -> Check:
    id = "cpu-governor"
    governors = {
        path: machine.text(path)
        for path in machine.matching(f"{CPU}/cpu[0-9]*/cpufreq/scaling_governor")
    }
    if not governors:
        return skipped(
            id, f"{CPU}/cpu*/cpufreq does not exist; the kernel does not control the frequency"
        )
    slow = {path: name for path, name in governors.items() if name != "performance"}
    if not slow:
        return passed(id, "performance on all CPUs")
    names = "/".join(sorted({name or "?" for name in slow.values()}))
    return warned(
        id,
        f"{names} on {len(slow)} of {len(governors)} CPUs: the frequency follows the load",
        f"echo performance | sudo tee {CPU}/cpu*/cpufreq/scaling_governor",
        tuple(Change(path, "performance") for path in slow),
    )


def idle_states(machine: Machine) -> Check:
    """Check the wake-up times of idle states, Documentation/admin-guide/pm/cpuidle.rst."""
    id = "cpu-idle-states"
    if machine.command_line.get("idle") == "poll":
        return passed(id, "idle=poll: CPUs never sleep")
    states = machine.matching(f"{CPU}/cpu[0-9]*/cpuidle/state[0-9]*")
    if not states:
        why = "the hypervisor controls them" if machine.virtual else "the kernel has no idle states"
        return skipped(id, f"{CPU}/cpu*/cpuidle does not exist; {why}")
    slow = {
        state: latency
        for state in states
        if (latency := machine.number(f"{state}/latency") or 0) > SLOW_WAKE_US
        and machine.number(f"{state}/disable") == 0
    }
    if not slow:
        return passed(id, f"all idle states wake within {SLOW_WAKE_US} us")
    deepest = max(slow, key=lambda state: slow[state])
    return warned(
        id,
        f"waking from the deepest idle state ({machine.text(f'{deepest}/name')}) takes "
        f"{slow[deepest]} us",
        "use `with realtime.session():` to prevent deep sleep while your program runs; or, for "
        f"all programs, add `intel_idle.max_cstate=1 processor.max_cstate=1` {REBOOT}",
        tuple(Change(f"{state}/disable", "1") for state in slow),
    )


CHECKS = (isolated, nohz_full, smt, governor, idle_states)
