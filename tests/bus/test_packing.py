"""Requests that share frames."""

from __future__ import annotations

from catenary.bus.packing import batches
from catenary.procedure.exchange import read
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import AL_STATUS

SHARES = read(EcatCommand.FPRD, 0x1001, AL_STATUS)
ALONE = SHARES._replace(alone=True)


def test_small_requests_share_a_frame() -> None:
    assert batches([SHARES] * 5) == [[0, 1, 2, 3, 4]]


def test_a_request_marked_as_alone_gets_its_own_frame() -> None:
    assert batches([SHARES, ALONE, ALONE, SHARES, SHARES]) == [[0], [1], [2], [3, 4]]
