"""Programs that serve requests: loops of virtual segments with a share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import catenary as cat
from catenary.virtual import Segment
from catenary.virtual.devices import Coupler, DigitalOutputs, Servo
from tests.share.names import own_name

OPTIONS = {"counts_per_turn": 2**20, "velocity_limit": 1.0}


@dataclass
class Running:
    """A loop in the background, with its share."""

    name: str
    loop: cat.Loop
    arm: cat.Drives
    main: cat.MainDevice
    share: cat.Share


def small_segment() -> Segment:
    return Segment([Coupler(), Servo(), DigitalOutputs()])


@contextmanager
def program(
    *,
    background: bool = True,
    required: bool = True,
    jog: bool = True,
    segment: Segment | None = None,
    stop: cat.StopPolicy | None = None,
) -> Iterator[Running]:
    """Open a loop in virtual time with a share of a unique name."""
    with (
        own_name("remote") as name,
        cat.MainDevice(segment or small_segment()) as main,
        cat.Share(name, jog=jog) as share,
    ):
        main.scan()
        arm = cat.Drives(main.subs.drives, required=required, other_modes=["hm"], **OPTIONS)
        with cat.Loop(arm, period=1e-3, sink=share, stop=stop or cat.StopPolicy()) as loop:
            if background:
                loop.run_in_background()
            yield Running(name, loop, arm, main, share)
