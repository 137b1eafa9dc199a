"""Client of the gripper's share: `python -m benchmarks.gripper_client SHARE`.

It stands for the published ROS node. At up to 500 Hz, it reads the states and sends references for
both axes under a lease. It ends with the loop.
"""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Sequence

import numpy as np

import catenary as cat
from catenary.errors import ShareError

PERIOD = 2e-3  # [s]
LEASE = 0.5  # [s]
AMPLITUDE, FREQUENCY = 0.2, 1.0  # [rad], [Hz] of the references


def run(share: str) -> None:
    with cat.attach(share) as gripper, gripper.lease(for_=LEASE) as command:
        home = np.array(gripper.read()["commanded_position"])
        begun = time.monotonic()
        while gripper.alive:
            now = gripper.read()
            if not np.isfinite(now["position"]).all():
                raise ValueError(f"a position of cycle {now['number']} is not finite")
            angle = 2 * math.pi * FREQUENCY * (time.monotonic() - begun)
            command.send(position=home + AMPLITUDE * math.sin(angle))
            time.sleep(PERIOD)


def main(arguments: Sequence[str]) -> None:
    with contextlib.suppress(ShareError):  # the loop has ended, and with it the lease
        run(arguments[0])


if __name__ == "__main__":
    main(sys.argv[1:])
