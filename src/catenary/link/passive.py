"""Passive packet socket: the EtherCAT frames of an interface, in both directions, without sending.

The socket requests all protocols (ETH_P_ALL, packet(7)). Only such a socket receives the frames
that other programs send. A filter in the kernel discards all frames that are not EtherCAT
(ETG.1000.4 §5.2: EtherType 0x88A4, or UDP port 0x88A4). /proc/net/packet lists it with protocol
0x0003, and not with 0x88A4. For this reason, `link/ownership.py` does not count it as a master.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import select
import socket
import struct
import time
from types import TracebackType
from typing import NamedTuple, Self

from catenary.errors import LinkError
from catenary.interpreter import permission_advice
from catenary.link.interface import ETHERTYPE, SOL_PACKET, check
from catenary.wire.pcapng import Direction, Packet

ETH_P_ALL = 0x0003
PACKET_STATISTICS, PACKET_AUXDATA = 6, 8  # linux/if_packet.h
VLAN_VALID, VLAN_TYPE_VALID = 0x10, 0x40  # status of `struct tpacket_auxdata`
SO_ATTACH_FILTER, SO_RCVBUFFORCE, SO_TIMESTAMPNS = 26, 33, 35  # asm-generic/socket.h
RECEIVE_BUFFER = 16 * 1024 * 1024  # about 4 s of the frames of three drives at 1 kHz
FRAME_SIZE, CONTROL_SIZE = 2048, 128
BATCH = 256  # frames of one `receive`, so that its time is bounded

VLAN_TYPES = (0x8100, 0x88A8)  # IEEE 802.1Q, 802.1ad
IPV4, UDP = 0x0800, 17
LOAD_HALF, LOAD_BYTE, EQUAL, RETURN = 0x28, 0x30, 0x15, 0x06  # linux/bpf_common.h
PASS = 0x40000


class Instruction(NamedTuple):
    """Instruction of a classic BPF program (`struct sock_filter`)."""

    code: int
    true: int  # instructions to skip if the comparison is true
    false: int
    value: int


FILTER = (
    Instruction(LOAD_HALF, 0, 0, 12),  # 0: EtherType
    Instruction(EQUAL, 10, 0, ETHERTYPE),
    Instruction(EQUAL, 6, 0, VLAN_TYPES[0]),
    Instruction(EQUAL, 5, 0, VLAN_TYPES[1]),
    Instruction(EQUAL, 0, 6, IPV4),
    Instruction(LOAD_BYTE, 0, 0, 23),  # protocol of IPv4
    Instruction(EQUAL, 0, 4, UDP),
    Instruction(LOAD_HALF, 0, 0, 36),  # destination port; IPv4 without options
    Instruction(EQUAL, 3, 2, ETHERTYPE),
    Instruction(LOAD_HALF, 0, 0, 16),  # 9: EtherType after a VLAN tag
    Instruction(EQUAL, 1, 0, ETHERTYPE),
    Instruction(RETURN, 0, 0, 0),
    Instruction(RETURN, 0, 0, PASS),
)


class PassiveSocket:
    """Owner of a packet socket that receives EtherCAT frames and never sends.

        with PassiveSocket("eth0") as link:
            while link.wait(0.2):
                packets = link.receive()

    Raises:
        LinkError: The interface is unknown, down or not Ethernet, or permission is missing.
    """

    def __init__(self, name: str) -> None:
        check(name)
        self.name = name
        self._socket = open_all_protocols(name)
        self._dropped = 0
        try:
            prepare(self._socket)
            self._socket.bind((name, ETH_P_ALL))
            self._number = socket.if_nametoindex(name)
        except OSError as error:
            self._socket.close()
            raise LinkError(f"cannot bind a socket to {name}: {error.strerror}") from error

    def wait(self, timeout: float) -> bool:
        """Wait for a frame. Return True if `receive` returns at once with a result.

        Args:
            timeout: Longest wait [s].
        """
        return bool(select.select([self._socket], [], [], timeout)[0])

    def receive(self) -> list[Packet]:
        """Return the frames that have arrived, at most `BATCH`. The call does not wait.

        Raises:
            LinkError: The interface was removed, or the socket failed.
        """
        packets: list[Packet] = []
        while len(packets) < BATCH:
            try:
                data, controls, _, address = self._socket.recvmsg(FRAME_SIZE, CONTROL_SIZE)
            except BlockingIOError:
                break
            except OSError as error:
                if packets:
                    break  # they are kept; a later call raises the error
                if error.errno != errno.ENETDOWN:
                    raise LinkError(f"cannot receive on {self.name}: {error.strerror}") from error
                self.require_interface()
                break
            packets.append(made_packet(data, controls, address[2]))
        return packets

    def require_interface(self) -> None:
        """Raise LinkError if the interface was removed. The socket then receives nothing.

        An interface that is only down may come up again.
        """
        with contextlib.suppress(OSError):
            if socket.if_nametoindex(self.name) == self._number:
                return
        raise LinkError(
            f"the network interface {self.name} was removed or renamed",
            hint="ip link; check the adapter and its driver",
        )

    @property
    def dropped(self) -> int:
        """Number of EtherCAT frames that the kernel dropped because the socket was full."""
        counts = self._socket.getsockopt(SOL_PACKET, PACKET_STATISTICS, 8)
        self._dropped += struct.unpack("=II", counts)[1]  # the kernel resets it to 0
        return self._dropped

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def open_all_protocols(name: str) -> socket.socket:
    """Return a packet socket, which receives no frames until it is bound.

    Raises:
        LinkError: Permission is missing.
    """
    try:
        return socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    except PermissionError as error:
        raise LinkError(
            f"{name}: no permission for raw Ethernet frames (CAP_NET_RAW)",
            hint=permission_advice(),
        ) from error


def prepare(opened: socket.socket) -> None:
    """Attach the filter, request time stamps in ns and VLAN tags, and enlarge the buffer."""
    opened.setblocking(False)
    code = b"".join(struct.pack("=HBBI", *each) for each in FILTER)
    program = ctypes.create_string_buffer(code, len(code))  # the kernel copies it
    header = struct.pack("@HP", len(FILTER), ctypes.addressof(program))  # struct sock_fprog
    opened.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, header)
    opened.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    opened.setsockopt(SOL_PACKET, PACKET_AUXDATA, 1)
    try:
        opened.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER)
    except PermissionError:  # CAP_NET_ADMIN is missing: net.core.rmem_max limits the size
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)


def made_packet(data: bytes, controls: list[tuple[int, int, bytes]], kind: int) -> Packet:
    """Return a frame as a packet of a capture.

    Args:
        data: Bytes of the frame. The kernel removes the VLAN tag of a received frame.
        controls: Control messages of `recvmsg`: the time stamp and the VLAN tag.
        kind: Packet type of `sockaddr_ll`, packet(7).
    """
    direction = Direction.OUTBOUND if kind == socket.PACKET_OUTGOING else Direction.INBOUND
    time_ns = None
    for level, number, content in controls:
        if (level, number) == (socket.SOL_SOCKET, SO_TIMESTAMPNS):
            seconds, nanoseconds = struct.unpack_from("=qq", content)
            time_ns = seconds * 1_000_000_000 + nanoseconds
        elif (level, number) == (SOL_PACKET, PACKET_AUXDATA):
            data = data[:12] + vlan_tag(content) + data[12:]
    return Packet(time.time_ns() if time_ns is None else time_ns, data, direction=direction)


def vlan_tag(auxiliary: bytes) -> bytes:
    """Return the removed VLAN tag from a `struct tpacket_auxdata`; empty without a tag."""
    status, tag, kind = struct.unpack("=I12xHH", auxiliary)
    if not status & VLAN_VALID:
        return b""
    return struct.pack(">HH", kind if status & VLAN_TYPE_VALID else VLAN_TYPES[0], tag)
