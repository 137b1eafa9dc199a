"""Gateway: access of vendors' tools to the devices of a MainDevice, over UDP and TCP."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Self

from catenary.bus import MainDevice, SubDevice
from catenary.errors import ConfigurationError
from catenary.gateway.limits import GatewayCounts
from catenary.gateway.policy import Policy
from catenary.gateway.reports import Reports
from catenary.gateway.router import Router
from catenary.gateway.service import Service
from catenary.gateway.sockets import checked_address, open_sockets
from catenary.wire.gateway import PORT


class Gateway:
    """EtherCAT mailbox gateway (ETG.8200): vendors' tools reach the devices over UDP and TCP.

        with cat.MainDevice("eth0") as main:
            main.scan()
            with cat.Gateway(main, write=[2]) as gateway:
                ...                                    # a loop, or nothing

    It works before, during and after a loop. Messages of tools use the acyclic frames of the loop,
    in turn with the transfers of the program. Clients run on this machine, or use an SSH tunnel.

    Without `write`, clients can read only. With `write`, accesses that are dangerous while an axis
    is enabled are refused during this time. docs/how_to/gateway.md lists them. Each write is an
    event `GatewayWrite`.

    Args:
        main: The MainDevice, after its `scan`.
        write: Devices, or their positions, to which clients may write.
        address: Address of the loopback interface.
        port: Port of UDP and TCP; 0 for any free one. Most tools expect 34980.

    Raises:
        ValueError: The address is not one of the loopback interface, or a position is negative.
    """

    def __init__(
        self,
        main: MainDevice,
        *,
        write: Iterable[int | SubDevice] = (),
        address: str = "127.0.0.1",
        port: int = PORT,
    ) -> None:
        self.counts = GatewayCounts()
        self._main = main
        self._writable = frozenset(_position(each) for each in write)
        self._address = checked_address(address)
        self._port = port
        self._service: Service | None = None
        self._router: Router | None = None

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def port(self) -> int:
        """Port of UDP and TCP."""
        return self._port

    @property
    def clients(self) -> tuple[str, ...]:
        """Present clients, such as "TCP 127.0.0.1:50000"."""
        return () if self._service is None else self._service.clients

    @property
    def writable(self) -> frozenset[int]:
        """Positions of the devices to which clients may write."""
        return self._writable

    def open(self) -> Self:
        """Start to listen, and return the gateway. No effect if it is open.

        Raises:
            ConfigurationError: The port is in use, or another master controls the devices.
            ValueError: There is no device at a position of `write`.
        """
        if self._service is not None:
            return self
        if self._main.carrier is not None:
            raise ConfigurationError(
                "the gateway is not available with another master",
                hint="use a network interface instead, such as eth0",
            )
        missing = sorted(each for each in self._writable if each >= len(self._main.subs))
        if missing:
            raise ValueError(
                f"write={missing}: the segment has {len(self._main.subs)} devices; scan it first"
            )
        sockets = open_sockets(self._address, self._port)
        self._port = sockets.port
        reports = Reports(self._main, self.counts)
        policy = Policy(self._main, self._writable)
        self._router = router = Router(self._main, policy, reports)
        self._service = Service(sockets, self.counts, router.receive, router.forget, router.sweep)
        reports.deliver = self._service.answer
        self._service.start()
        return self

    def close(self) -> None:
        """Disconnect all clients. Transfers that are under way end without an answer."""
        service, self._service = self._service, None
        if service is not None:
            service.close()
        if self._router is not None:
            self._router.close()


def _position(device: int | SubDevice) -> int:
    position = device if isinstance(device, int) else device.position
    if position < 0:
        raise ValueError(f"write: position {position} is negative; 0 is the first device")
    return position
