"""Force/torque sensor at analogue inputs of EtherCAT terminals, with a calibration matrix."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.sensors.calibration import Calibration
from catenary.sensors.ethercat import EtherCat, Field, LoopSource
from catenary.sensors.processing import Calibrate, Processed
from catenary.sensors.sensor import Channel

GAUGES = "gauges"


def analog_wrench(
    loop: LoopSource,
    fields: Sequence[str | Field],
    calibration: Calibration,
    *,
    errors: Sequence[str | Field] = (),
    limit: float | None = None,
    every: int = 1,
) -> Processed:
    """Return a sensor with the channels `force` [N] and `torque` [N·m].

    Args:
        loop: source with the share of the loop that reads the terminals.
        fields: fields of the analogue inputs, in the order of the columns of the matrix.
        calibration: matrix with six rows, (Fx, Fy, Fz, Tx, Ty, Tz), and the bias.
        errors: fields that are not 0 while an input must not be used, such as "Overrange".
        limit: largest valid amount of an input, in its unit; a larger one is saturated.
        every: n to use every n-th cycle.

    Raises:
        ValueError: a field is missing, or the matrix has another shape.
    """
    raw = Channel(GAUGES, "", (len(fields),))
    sensor = EtherCat(loop, {raw: fields}, errors=errors, every=every)
    return Processed(sensor, [Calibrate(GAUGES, calibration, limit=limit)])
