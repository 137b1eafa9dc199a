"""Checks of the time that several machines share: PTP by linuxptp, and daemons that conflict.

ptp4l synchronises the hardware clock of a network card. phc2sys copies its time to CLOCK_REALTIME.
With `-S`, ptp4l sets CLOCK_REALTIME itself. Sources: ptp4l(8), phc2sys(8), pmc(8), timemaster(8).
"""

from __future__ import annotations

import re
from itertools import pairwise

from catenary.doctor.check import Check, failed, passed, skipped, warned
from catenary.doctor.machine import Machine

BOUND = 10e-6  # [s] largest offset from the grandmaster; the default bound of cat.ExternalClock
TIME_DAEMONS = {  # name in /proc/PID/comm: unit of systemd
    "chronyd": "chrony",
    "ntpd": "ntp",
    "openntpd": "openntpd",
    "systemd-timesyn": "systemd-timesyncd",
}


def daemons(machine: Machine) -> Check:
    id = "clock-daemons"
    if not machine.processes:
        return skipped(id, "this process can see no other process")
    ntp = [name for name in TIME_DAEMONS if name in machine.processes]
    setters = ntp + _ptp_setters(machine)
    if len(setters) > 1 and "timemaster" not in machine.processes:
        stop = " ".join(TIME_DAEMONS[name] for name in ntp[0 if len(ntp) < len(setters) else 1 :])
        return failed(
            id,
            f"{' and '.join(setters)} set the same clock (CLOCK_REALTIME) against each other",
            f"keep one: sudo systemctl disable --now {stop or 'phc2sys'}",
        )
    return passed(id, f"{setters[0]} sets CLOCK_REALTIME" if setters else "no daemon sets the time")


def synchronisation(machine: Machine) -> Check:
    id = "ptp-offset"
    state = machine.ptp
    if state is None:
        return skipped(id, "ptp4l does not answer pmc", "sudo apt install linuxptp; run with sudo")
    if "SLAVE" in state.ports and state.grandmaster:
        found = f"{state.offset * 1e6:+.3f} us from the grandmaster"
        if abs(state.offset) <= BOUND:
            return passed(id, found)
        return warned(
            id,
            f"{found}; more than {BOUND * 1e6:g} us",
            "wait some minutes; then use hardware time stamps: `ethtool -T NIC`",
        )
    if _is_grandmaster(machine):
        return passed(id, "this machine is the grandmaster")
    return failed(
        id,
        f"ptp4l does not follow a grandmaster: port {', '.join(state.ports)}",
        "check cable, domain and transport on both machines: `journalctl -u ptp4l@NIC`",
    )


def system_clock(machine: Machine) -> Check:
    id = "ptp-system-clock"
    setters = _ptp_setters(machine)
    if "timemaster" in machine.processes:
        return passed(id, "timemaster sets CLOCK_REALTIME from PTP")
    if _is_grandmaster(machine) and "phc2sys" in machine.processes:
        return _grandmaster_clock(id, "phc2sys" in setters)
    if setters:
        return passed(id, f"{setters[0]} sets CLOCK_REALTIME from PTP")
    if "chronyd" in machine.processes:
        return passed(id, "chronyd sets CLOCK_REALTIME; it may use the PTP hardware clock")
    return warned(
        id,
        "CLOCK_REALTIME does not follow PTP: UTC stamps differ between machines",
        "sudo phc2sys -a -r -r",
    )


def _grandmaster_clock(id: str, is_set: bool) -> Check:
    """Return the check of phc2sys on a grandmaster.

    Args:
        id: name of the check.
        is_set: True if phc2sys sets CLOCK_REALTIME.
    """
    if is_set:
        return failed(
            id,
            "phc2sys sets CLOCK_REALTIME from the card of the grandmaster, which has no source",
            "sudo phc2sys -a -r -r, which copies CLOCK_REALTIME to the card of a grandmaster",
        )
    return passed(id, "this machine is the grandmaster; CLOCK_REALTIME does not follow PTP")


def tai(machine: Machine) -> Check:
    id = "clock-tai"
    if machine.clock is None:
        return skipped(id, "the kernel does not report its clock")
    here = machine.clock.tai_offset
    ptp = None if machine.ptp is None else machine.ptp.utc_offset
    advice = "phc2sys sets it; without phc2sys: chrony with `leapsectz right/UTC`"
    if ptp is not None and ptp != here:
        return failed(id, f"CLOCK_TAI is UTC {here:+d} s, but PTP reports {ptp:+d} s", advice)
    if here == 0:
        return warned(id, "CLOCK_TAI equals UTC: no program has set its offset", advice)
    return passed(id, f"CLOCK_TAI is UTC {here:+d} s")


def uses_ptp(machine: Machine) -> bool:
    """Return True if ptp4l runs on the machine."""
    return "ptp4l" in machine.processes


def _is_grandmaster(machine: Machine) -> bool:
    """Return True if ptp4l reports that all its ports are masters."""
    state = machine.ptp
    return state is not None and all(port in ("MASTER", "GRAND_MASTER") for port in state.ports)


def _ptp_setters(machine: Machine) -> list[str]:
    """Return the programs of linuxptp that set CLOCK_REALTIME."""
    commands = machine.commands
    found = []
    is_master = _is_grandmaster(machine)
    if any(_phc2sys_sets_realtime(words, is_master) for words in commands.get("phc2sys", ())):
        found.append("phc2sys")
    if any("-S" in words for words in commands.get("ptp4l", ())):
        found.append("ptp4l")
    return found


def _phc2sys_sets_realtime(words: tuple[str, ...], is_grandmaster: bool) -> bool:
    """Return True if phc2sys sets CLOCK_REALTIME.

    Args:
        words: command line of phc2sys.
        is_grandmaster: True if the machine is the grandmaster. The automatic mode with `-r -r` then
            reads CLOCK_REALTIME.
    """
    if "ntpshm" in words:  # its times go to another daemon
        return False
    if "-a" in words or any(word.startswith("-ar") for word in words):
        count = sum(word.count("r") for word in words if re.fullmatch("-a?r+", word))
        return count == 1 or (count > 1 and not is_grandmaster)
    options = dict(pairwise(words))
    return options.get("-s") != "CLOCK_REALTIME" and options.get("-c", "CLOCK_REALTIME") == (
        "CLOCK_REALTIME"
    )


CHECKS = (synchronisation, system_clock, tai)
