"""Eoe: the Ethernet port of one device, before and during a loop."""

from __future__ import annotations

from ipaddress import IPv4Address, IPv4Interface
from typing import Protocol, TypeAlias

from catenary.bus.ethernet_bridge import EthernetBridge
from catenary.bus.pending import Pending
from catenary.bus.protocol_channel import usable_channel
from catenary.bus.sdo import Conversations, MailboxOwner
from catenary.errors import ConfigurationError, MailboxError
from catenary.procedure.eoe import (
    read_address,
    read_filter,
    room_to,
    write_address,
    write_filter,
)
from catenary.procedure.mailbox_channel import MailboxChannel
from catenary.wire.eoe import BLOCK, HEADER_SIZE
from catenary.wire.eoe_address import MAC_SIZE, NAME_SIZE, EthernetAddress, MacFilter
from catenary.wire.eoe_frames import fragment_room

Ip: TypeAlias = str | IPv4Address
Mac: TypeAlias = str | bytes


class TapConnector(Protocol):
    """Interface to the connections of a segment; `SegmentEoe` implements it."""

    def connect_position(self, tap: str, position: int) -> EthernetBridge: ...


class EthernetMain(Conversations, Protocol):
    """Interface to a MainDevice."""

    @property
    def eoe(self) -> TapConnector: ...


class EthernetOwner(MailboxOwner, Protocol):
    """Interface to the device of an Ethernet port."""

    @property
    def main(self) -> EthernetMain: ...

    @property
    def position(self) -> int: ...


class Eoe:
    """Ethernet port of one device (EoE).

        sub.eoe.set_address(ip="192.168.7.2/24")
        with sub.eoe.connect("cat0"):
            ...  # a browser on this machine reaches the device

    While a loop runs, any thread except the iterating one may call `address` and `set_address`. The
    iterating thread uses `request_address` and `request_set_address`, which do not wait.
    """

    def __init__(self, sub: EthernetOwner, *, unavailable: str = "") -> None:
        """Initialise the access.

        Args:
            sub: The device.
            unavailable: Reason why the master does not offer EoE; empty if it does.
        """
        self._sub = sub
        self._unavailable = unavailable

    def address(self, *, port: int = 0) -> EthernetAddress:
        """Read the addresses of the device. A field that the device does not report is None.

        Args:
            port: Port of the device; 0 if it has only one.

        Raises:
            EoeError: The device refuses the request.
            ResponseTimeout: The device does not answer.
            MailboxError: The device does not support EoE, or violates the protocol.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        return self._sub.main.converse(read_address(self.channel(), port=port))

    def set_address(
        self,
        *,
        ip: Ip | None = None,
        mask: Ip | None = None,
        gateway: Ip | None = None,
        dns: Ip | None = None,
        mac: Mac | None = None,
        name: str | None = None,
        port: int = 0,
    ) -> EthernetAddress:
        """Set addresses of the device, and return those that were sent.

        Addresses that are not given keep their values: if the standard requires them in front of a
        given one, they are first read from the device. Many devices use DHCP if only `mac` is set.

        Args:
            ip: IP address, such as "192.168.7.2", or with its mask: "192.168.7.2/24".
            mask: Mask of the subnet, such as "255.255.255.0".
            gateway: IP address of the gateway.
            dns: IP address of the name server.
            mac: MAC address, such as "02:00:00:00:00:01", or 6 bytes.
            name: Host name, up to 32 ASCII characters.
            port: Port of the device; 0 if it has only one.

        Raises:
            EoeError: The device refuses an address.
            ResponseTimeout: The device does not answer.
            MailboxError: The device does not support EoE, or violates the protocol.
            ValueError: An address is not valid, or none is given.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        chosen = make_address(ip, mask, gateway, dns, mac, name)
        return self._sub.main.converse(write_address(self.channel(), chosen, port=port))

    def request_address(self, *, port: int = 0) -> Pending[EthernetAddress]:
        """Read the addresses while a loop runs, without waiting: poll `done`, then call `result()`.

        The arguments and errors are those of `address`. Without a loop, the call waits.
        """
        return self._sub.main.request(read_address(self.channel(), port=port))

    def request_set_address(
        self,
        *,
        ip: Ip | None = None,
        mask: Ip | None = None,
        gateway: Ip | None = None,
        dns: Ip | None = None,
        mac: Mac | None = None,
        name: str | None = None,
        port: int = 0,
    ) -> Pending[EthernetAddress]:
        """Set addresses while a loop runs, without waiting: poll `done`, then call `result()`.

        The arguments and errors are those of `set_address`. Without a loop, the call waits.
        """
        chosen = make_address(ip, mask, gateway, dns, mac, name)
        return self._sub.main.request(write_address(self.channel(), chosen, port=port))

    def address_filter(self, *, port: int = 0) -> MacFilter:
        """Read the filter of destination addresses. The errors are those of `address`.

        Only devices with a switch have one.

        Args:
            port: Port of the device; 0 if it has only one.
        """
        return self._sub.main.converse(read_filter(self.channel(), port=port))

    def set_address_filter(self, filter: MacFilter, *, port: int = 0) -> None:
        """Set the filter of destination addresses. The errors are those of `set_address`.

        Args:
            filter: Addresses that the device lets pass.
            port: Port of the device; 0 if it has only one.
        """
        self._sub.main.converse(write_filter(self.channel(), filter, port=port))

    def connect(self, tap: str) -> EthernetBridge:
        """Connect a TAP interface of this machine to the device, in a `with` block.

        The TAP must exist: `sudo ip tuntap add dev cat0 mode tap user NAME`. Python then needs no
        privileges. Frames are sent and received in threads, before and during a loop, within the
        acyclic frames of the loop. For several devices and one TAP, use `main.eoe.connect`.

        Args:
            tap: Name of the TAP interface.

        Raises:
            TapError: The TAP does not exist, is down or in use, or belongs to another user.
            MailboxError: The device has no mailbox, or a mailbox that is too small.
        """
        return self._sub.main.eoe.connect_position(tap, self._sub.position)

    def channel(self) -> MailboxChannel:
        """Return the mailbox of the device, and check that it can be used for EoE.

        Raises:
            ConfigurationError: The master does not offer EoE, or the device is in BOOT.
            MailboxError: The device has no mailbox, or a mailbox that is too small.
        """
        station = self._sub.station
        in_boot = ConfigurationError(
            f"{station} is in BOOT, where it has no Ethernet port",
            hint='bring it to PRE-OP: sub.request_state("INIT"), then "PRE_OP"',
        )
        without = MailboxError(
            f"{station} has no mailbox: it cannot have an Ethernet port",
            hint="couplers and simple terminals have none",
        )
        channel = usable_channel(self._sub, self._unavailable, in_boot, without)
        if fragment_room(room_to(channel)) < BLOCK:
            raise MailboxError(
                f"{station}: EoE needs room for {HEADER_SIZE + BLOCK} bytes in a mailbox, it "
                f"has {room_to(channel)}"
            )
        return channel


def make_address(
    ip: Ip | None,
    mask: Ip | None,
    gateway: Ip | None,
    dns: Ip | None,
    mac: Mac | None,
    name: str | None,
) -> EthernetAddress:
    """Return an address from texts. Raises ValueError if one is not valid, or none is given.

    Args:
        ip: IP address, also with its mask, such as "192.168.7.2/24".
        mask: Mask of the subnet.
        gateway: IP address of the gateway.
        dns: IP address of the name server.
        mac: MAC address, as text or 6 bytes.
        name: Host name.
    """
    if isinstance(ip, str) and "/" in ip:
        if mask is not None:
            raise ValueError(f"the mask is given twice: {ip} and {mask}")
        both = IPv4Interface(ip)
        ip, mask = both.ip, both.netmask
    if name is not None and not (name.isascii() and len(name) <= NAME_SIZE):
        raise ValueError(f"the name {name!r} must have at most {NAME_SIZE} ASCII characters")
    found = EthernetAddress(_mac(mac), _ip(ip), _ip(mask), _ip(gateway), _ip(dns), name)
    if found == EthernetAddress():
        raise ValueError("no address is given: set ip, mask, gateway, dns, mac or name")
    return found


def _ip(value: Ip | None) -> IPv4Address | None:
    return None if value is None else IPv4Address(value)


def _mac(value: Mac | None) -> bytes | None:
    if value is None:
        return None
    try:
        data = value if isinstance(value, bytes) else bytes.fromhex(value.replace(":", " "))
    except ValueError:
        data = b""
    if len(data) != MAC_SIZE or data[0] & 1:
        raise ValueError(
            f"{value!r} is not the MAC address of one device, such as 02:00:00:00:00:01"
        )
    return data
