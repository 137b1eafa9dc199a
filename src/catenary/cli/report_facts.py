"""Facts about this machine for a report: processor, kernel, network cards and versions."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from catenary import __version__

PACKAGES = ("numpy", "msgspec", "numba")
CPUS = Path("/sys/devices/system/cpu")
BOARD = Path("/sys/class/dmi/id")
MEGABYTE = 1_000_000


def machine_facts(nics: Sequence[str]) -> dict[str, object]:
    """Return the facts about this machine that affect a loop.

    Args:
        nics: Network interfaces of the segment.
    """
    from catenary.bench.report import preemption, processor

    return {
        "computer": " ".join(_first_lines(BOARD / "sys_vendor", BOARD / "product_name")),
        "processor": processor(),
        "architecture": platform.machine(),
        "cpus": os.cpu_count(),
        "isolated_cpus": " ".join(_first_lines(CPUS / "isolated")),
        "memory_mb": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // MEGABYTE,
        "kernel": f"{platform.release()} {preemption()}",
        "distribution": distribution(),
        "network_cards": [card_facts(nic) for nic in nics],
    }


def versions() -> dict[str, str]:
    """Return the versions of Python, the C library and the installed packages."""
    found = {
        "catenary": __version__,
        "python": platform.python_version(),
        "libc": " ".join(platform.libc_ver()),
    }
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # an optional package
            found[name] = "not installed"
    return found


def distribution() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return "unknown"


def card_facts(nic: str) -> dict[str, object]:
    """Return the driver, the bus and the speed of a network interface, but no address."""
    from catenary.doctor.ethtool import read_card

    try:
        card = read_card(nic)
    except OSError as error:
        return {"name": nic, "error": error.strerror or str(error)}
    link = card.link
    return {
        "name": nic,
        "driver": card.driver,
        "bus": card.bus,
        "speed_mbit": None if link is None else link.speed,
        "refused": dict(card.refusals),
    }


def _first_lines(*paths: Path) -> Iterator[str]:
    """Yield the first line of each file that can be read."""
    for path in paths:
        try:
            yield from path.read_text().splitlines()[:1]
        except OSError:  # not all machines have a table of the firmware
            continue
