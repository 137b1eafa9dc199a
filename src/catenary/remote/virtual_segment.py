"""Methods that manipulate the virtual segment of the loop's process."""

from __future__ import annotations

from catenary.errors import LoopError
from catenary.remote import messages
from catenary.remote.program import Program
from catenary.target import segment_of
from catenary.virtual import Segment


def virtual_cable(program: Program, position: int, port: int, connected: bool) -> messages.Done:
    """Pull or plug a cable; see `Client.virtual_cable`."""
    _segment(program).plug_port(position, port, connected)
    return messages.Done()


def virtual_power(program: Program, position: int, on: bool) -> messages.Done:
    """Switch a device on or off; see `Client.virtual_power`."""
    _segment(program).switch_power(position, on)
    return messages.Done()


def virtual_push(
    program: Program, body: str, force: list[float], point: list[float], seconds: float
) -> messages.Done:
    """Push a body of the simulated mechanism; see `Client.virtual_push`."""
    _segment(program).push(body, force, point=point, for_=seconds)
    return messages.Done()


def _segment(program: Program) -> Segment:
    segment = segment_of(program.network.main.source)
    if segment is None:
        raise LoopError(
            "the devices are not a virtual segment in the process of the loop",
            hint="use the target virtual or virtual-realtime",
        )
    return segment
