"""Measurements of the loop on this machine: `catenary bench loop`, `latency` and `report`.

The folder `benchmarks/` of the repository compares the loop with other programs and with published
figures.

Call `enter_private_network` first. It may restart the program, which must not have started threads
before (NumPy starts some). All imports in this file are therefore inside functions.
"""

from __future__ import annotations


def enter_private_network() -> None:
    """Continue this program in its own network namespace.

    Raises:
        LinkError: This machine does not permit a private network.
    """
    from catenary.errors import LinkError
    from catenary.realtime import private_network

    state = private_network.enter()
    if isinstance(state, private_network.Refused):
        raise LinkError(
            f"the benchmark needs a private network: {state.reason}",
            hint="run it as root, or use `catenary bench latency`, which needs no network",
        )
