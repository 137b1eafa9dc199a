"""MainDevices of process-data requests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.bus import MainDevice, SubDevice
from catenary.plan.request import ProcessDataRequest

REQUESTS = "Drives, Inputs, Outputs, ProcessData or Copies"
PARTS = ("subs", "pdos", "tables", "bind")  # attributes of a LoopRequest


class LoopRequest(ProcessDataRequest, Protocol):
    """Process-data request that names its devices."""

    @property
    def subs(self) -> Sequence[SubDevice]: ...


def main_device_of(requests: Sequence[LoopRequest]) -> MainDevice:
    """Return the MainDevice that all requests share.

    Raises:
        TypeError: See `by_network`.
        ValueError: No request names a device, or the devices have several MainDevices.
    """
    [(main, _)] = by_network(requests)
    return main


def by_network(requests: Sequence[LoopRequest]) -> list[tuple[MainDevice, list[LoopRequest]]]:
    """Return the requests of each MainDevice, in the order of first use.

    Raises:
        TypeError: An object is not a process-data request, or a device has another kind of master.
        ValueError: No request names a device, or one names devices of several MainDevices.
    """
    networks: dict[int, tuple[MainDevice, list[LoopRequest]]] = {}
    for request in requests:
        check_request(request)
        mains = {id(sub.main): _main_of(sub) for sub in request.subs}
        if len(mains) > 1:
            raise ValueError(
                "a request names devices of several MainDevices: make one request for each of "
                "them, and pass all requests to the Loop"
            )
        for key, main in mains.items():
            networks.setdefault(key, (main, []))[1].append(request)
    if not networks:
        raise ValueError(f"a Loop needs a process-data request: {REQUESTS}")
    return list(networks.values())


def check_request(request: object) -> None:
    """Raise TypeError for an object that is not a process-data request, such as a SubDevice."""
    if isinstance(request, type) or not all(hasattr(request, name) for name in PARTS):
        raise TypeError(f"a Loop accepts process-data requests ({REQUESTS}), not {request!r}")


def _main_of(sub: SubDevice) -> MainDevice:
    """Return the MainDevice of a device; raise TypeError for another kind of master."""
    if not isinstance(sub.main, MainDevice):
        raise TypeError(f"{sub.station} belongs to a {type(sub.main).__name__}, not a MainDevice")
    return sub.main
