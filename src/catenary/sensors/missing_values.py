"""Values of a sample without data."""

from __future__ import annotations

import math
from collections.abc import Sequence

from catenary.sensors.sensor import Channel, Value


def missing_values(channels: Sequence[Channel]) -> dict[str, Value]:
    """Return NaN for each channel of real numbers, and 0 for one of whole numbers."""
    return {each.name: missing_value(each) for each in channels}


def missing_value(channel: Channel) -> Value:
    """Return NaN, or 0 for a channel of whole numbers, in the shape of the channel."""
    number = math.nan if "f" in channel.dtype else 0
    return (number,) * channel.shape[0] if channel.shape else number
