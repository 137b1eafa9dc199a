"""Checks of the card's interrupts and of busy-waiting."""

from __future__ import annotations

import pytest

from catenary.doctor.interrupts import card_interrupts, interrupts, spinning
from tests.doctor.machines import (
    CPU,
    I210,
    I219,
    VIRTIO,
    controller,
    guest,
    laptop,
    make,
)


def test_interrupts_of_a_card_with_a_longer_name_are_ignored(tmp_path):
    assert card_interrupts(controller(tmp_path), I210) == [130, 131]


def test_interrupts_of_a_paravirtual_card_have_the_name_of_the_device(tmp_path):
    assert card_interrupts(guest(tmp_path), VIRTIO) == [41]


def test_a_card_whose_interrupts_have_other_names(tmp_path):
    files = {"/sys/class/net/enp2s0/device/msi_irqs/77": "msix"}
    assert card_interrupts(make(tmp_path, files), I210) == [77]


def test_unbound_interrupts_are_moved_off_the_loops_cpu(tmp_path):
    machine = laptop(tmp_path, **{"/proc/702/comm": "sh"})
    check = interrupts(machine, I219)
    assert check.advice == "echo 0 | sudo tee /proc/irq/150/smp_affinity_list"
    assert [str(change) for change in check.changes] == ["/proc/irq/150/smp_affinity_list = 0"]


def test_irqbalance_must_be_disabled_first(tmp_path):
    check = interrupts(laptop(tmp_path), I219)
    assert (check.changes, "irqbalance" in check.advice) == ((), True)


IRQ = "/proc/irq/131/effective_affinity_list"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, "safe on CPU 3: CPU 2 handles the interrupts"),
        ({IRQ: "3"}, "unsafe: CPU 3 runs the loop and also handles the card's interrupts"),
        ({f"{CPU}/isolated": "", "/proc/self/status": ""}, "unsafe: other programs also use CPU 3"),
        ({"/proc/interrupts": ""}, "the CPU that handles the card's interrupts is unknown"),
        ({f"{CPU}/online": "3"}, "only one CPU"),
    ],
)
def test_spinning(tmp_path, changed, words):
    check = spinning(controller(tmp_path, **changed), I210)
    assert words in check.found
    assert check.status == ("WARN" if changed else "PASS")
