"""A loop on a network interface that loses its link, as with a pulled cable."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from catenary.errors import LinkError, WorkingCounterError
from catenary.link import Interface
from catenary.realtime.private_network import await_carrier
from catenary.virtual import Coupler, DigitalOutputs, Segment, Server

PERIOD = 5e-3
PATIENCE = 20.0  # [s] deadline of every wait; no duration is asserted


@pytest.fixture
def segment() -> Segment:
    return Segment([Coupler(), DigitalOutputs(serial=1)], clock="monotonic")


@pytest.fixture
def server(veth: tuple[str, str], segment: Segment) -> Iterator[Server]:
    with Server(segment, veth[1], max_age=None) as server:
        yield server


def iterate_until(loop: cat.Loop, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    for _ in loop:
        if condition():
            return
        assert time.monotonic() < deadline, "it did not happen"


def pull(veth: tuple[str, str], server: Server) -> None:
    subprocess.run(["ip", "link", "set", veth[1], "down"], check=True)
    assert server.wait(PATIENCE)  # its interface is down


def test_optional_devices_alone_come_back_with_the_link(
    veth: tuple[str, str], segment: Segment, server: Server
) -> None:
    with cat.MainDevice(Interface(veth[0])) as main:
        lamps = cat.Outputs(main.scan()[1], required=False)
        with cat.Loop(lamps, period=PERIOD) as loop:
            iterate_until(loop, lambda: all(lamps.present))
            pull(veth, server)
            iterate_until(loop, lambda: not any(lamps.present))
            subprocess.run(["ip", "link", "set", veth[1], "up"], check=True)
            await_carrier(veth[0])
            with Server(segment, veth[1], max_age=None):
                iterate_until(loop, lambda: all(lamps.present))
                assert [device.state for device in segment] == [8, 8]


def test_optional_devices_alone_are_left_without_a_link(
    veth: tuple[str, str], server: Server
) -> None:
    with cat.MainDevice(Interface(veth[0])) as main:
        lamps = cat.Outputs(main.scan()[1], required=False)
        with cat.Loop(lamps, period=PERIOD) as loop:
            pull(veth, server)
            iterate_until(loop, lambda: not any(lamps.present))


def run_without_link(request: cat.Outputs, veth: tuple[str, str], server: Server) -> None:
    with cat.Loop(request, period=PERIOD) as loop:
        pull(veth, server)
        iterate_until(loop, lambda: False)


def test_a_required_device_ends_the_loop_and_the_note_names_the_link(
    veth: tuple[str, str], server: Server
) -> None:
    with cat.MainDevice(Interface(veth[0])) as main:
        lamps = cat.Outputs(main.scan()[1])
        with pytest.raises(WorkingCounterError, match="no device answers") as lost:
            run_without_link(lamps, veth, server)
        notes = getattr(lost.value, "__notes__", [])
        assert any(f"{veth[0]} has no link" in note for note in notes)
        with pytest.raises(LinkError, match="has no link"):
            main.scan()
