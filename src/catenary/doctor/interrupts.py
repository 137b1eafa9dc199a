"""Checks of the CPUs that handle the card's interrupts, and of busy-waiting in a loop."""

from __future__ import annotations

import re

from catenary.doctor.card import Card
from catenary.doctor.change import Change
from catenary.doctor.check import Check, passed, skipped, warned
from catenary.doctor.machine import Machine, as_list, cpu_list


def card_interrupts(machine: Machine, card: Card) -> list[int]:
    """Return the card's interrupts in /proc/interrupts, or its MSI interrupts if there are none."""
    place = f"/sys/class/net/{card.name}"
    names = [card.name, *filter(None, [device_name(machine, place)])]
    known = "|".join(map(re.escape, names))
    text = machine.text("/proc/interrupts") or ""
    found = re.findall(rf"^\s*(\d+):.*[\s,](?:{known})(?:[-:@].*)?$", text, re.MULTILINE)
    if not found:
        found = [path.rpartition("/")[2] for path in machine.matching(f"{place}/device/msi_irqs/*")]
    return sorted(map(int, found))


def device_name(machine: Machine, place: str) -> str:
    """Return the device name, such as virtio3. Interrupts of paravirtual cards have this name."""
    device = machine.path(f"{place}/device")
    return device.resolve().name if device.exists() else ""


def handling_cpus(machine: Machine, numbers: list[int]) -> dict[int, frozenset[int]]:
    """Return the CPUs that handle each interrupt, without interrupts of unknown affinity."""
    lists = {
        number: machine.text(f"/proc/irq/{number}/effective_affinity_list")
        or machine.text(f"/proc/irq/{number}/smp_affinity_list")
        for number in numbers
    }
    return {number: cpu_list(text) for number, text in lists.items() if cpu_list(text)}


def interrupts(machine: Machine, card: Card) -> Check:
    """Check the affinity of interrupts: Documentation/core-api/irq/irq-affinity.rst."""
    id = "nic-interrupts"
    affinities = handling_cpus(machine, card_interrupts(machine, card))
    if not affinities:
        return skipped(id, f"/proc/interrupts lists no interrupt of {card.name}")
    allowed = {n: cpu_list(machine.text(f"/proc/irq/{n}/smp_affinity_list")) for n in affinities}
    wide = [n for n, cpus in allowed.items() if len(cpus) > 1 and len(machine.cpus) > 1]
    where = as_list(frozenset().union(*affinities.values()))
    if "irqbalance" in machine.processes:
        return warned(
            id,
            f"irqbalance moves the interrupts between CPUs (now on CPU {where})",
            "sudo systemctl disable --now irqbalance",
        )
    if wide:
        home = min(machine.other_cpus or machine.cpus)
        paths = [f"/proc/irq/{number}/smp_affinity_list" for number in wide]
        return warned(
            id,
            f"interrupts {as_list(wide)} are on CPU {where} now, but not bound to one CPU",
            f"echo {home} | sudo tee {' '.join(paths)}",
            tuple(Change(path, str(home)) for path in paths),
        )
    return passed(id, f"interrupts {as_list(affinities)} are bound to CPU {where}")


def spinning(machine: Machine, card: Card) -> Check:
    """Check whether a loop may busy-wait (`receive="busy"`).

    On the CPU that handles the card's interrupts, the loop would lose every frame, because the
    deferred interrupt work would never run.
    """
    id, cpu = "spin", machine.loop_cpu
    if len(machine.cpus) < 2:
        return warned(id, "unsafe: there is only one CPU", 'use receive="wait" (the default)')
    affinities = handling_cpus(machine, card_interrupts(machine, card))
    if not affinities:
        return warned(
            id,
            "unsafe: the CPU that handles the card's interrupts is unknown",
            'use receive="wait" (the default)',
        )
    if any(cpu in cpus for cpus in affinities.values()):
        return warned(
            id,
            f"unsafe: CPU {cpu} runs the loop and also handles the card's interrupts",
            'use receive="wait" (the default), or move the interrupts (nic-interrupts)',
        )
    if cpu not in machine.isolated_cpus:
        return warned(
            id,
            f"unsafe: other programs also use CPU {cpu} (cpu-isolated)",
            'use receive="wait" (the default)',
        )
    return passed(id, f"safe on CPU {cpu}: CPU {others(affinities)} handles the interrupts")


def others(affinities: dict[int, frozenset[int]]) -> str:
    return as_list(frozenset().union(*affinities.values()))


CHECKS = (interrupts, spinning)
