"""Comparison of the distributed clocks of a device with its ESI."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.esi.device import EsiDevice, EsiOpMode
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.model.device import DeviceDescription
from catenary.wire.sii import Sii
from catenary.wire.sii_categories import ClockMode

USE_ESI = "use the OpModes of the ESI"


def compare_clocks(
    description: DeviceDescription, esi: EsiDevice, sii: Sii
) -> Iterator[Difference]:
    """Yield the differences of the clock and of the OpModes.

    Args:
        description: The device, from a scan.
        esi: The ESI.
        sii: The SII of the device.
    """
    if esi.has_clock and not description.system_time:
        yield Difference(
            Severity.WARNING,
            Subject.CLOCK,
            "distributed clock",
            Sides("present", "missing (register 0x0910)"),
            esi.source,
            "the device cannot be synchronised, and its OpModes with SYNC signals fail",
            "check whether the ESI belongs to this hardware",
        )
    if not esi.op_modes or not sii.clock_modes:
        yield from _missing_category(esi, sii)
        return
    yield from _modes(esi, sii)


def _missing_category(esi: EsiDevice, sii: Sii) -> Iterator[Difference]:
    if not esi.op_modes:
        return  # without Dc in the ESI, there is nothing to compare with
    yield Difference(
        Severity.INFO,
        Subject.CLOCK,
        "OpModes",
        Sides(", ".join(mode.name for mode in esi.op_modes), "none"),
        esi.op_modes[0].source,
        "many vendors leave the OpModes out of the SII",
        USE_ESI,
    )


def _modes(esi: EsiDevice, sii: Sii) -> Iterator[Difference]:
    """Yield the modes that differ. A mode without a name is compared by its place."""
    named = {sii.string(mode.name): mode for mode in reversed(sii.clock_modes)}
    for number, mode in enumerate(esi.op_modes):
        found = named.get(mode.name)
        if found is None and number < len(sii.clock_modes):
            other = sii.clock_modes[number]
            found = other if not (mode.name and sii.string(other.name)) else None
        if found is None:
            yield Difference(
                Severity.WARNING,
                Subject.CLOCK,
                f"OpMode {mode.name!r}",
                Sides("present", "missing"),
                mode.source,
                "masters that use only the SII do not offer this mode",
                USE_ESI,
            )
            continue
        yield from _mode(mode, found)


def _mode(mode: EsiOpMode, found: ClockMode) -> Iterator[Difference]:
    facts = (
        ("AssignActivate 0x{:04X}", mode.assign_activate, found.assign_activate),
        ("SYNC0 cycle {} ns", mode.sync0_ns, found.cycle_time_ns),
        ("SYNC0 factor {}", mode.sync0_factor, found.sync0_factor),
        ("SYNC0 shift {} ns", mode.shift_ns, found.shift_time_ns),
        ("SYNC1 factor {}", mode.sync1_factor, found.sync1_factor),
        ("SYNC1 shift {} ns", mode.sync1_shift_ns, found.shift_time_1_ns),
    )
    unequal = [fact for fact in facts if fact[1] != fact[2]]
    if unequal:
        yield Difference(
            Severity.WARNING,
            Subject.CLOCK,
            f"OpMode {mode.name!r}",
            Sides(
                ", ".join(text.format(given) for text, given, _ in unequal),
                ", ".join(text.format(own) for text, _, own in unequal),
            ),
            mode.source,
            "SYNC signals at other times can make the device miss or repeat process data",
            "compare both with the manual of the device",
        )
