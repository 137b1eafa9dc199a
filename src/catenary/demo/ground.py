"""Segment of the demo, on a network interface or in this process.

`python -m catenary.demo.ground NIC` is the process that serves it on an interface. If the machine
does not permit a private network, the segment runs in this process.
"""

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
PRIORITY = 80  # as high as the loop's: real devices do not wait for their MainDevice


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
            raise LinkError(
                "the virtual segment did not start: its process ended, or did not answer within "
                f"{START_SECONDS:g} s",
                hint="see the message of the process above, if there is one",
            )
        yield Ground(Interface(ours), "veth")


def main(interface: str) -> None:
    """Serve the segment in this process, on the other end of the interface pair."""
    serve_at_priority(demo_segment(clock="monotonic"), interface, PRIORITY)


if __name__ == "__main__":
    main(sys.argv[1])
