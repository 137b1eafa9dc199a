"""Checks of the machine's clocks: the cost of a reading, and daemons that change their rate.

A loop uses CLOCK_MONOTONIC for its period. Steps of the time of day do not affect this clock, but
a daemon that corrects the time of day changes its rate.
"""

from __future__ import annotations

import re

from catenary.doctor.check import Check, failed, passed, skipped, warned
from catenary.doctor.machine import Machine

SOURCE = "/sys/devices/system/clocksource/clocksource0/current_clocksource"
FAST_SOURCES = {"tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "riscv"}
HARMLESS_PPM = 500.0  # largest correction that the kernel makes by itself: 0.5 us in 1 ms
LARGEST_SLEW = {  # [ppm] default maximum of each daemon
    "chronyd": 83_333.333,  # maxslewrate, chrony.conf(5)
    "ptp4l": 900_000.0,  # max_frequency, ptp4l(8)
    "phc2sys": 900_000.0,
    "ntpd": HARMLESS_PPM,  # ntpd(8)
    "openntpd": HARMLESS_PPM,
    "systemd-timesyn": HARMLESS_PPM,  # comm has 15 characters of systemd-timesyncd
}
CHRONY_FILES = ("/etc/chrony/chrony.conf", "/etc/chrony.conf", "/etc/chrony/conf.d/*.conf")


def source(machine: Machine) -> Check:
    id = "clock-source"
    name = machine.text(SOURCE)
    if name is None:
        return skipped(id, machine.lack(SOURCE))
    if name in FAST_SOURCES or name.startswith("riscv"):
        return passed(id, name)
    reading = f"{name}: reading the time needs a system call, which can take microseconds"
    available = (machine.text(SOURCE.replace("current", "available")) or "").split()
    better = [candidate for candidate in available if candidate in FAST_SOURCES]
    if better:
        return failed(id, reading, f"echo {better[0]} | sudo tee {SOURCE}; dmesg shows the cause")
    return failed(id, reading, "no faster clock is available: `dmesg | grep -i clocksource`")


def slewing(machine: Machine) -> Check:
    id = "clock-slewing"
    now = machine.clock
    if now is not None and abs(now.slew_ppm) > HARMLESS_PPM:
        return warned(
            id,
            f"the clock currently slews by {now.slew_ppm:+.0f} ppm: a period of 1 ms is "
            f"{1.0 + now.slew_ppm * 1e-6:.6f} ms of the crystal",
            "wait until the clock has settled, or correct the time before the loop starts",
        )
    daemons = {name: ppm for name, ppm in LARGEST_SLEW.items() if name in machine.processes}
    if "chronyd" in daemons:
        daemons["chronyd"] = chrony_limit(machine)
    strong = [name for name, ppm in daemons.items() if ppm > HARMLESS_PPM]
    if strong:
        return warned(
            id,
            f"{' and '.join(strong)} may slew the clock by up to {daemons[strong[0]]:.0f} ppm",
            "chrony: `maxslewrate 100` in /etc/chrony/chrony.conf; sudo systemctl restart chrony"
            if "chronyd" in strong
            else f"`max_frequency 500000` (ppb) in the configuration of {strong[0]}",
        )
    if now is None:
        return skipped(id, "the kernel does not report the adjustment of its clock")
    daemon_text = (
        f"{' and '.join(daemons)}, at most {HARMLESS_PPM:.0f} ppm"
        if daemons
        else "no time daemon detected"
    )
    return passed(id, f"{daemon_text}; currently {now.slew_ppm:+.1f} ppm")


def chrony_limit(machine: Machine) -> float:
    """Return the last `maxslewrate` of the configuration [ppm]; chrony's default if not set."""
    files = [path for pattern in CHRONY_FILES for path in machine.matching(pattern)]
    text = "\n".join(machine.text(path) or "" for path in files)
    found = re.findall(r"^\s*maxslewrate\s+([\d.]+)", text, re.MULTILINE | re.IGNORECASE)
    return float(found[-1]) if found else LARGEST_SLEW["chronyd"]


CHECKS = (source, slewing)
