"""Measurements of this machine: `catenary bench loop`, `latency` and `report`.

Comparisons with other programs and with published figures are in `benchmarks/` of the repository.

Call `enter_private_network` first. It may restart the program, which must not have threads (NumPy)
at that time. Therefore all imports here are inside functions.
"""

from __future__ import annotations


def enter_private_network() -> None:
    """Continue this program in its own network namespace.

    Raises:
        LinkError: This machine does not permit one.
    """
    from catenary.errors import LinkError
    from catenary.realtime import private_network

    state = private_network.enter()
    if isinstance(state, private_network.Refused):
        raise LinkError(
            f"the benchmark needs a private network: {state.reason}",
            hint="run it as root, or use `catenary bench latency`, which needs no network",
        )
