"""Separate check of the inputs of each device."""

from __future__ import annotations

from catenary.procedure.exchange import Reply, Request
from catenary.procedure.process_data_check import probe_inputs
from catenary.wire.datagram import EcatCommand
from tests.procedure.player import play


def test_a_missing_input_is_distinguished_from_a_lost_frame() -> None:
    def answer(request: Request) -> Reply:
        assert request.command is EcatCommand.LRD
        counter = {0x10000: 1, 0x10010: 0, 0x10020: 0}[request.address]
        return Reply(request.data, counter, lost=request.address == 0x10020)

    areas = {1: (0x10000, 4), 3: (0x10010, 13), 4: (0x10020, 2)}
    assert play(probe_inputs(areas), answer) == (3,)


def test_no_devices() -> None:
    assert play(_empty(), lambda request: Reply(b"", 0)) == ()


def _empty():
    yield []
    return (yield from probe_inputs({}))
