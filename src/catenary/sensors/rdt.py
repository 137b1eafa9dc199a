"""Force/torque sensors that send RDT by UDP, such as ATI's Net F/T.

The requests and records are those of ATI's RDT protocol, as in the ROS driver net_ft_driver by
G. Bartyzel. A request has 8 bytes and a record 36 bytes, both in network byte order. A datagram
contains one record or, in buffered mode, several.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Value
from catenary.sensors.sequence import SequenceCheck

PORT = 49152
REQUEST = struct.Struct(">HHI")  # header, command, number of samples (0: until a stop)
HEADER = 0x1234
STOP, START, SET_BIAS = 0x0000, 0x0002, 0x0042
RECORD = struct.Struct(">III6i")  # RDT sequence, F/T sequence, status, forces, torques
COUNTS = 1_000_000.0  # factory setting of "counts per force" and "counts per torque"
WORD = 1 << 32
NS = 1_000_000_000


class Rdt:
    """Decoder of an RDT stream: `force` [N], `torque` [N·m] and `status`.

    A record with a status other than 0 is invalid. A record that arrives after a later one is
    dropped and counted.

    Args:
        rate: "RDT output rate" of the box [Hz].
        counts_per_force: counts per newton, from the page "Configurations" of the box.
        counts_per_torque: counts per newton metre.
        sequence_rate: rate at which the F/T sequence counts [Hz], which then gives the times of
            the samples; None: the time of reception counts.
        set_bias: True: the box sets its software bias at the first start of this decoder. The
            sensor must be unloaded. A box that restarts loses its bias, which `Bias` does not.

    Raises:
        ValueError: a number is not positive.
    """

    def __init__(
        self,
        rate: float,
        *,
        counts_per_force: float = COUNTS,
        counts_per_torque: float = COUNTS,
        sequence_rate: float | None = None,
        set_bias: bool = False,
    ) -> None:
        numbers = (rate, counts_per_force, counts_per_torque, sequence_rate or 1.0)
        if not all(number > 0 for number in numbers):
            raise ValueError(f"{numbers}: rates and counts must be positive")
        self.rate = rate
        self.channels: Sequence[Channel] = (
            Channel("force", "N", (3,)),
            Channel("torque", "N·m", (3,)),
            Channel("status", dtype="<u4"),
        )
        self.clock: Clock = "device"
        self.counters = Counters()
        self._per_force, self._per_torque = counts_per_force, counts_per_torque
        self._sequence_rate, self._set_bias = sequence_rate, set_bias
        self._sequence = SequenceCheck(self.counters, WORD, first=1)
        self._ticks, self._last_tick = 0, 0

    def start(self) -> Sequence[bytes]:
        """Return the requests that start an endless stream."""
        self._sequence.restart()
        self._ticks = self._last_tick = 0
        bias = (request(SET_BIAS),) if self._set_bias else ()
        self._set_bias = False  # after a lost connection, the sensor may be loaded
        return (*bias, request(START))

    def stop(self) -> Sequence[bytes]:
        """Return the request that stops the stream."""
        return (request(STOP),)

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Decode one datagram.

        Args:
            data: the datagram.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        if len(data) % RECORD.size:
            self.counters.garbage += len(data)
            return []
        found = (self._sample(*record) for record in RECORD.iter_unpack(data))
        return [sample for sample in found if sample is not None]

    def _sample(self, sequence: int, tick: int, status: int, *counts: int) -> Sample | None:
        """Return the sample of a record; None if it is older than the last one.

        Args:
            sequence: RDT sequence number.
            tick: F/T sequence number.
            status: status of the box.
            counts: three forces and three torques.
        """
        if not self._sequence.accept(sequence):
            return None
        self.counters.samples += 1
        values: dict[str, Value] = {
            "force": [count / self._per_force for count in counts[:3]],
            "torque": [count / self._per_torque for count in counts[3:]],
            "status": status,
        }
        reason = f"the status of the force/torque sensor is {status:#010x}" if status else ""
        return Sample(self._time_ns(tick), values, not status, reason)

    def _time_ns(self, tick: int) -> int | None:
        if self._sequence_rate is None:
            return None
        step = (tick - self._last_tick) % WORD
        self._ticks += step if step < WORD // 2 else step - WORD
        self._last_tick = tick
        return round(self._ticks * NS / self._sequence_rate)


def request(command: int, samples: int = 0) -> bytes:
    """Return a request.

    Args:
        command: code of the command.
        samples: number of samples that the box sends; 0: until it receives STOP.
    """
    return REQUEST.pack(HEADER, command, samples)
