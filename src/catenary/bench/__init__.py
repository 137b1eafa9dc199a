"""Measurements of this machine: `catenary bench loop`, `latency` and `report`.

Comparisons with other programs and with published figures are in `benchmarks/` of the repository.

`enter_private_network` comes first: it may run the program again, which NumPy's threads would
spoil. So nothing here imports anything before it is used.
"""

from __future__ import annotations


def enter_private_network() -> None:
    """Continue in a network namespace of its own.

    Raises:
        LinkError: this machine refuses one.
    """
    from catenary.errors import LinkError
    from catenary.realtime import private_network

    state = private_network.enter()
    if isinstance(state, private_network.Refused):
        raise LinkError(
            f"the benchmark needs a private network: {state.reason}",
            hint="run it as root; `catenary bench latency` needs none",
        )
