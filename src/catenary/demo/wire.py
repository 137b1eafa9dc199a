"""Virtual segment from a file, served by another process on one end of an interface pair.

`python -m catenary.demo.wire NIC FILE` is this process.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from catenary.demo.server import serve_at_priority
from catenary.errors import LinkError
from catenary.link import Interface, LinkSource
from catenary.realtime.child import start_python
from catenary.realtime.private_network import Private, state, veth_pair
from catenary.virtual import read_segment

START_SECONDS = 20.0
PRIORITY = 80  # as high as a loop's: real devices do not wait for their MainDevice


@contextmanager
def on_a_wire(path: str | Path) -> Iterator[LinkSource]:
    """Yield a link to the virtual segment of a file, on the machine's clock.

    In a private network (`python -m catenary.realtime.private_network program.py`), another process
    serves the segment and the frames are real. Otherwise the segment runs in this process.
    """
    if not isinstance(state(), Private):
        yield read_segment(path, clock="monotonic")
        return
    with (
        veth_pair() as (ours, theirs),
        start_python(["-m", "catenary.demo.wire", theirs, str(path)]) as server,
    ):
        if server.read_line(START_SECONDS) is None:
            raise LinkError(
                "the virtual segment did not start: its process ended, or did not answer within "
                f"{START_SECONDS:g} s",
                hint="see the message of the process above, if there is one",
            )
        yield Interface(ours)


@contextmanager
def program_target(
    segment: str | Path, interface: str | None = None, *, realtime: bool
) -> Iterator[LinkSource | str]:
    """Yield the target of a program.

    Args:
        segment: File of a virtual segment, used if there is no interface.
        interface: Network interface; None to use the virtual segment.
        realtime: True to run the virtual segment on the machine's clock (see `on_a_wire`). False to
            yield the path of the file, for virtual time.
    """
    if interface or not realtime:
        yield interface or str(segment)
        return
    with on_a_wire(segment) as source:
        yield source


def main(interface: str, path: str) -> None:
    serve_at_priority(read_segment(path, clock="monotonic"), interface, PRIORITY)


if __name__ == "__main__":
    main(*sys.argv[1:])
