"""Who carries the card's interrupts, and whether a loop may spin."""

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


def test_the_cards_own_and_not_those_of_one_with_a_longer_name(tmp_path):
    assert card_interrupts(controller(tmp_path), I210) == [130, 131]


def test_a_paravirtual_cards_have_the_devices_name(tmp_path):
    assert card_interrupts(guest(tmp_path), VIRTIO) == [41]


def test_a_card_whose_interrupts_have_other_names(tmp_path):
    files = {"/sys/class/net/enp2s0/device/msi_irqs/77": "msix"}
    assert card_interrupts(make(tmp_path, files), I210) == [77]


def test_those_free_to_move_are_bound_away_from_the_loop(tmp_path):
    machine = laptop(tmp_path, **{"/proc/702/comm": "sh"})
    check = interrupts(machine, I219)
    assert check.advice == "echo 0 | sudo tee /proc/irq/150/smp_affinity_list"
    assert [str(change) for change in check.changes] == ["/proc/irq/150/smp_affinity_list = 0"]


def test_irqbalance_goes_first(tmp_path):
    check = interrupts(laptop(tmp_path), I219)
    assert (check.changes, "irqbalance" in check.advice) == ((), True)


IRQ = "/proc/irq/131/effective_affinity_list"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, "safe on CPU 3: the answers come by CPU 2"),
        ({IRQ: "3"}, "unsafe: CPU 3, the loop's, also carries the card's answers"),
        ({f"{CPU}/isolated": "", "/proc/self/status": ""}, "unsafe: other programs also use CPU 3"),
        ({"/proc/interrupts": ""}, "the CPU that handles answers is unknown"),
        ({f"{CPU}/online": "3"}, "one CPU"),
    ],
)
def test_spinning(tmp_path, changed, words):
    check = spinning(controller(tmp_path, **changed), I210)
    assert words in check.found
    assert check.status == ("WARN" if changed else "PASS")
