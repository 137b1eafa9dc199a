"""DL status of all devices, read in shared frames, ETG.1000.4 §6.2.

As in `survey`, a missing reply is not an error.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.procedure.exchange import Procedure, read
from catenary.procedure.station import Station
from catenary.wire.datagram import EcatCommand
from catenary.wire.dl import DlStatus
from catenary.wire.register import DL_STATUS


def read_port_status(stations: Sequence[Station]) -> Procedure[list[DlStatus | None]]:
    """Read the DL status of all devices; None for a device that did not answer."""
    replies = yield [read(EcatCommand.FPRD, station.address, DL_STATUS) for station in stations]
    return [
        None
        if reply.lost or reply.working_counter == 0
        else DlStatus.from_word(DL_STATUS.unpack(reply.data))
        for reply in replies
    ]
