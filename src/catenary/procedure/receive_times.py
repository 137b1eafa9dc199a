"""Receive times of one broadcast at the ports of all devices, ETG.1000.4 §6.8.2.

The times are in registers 0x0900 to 0x090F. Other clock registers are not changed.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.model.delays import PortTimes
from catenary.model.device import DeviceDescription
from catenary.procedure.exchange import Procedure, read, write
from catenary.wire.clock import decode_receive_times
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import RECEIVE_TIME_LATCH, RECEIVE_TIMES


def read_receive_times(
    devices: Sequence[DeviceDescription],
) -> Procedure[tuple[PortTimes | None, ...]]:
    """Latch and read the receive times of each device; None without a clock or an answer."""
    clocks = [device for device in devices if device.controller.supports_clocks]
    if not clocks:
        return (None,) * len(devices)
    [latched] = yield [write(EcatCommand.BWR, 0, RECEIVE_TIME_LATCH, 0)]
    replies = yield [read(EcatCommand.FPRD, each.station_address, RECEIVE_TIMES) for each in clocks]
    times: dict[int, PortTimes] = {}
    for device, reply in zip(clocks, replies, strict=True):
        if not (latched.lost or reply.lost) and reply.working_counter == 1:
            times[device.position] = decode_receive_times(reply.data)
    return tuple(times.get(device.position) for device in devices)
