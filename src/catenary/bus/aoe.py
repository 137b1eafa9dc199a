"""Aoe: ADS requests to one device, before and during a loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from catenary.bus.ads_notifications import (
    NOTIFICATIONS_KEPT,
    AdsNotifications,
    NotificationQueues,
    NotificationSource,
)
from catenary.bus.pending import Pending
from catenary.bus.protocol_channel import protocol_channel
from catenary.bus.sdo import MailboxOwner
from catenary.procedure.aoe import (
    ANSWER_TIMEOUT,
    DEVICE_PORT,
    AdsPeer,
    Place,
    answered_as,
    assign_net_id,
    own_net_id,
    read,
    request,
    write,
)
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.wire import ads
from catenary.wire.ads import Transmission
from catenary.wire.ads_response import (
    DeviceInfo,
    States,
    decode_device_info,
    decode_handle,
    decode_states,
)
from catenary.wire.aoe import net_id_of, net_id_text

T = TypeVar("T")


class Aoe:
    """ADS requests to one device (AoE).

    Example: `sub.aoe.read(0xF302, 0x1018_0001, 4)` reads object 0x1018:01 of many devices.

    `read`, `write` and `read_write` wait for the answer. While a loop runs, any thread except the
    iterating one may call them. The iterating thread uses `request`, `request_write` and
    `request_read_write`, which do not wait.
    """

    def __init__(self, sub: MailboxOwner, *, unavailable: str = "") -> None:
        """Initialise the access.

        Args:
            sub: The device.
            unavailable: Reason why the master does not offer AoE; empty if it does.
        """
        self._sub = sub
        self._unavailable = unavailable
        self._peer = AdsPeer(b"")
        self._assigned: bytes | None = None  # NetId that the program has chosen
        self._queues = NotificationQueues()

    @property
    def net_id(self) -> str:
        """NetId of the device, such as "127.0.0.1.16.1". Requests contain it."""
        return net_id_text(self._known_peer().net_id)

    def assign_net_id(self, net_id: str | None = None) -> None:
        """Write the NetId into the device, and use it from now on.

        Devices with the SSC also take the NetId from the first request after INIT.

        Args:
            net_id: The NetId; None: 127.0.0.1 and the station address.

        Raises:
            AdsError: The device refuses the NetId.
            ValueError: `net_id` is not a NetId.
        """
        chosen = None if net_id is None else net_id_of(net_id)
        peer = AdsPeer(chosen or self._own_net_id(), invoke_ids=self._peer.invoke_ids)
        self._sub.main.converse(assign_net_id(self._channel(), peer))
        self._assigned = chosen

    def read(
        self,
        group: int,
        offset: int,
        size: int,
        *,
        port: int = DEVICE_PORT,
        timeout: float = ANSWER_TIMEOUT,
    ) -> bytes:
        """Read data of the device.

        Args:
            group: Index group, 32 bits.
            offset: Index offset, 32 bits.
            size: Number of bytes to read. The device may send fewer.
            port: ADS port in the device; 0xFFFF is the device itself.
            timeout: Longest time until the device answers [s].

        Raises:
            AdsError: The device refuses the request.
            ResponseTimeout: The device does not answer.
            MailboxError: The device violates the protocol, or does not support AoE.
            ValueError: A value is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        return self._sub.main.converse(self._read(group, offset, size, None, port, timeout))

    def write(
        self,
        group: int,
        offset: int,
        data: bytes,
        *,
        port: int = DEVICE_PORT,
        timeout: float = ANSWER_TIMEOUT,
    ) -> None:
        """Write data to the device. The other arguments and the errors are those of `read`.

        Args:
            group: Index group, 32 bits.
            offset: Index offset, 32 bits.
            data: The data.
            port: ADS port in the device.
            timeout: Longest time until the device answers [s].
        """
        self._sub.main.converse(self._write(group, offset, data, port, timeout))

    def read_write(
        self,
        group: int,
        offset: int,
        size: int,
        data: bytes,
        *,
        port: int = DEVICE_PORT,
        timeout: float = ANSWER_TIMEOUT,
    ) -> bytes:
        """Write data and read the result in one request. The errors are those of `read`.

        Args:
            group: Index group, 32 bits.
            offset: Index offset, 32 bits.
            size: Number of bytes to read. The device may send fewer.
            data: Data to write.
            port: ADS port in the device.
            timeout: Longest time until the device answers [s].
        """
        return self._sub.main.converse(self._read(group, offset, size, data, port, timeout))

    def request(
        self, group: int, offset: int, size: int, *, port: int = DEVICE_PORT
    ) -> Pending[bytes]:
        """Read data while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` raises the error, if any. The arguments are those of `read`. Without a loop, the
        call waits for the answer.
        """
        asked = self._read(group, offset, size, None, port, ANSWER_TIMEOUT)
        return self._sub.main.request(asked)

    def request_write(
        self, group: int, offset: int, data: bytes, *, port: int = DEVICE_PORT
    ) -> Pending[None]:
        """Write data while a loop runs, without waiting, as `request` does."""
        return self._sub.main.request(self._write(group, offset, data, port, ANSWER_TIMEOUT))

    def request_read_write(
        self, group: int, offset: int, size: int, data: bytes, *, port: int = DEVICE_PORT
    ) -> Pending[bytes]:
        """Write data and read the result while a loop runs, without waiting, as `request` does."""
        asked = self._read(group, offset, size, data, port, ANSWER_TIMEOUT)
        return self._sub.main.request(asked)

    def device_info(self, *, port: int = DEVICE_PORT) -> DeviceInfo:
        """Read the name and the version of the ADS device. The errors are those of `read`."""
        asked = self._ask(ads.ReadDeviceInfo(), port)
        return self._decoded(asked, decode_device_info)

    def state(self, *, port: int = DEVICE_PORT) -> States:
        """Read the ADS state and the device state. The errors are those of `read`."""
        return self._decoded(self._ask(ads.ReadState(), port), decode_states)

    def write_control(
        self,
        ads_state: int,
        device_state: int = 0,
        data: bytes = b"",
        *,
        port: int = DEVICE_PORT,
    ) -> None:
        """Change the ADS state. The errors are those of `read`.

        Args:
            ads_state: The requested state, such as `AdsState.RUN` (5).
            device_state: State that the device defines.
            data: Further data that the device defines.
            port: ADS port in the device.
        """
        self._sub.main.converse(self._ask(ads.WriteControl(ads_state, device_state, data), port))

    def subscribe(
        self,
        group: int,
        offset: int,
        size: int,
        *,
        port: int = DEVICE_PORT,
        period: float = 0.1,
        on_change: bool = True,
        kept: int = NOTIFICATIONS_KEPT,
    ) -> AdsNotifications:
        """Request notifications of a value. `close` ends them; use `with`.

        Args:
            group: Index group, 32 bits.
            offset: Index offset, 32 bits.
            size: Size of the value [bytes].
            port: ADS port in the device.
            period: Time between two checks of the value in the device [s].
            on_change: True: only if the value has changed; False: after each period.
            kept: Number of samples that are stored; older ones are dropped and counted.

        Raises:
            AdsError: The device refuses the request.
            ResponseTimeout: The device does not answer.
            ValueError: A value is out of range.
        """
        if not 0 < period <= 400 or kept < 1:
            raise ValueError(f"a period of 0 to 400 s and a place are needed, not {period}, {kept}")
        mode = Transmission.ON_CHANGE if on_change else Transmission.CYCLIC
        cycle = round(period * 1e7)
        asked = self._ask(ads.AddNotification(group, offset, size, mode, 0, cycle), port)
        source = NotificationSource(self._sub, self._channel(), self._known_peer(), self._queues)
        self._queues.listen(source.channel)
        handle = answered_as(source.channel, decode_handle, asked)
        queue = self._sub.main.converse(self._queues.opened(handle, port, kept))
        return AdsNotifications(source, queue)

    def _decoded(self, asked: Procedure[bytes], decode: Callable[[bytes], T]) -> T:
        return self._sub.main.converse(answered_as(self._channel(), decode, asked))

    def _ask(self, asked: ads.Request, port: int) -> Procedure[bytes]:
        return request(self._channel(), self._known_peer(), asked, port)

    def _read(
        self, group: int, offset: int, size: int, data: bytes | None, port: int, timeout: float
    ) -> Procedure[bytes]:
        place, peer = Place(port, group, offset), self._known_peer()
        return read(self._channel(), peer, place, size, data=data, timeout=timeout)

    def _write(
        self, group: int, offset: int, data: bytes, port: int, timeout: float
    ) -> Procedure[None]:
        place = Place(port, group, offset)
        return write(self._channel(), self._known_peer(), place, bytes(data), timeout=timeout)

    def _known_peer(self) -> AdsPeer:
        self._peer.net_id = self._assigned or self._own_net_id()
        return self._peer

    def _own_net_id(self) -> bytes:
        return own_net_id(self._sub.station.address)

    def _channel(self) -> MailboxChannel:
        return protocol_channel(self._sub, "AoE", self._unavailable)
