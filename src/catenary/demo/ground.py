"""Where the demo's segment lives: on a network interface, served by a process of its own
(`python -m catenary.demo.ground NIC`), or in this process where the machine allows no more."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from catenary.demo.server import serve_at_priority
from catenary.errors import LinkError
from catenary.link import Interface, LinkSource
from catenary.realtime.child import start_python
from catenary.realtime.private_network import veth_pair
from catenary.virtual import demo_segment

START_SECONDS = 20.0
PRIORITY = 80  # as the loop: devices do not wait for their MainDevice


@dataclass(frozen=True, slots=True)
class Ground:
    source: LinkSource
    link: Literal["veth", "in-process"]


@contextmanager
def ground(refused: str | None) -> Iterator[Ground]:
    if refused is not None:
        yield Ground(demo_segment(clock="monotonic"), "in-process")
        return
    with (
        veth_pair() as (ours, theirs),
        start_python(["-m", "catenary.demo.ground", theirs]) as server,
    ):
        if server.read_line(START_SECONDS) is None:
            raise LinkError("the virtual segment did not start", hint="its own message is above")
        yield Ground(Interface(ours), "veth")


def main(interface: str) -> None:
    """The other process: the segment behind the other end of the cable."""
    serve_at_priority(demo_segment(clock="monotonic"), interface, PRIORITY)


if __name__ == "__main__":
    main(sys.argv[1])
