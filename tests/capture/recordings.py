"""Captures of Catenary's own bring-ups of a virtual segment, in virtual time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import catenary as cat
from catenary.errors import CatenaryError
from catenary.link import Recorder
from catenary.types import UDINT, UINT
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo, ServoQuirks

FOLLOWING_ERROR = cat.StartUp(0x6065, 0, 5000, type=UDINT)
WINDOW = cat.StartUp(0x6067, 0, 100, type=UDINT, before_mapping=True)
VENDOR = cat.StartUp(0x2110, 0, 77, type=UINT)
SYNC0 = cat.DistributedClock(sync0=1e-3, assign_activate=0x0300)
SYNC0_AND_1 = cat.DistributedClock(sync0=1e-3, sync1=0.0, assign_activate=0x0700)


def record(
    path: Path,
    *,
    start_up: Sequence[cat.StartUp] = (FOLLOWING_ERROR, WINDOW, VENDOR),
    clock: cat.DistributedClock | bool = False,
    quirks: ServoQuirks | None = None,
    outputs: int = 1,
    pdos: Mapping[int, list[tuple[int, int, int]]] | None = None,
) -> None:
    """Record a bring-up of a coupler, a servo and digital outputs. An error ends it early.

    Args:
        path: The capture.
        start_up: Start-up objects of the servo.
        clock: Distributed clock of the servo.
        quirks: Quirks of the servo.
        outputs: Number of digital output terminals.
        pdos: PDOs of the servo; None lets Catenary choose.
    """
    terminals = [DigitalOutputs(bits=8) for _ in range(outputs)]
    servo = Servo(quirks=quirks or ServoQuirks())
    segment = Segment([Coupler(), servo, *terminals], clock="virtual")
    with Recorder(segment, path) as link, suppress(CatenaryError), cat.MainDevice(link) as main:
        subs = main.scan()
        axes = cat.Drives(
            subs.drives,
            counts_per_turn=2**20,
            velocity_limit=1.0,
            dc=clock,
            start_up=start_up,
            pdos=pdos,
        )
        with cat.Loop(axes, period=1e-3) as loop:
            next(loop)
