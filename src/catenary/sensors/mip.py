"""Inertial sensors of MicroStrain with the MIP protocol.

    imu = Mip(["acceleration", "angular_velocity"], rate=500.0, generation=5, base_rate=1000.0)

The names and units of all fields are in `mip_fields.FIELDS`. Vectors are in the frame of the
device, or in its vehicle frame if one is configured. Quaternions are (w, x, y, z) and rotate
from this frame to north-east-down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from catenary.errors import DecodeError
from catenary.sensors import mip_commands as commands
from catenary.sensors.mip_fields import (
    FIELDS,
    SENSOR_DATA,
    TIMES,
    DeviceTime,
    decode_time,
    decode_values,
    make_channel,
)
from catenary.sensors.mip_packet import Packet, PacketSearch
from catenary.sensors.missing_values import missing_values
from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Value

DECIMATION_MAX = 0xFFFF
LOST_MAX = 10.0  # [s]; a longer step of the time is a new setting of the clock, not lost samples


class Mip:
    """Decoder of one data set of a device, and the messages that start its stream.

    A packet with the time and all fields is a sample. All fields have the same rate.

    Args:
        fields: names of fields of one data set, in the order of the packet.
        rate: samples per second [Hz]. It must divide `base_rate`.
        base_rate: base rate of the data set [Hz], from the manual of the device.
        generation: 5 for GX4, GX5, CV5 and RQ1; 7 for CV7, GV7 and GQ7.
        time: field with the time of the sample; None: the first that the generation has.

    Raises:
        ValueError: A field is unknown, the fields are of two data sets, or the rate does not
            divide the base rate.
    """

    clock: Clock = "device"

    def __init__(
        self,
        fields: Sequence[str],
        *,
        rate: float,
        base_rate: float = 1000.0,
        generation: Literal[5, 7] = 7,
        time: DeviceTime | None = None,
    ) -> None:
        data_set = one_data_set(fields)
        self._data_set, self._dialect = data_set, commands.DIALECTS[generation, data_set]
        self._time = time or first_time(generation, data_set)
        self._names = {FIELDS[name].descriptor: name for name in fields}
        self._base_rate, self._decimation = base_rate, decimation(base_rate, rate)
        self.rate = rate
        self.channels: Sequence[Channel] = [make_channel(name) for name in fields]
        self.counters = Counters()
        self._search = PacketSearch(self.counters)
        self._last_ns: int | None = None

    def start(self) -> list[bytes]:
        """Discard incomplete data. Return the messages that start the stream."""
        self._search.clear()
        self._last_ns = None
        descriptors = [TIMES[self._time], *self._names]
        return [
            commands.set_to_idle(),
            commands.read_base_rate(self._dialect),
            commands.write_message_format(self._dialect, descriptors, self._decimation),
            commands.control_data_stream(self._dialect, True),
            commands.resume(),
        ]

    def stop(self) -> list[bytes]:
        """Return the message that ends the stream."""
        return [commands.set_to_idle()]

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Decode bytes, and return the complete samples, oldest first.

        If the device refuses a command, or its base rate differs, one invalid sample reports it.

        Args:
            data: bytes of the stream.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        samples = []
        for packet in self._search.feed(data, received_ns):
            try:
                sample = self._decode(packet)
            except DecodeError:
                self.counters.bad_messages += 1
                continue
            if sample is not None:
                samples.append(sample)
        return samples

    def _decode(self, packet: Packet) -> Sample | None:
        """Return the sample of a packet; None if it does not concern the samples."""
        if packet.descriptor_set == self._data_set:
            return self._sample(packet)
        if packet.descriptor_set in (commands.BASE, commands.THREE_DM):
            refusal = self._refusal(packet)
            return Sample(None, missing_values(self.channels), False, refusal) if refusal else None
        return None

    def _sample(self, packet: Packet) -> Sample | None:
        found: dict[str, tuple[float, ...]] = {}
        reason, time_ns = "", None
        for descriptor, data in packet.fields:
            if descriptor == TIMES[self._time]:
                time_ns = decode_time(self._time, data)
            elif name := self._names.get(descriptor):
                found[name], is_valid = decode_values(FIELDS[name], data)
                reason = reason or ("" if is_valid else f"the device marks {name} as invalid")
        if not found:
            return None  # another packet of the data set, such as that of an event
        if time_ns is None or len(found) < len(self.channels):
            raise DecodeError("the packet does not have all fields of a sample")
        self.counters.samples += 1
        self._count_lost(time_ns)
        return Sample(time_ns, self._values(found), not reason, reason)

    def _values(self, found: Mapping[str, tuple[float, ...]]) -> dict[str, Value]:
        """Return the value of each channel: a number for a scalar."""
        return {
            each.name: found[each.name] if each.shape else found[each.name][0]
            for each in self.channels
        }

    def _refusal(self, packet: Packet) -> str:
        """Return why the device does not send as requested; empty if it does."""
        for reply in commands.replies(packet):
            if reply.result:
                return f"the device refused the command {reply.text}"
        rate = commands.base_rate_of(packet, self._dialect)
        if rate is not None and rate != self._base_rate:
            return f"the base rate of the device is {rate} Hz, not {self._base_rate:g} Hz"
        return ""

    def _count_lost(self, time_ns: int) -> None:
        """Count samples that are missing in the times of the device."""
        step = 0.0 if self._last_ns is None else (time_ns - self._last_ns) * 1e-9
        if 1.5 / self.rate < step < LOST_MAX:
            self.counters.lost += round(step * self.rate) - 1
        self._last_ns = time_ns


def one_data_set(names: Sequence[str]) -> int:
    """Return the data set of fields. Raises ValueError if they are unknown, or of two data sets."""
    if unknown := sorted(set(names) - FIELDS.keys()):
        raise ValueError(f"unknown MIP fields {unknown}; known are {sorted(FIELDS)}")
    sets = {FIELDS[name].descriptor_set for name in names}
    if len(sets) != 1 or len(set(names)) != len(names):
        raise ValueError(f"fields {names}: name each once, and only fields of one data set")
    return sets.pop()


def first_time(generation: int, data_set: int) -> DeviceTime:
    """Return the usual time field.

    Args:
        generation: generation of the device.
        data_set: descriptor set of the data.
    """
    if generation == 7:
        return "reference"
    return "gps" if data_set == SENSOR_DATA else "filter_gps"


def decimation(base_rate: float, rate: float) -> int:
    """Return the divisor of the base rate.

    Args:
        base_rate: base rate of the data set [Hz].
        rate: rate of a field [Hz].

    Raises:
        ValueError: The quotient is not a whole number from 1 to 65535.
    """
    quotient = base_rate / rate if rate > 0 else math.inf
    if not (1 <= quotient <= DECIMATION_MAX and quotient == round(quotient)):
        raise ValueError(f"rate={rate} Hz does not divide the base rate of {base_rate} Hz")
    return round(quotient)
