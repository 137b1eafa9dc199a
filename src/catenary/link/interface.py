"""A network interface as a link source: checks before opening, and the AF_PACKET socket."""

from __future__ import annotations

import difflib
import errno
import fcntl
import socket
import struct
from dataclasses import dataclass

from catenary.errors import LinkError
from catenary.interpreter import permission_advice
from catenary.link._raw import RawLink
from catenary.link.fork import forget_in_child

ETHERTYPE = 0x88A4  # EtherCAT, ETG.1000.4 §5.2

# linux/if_packet.h; the socket module has no names for these
SOL_PACKET = 263
PACKET_RX_RING = 5
PACKET_VERSION = 10
PACKET_QDISC_BYPASS = 20
PACKET_IGNORE_OUTGOING = 23
TPACKET_V2 = 1

SIOCGIFFLAGS, SIOCGIFHWADDR = 0x8913, 0x8927  # linux/sockios.h
IFF_UP, IFF_RUNNING = 0x01, 0x40  # linux/if.h; running: it has a carrier
ARPHRD_ETHER, ARPHRD_LOOPBACK = 1, 772  # linux/if_arp.h

SLOT_SIZE = 2048  # header and one frame of 1514 bytes
BLOCK_SIZE = 64 * 1024
BLOCK_COUNT = 4  # 128 slots: 0.86 ms of the shortest frames at 100 Mbit/s


@dataclass(frozen=True, slots=True)
class Interface:
    """A network interface, selected by its name in `ip link`.

    `mapped_ring=False` receives frames by `recv`, which is slower; it is meant for comparisons.
    `visible=True` sends frames through the queue of the kernel. Other programs, such as tcpdump and
    `catenary capture record`, then also receive the sent frames. Each frame takes longer to send.
    """

    name: str
    mapped_ring: bool = True
    visible: bool = False

    def open_link(self) -> RawLink:
        """Open the raw link.

        Raises:
            LinkError: The interface is unknown, down or not Ethernet, permission is missing, or the
                kernel is older than 4.20.
            OSError: The receive ring cannot be mapped.
        """
        check(self.name)
        raw = open_socket(self.name, visible=self.visible)
        try:
            size, receive_path = request_ring(raw) if self.mapped_ring else (0, "recv (requested)")
            raw.bind((self.name, ETHERTYPE))
        except OSError as error:
            raw.close()
            raise LinkError(f"cannot bind a socket to {self.name}: {error.strerror}") from error
        except BaseException:
            raw.close()
            raise
        with raw:  # empty after the link has taken the descriptor
            link = RawLink(self.name, raw, size, SLOT_SIZE, receive_path)
        link.flush()
        forget_in_child(link)
        return link


def check(name: str) -> None:
    """Check that an interface can carry EtherCAT frames.

    Raises:
        LinkError: The interface is unknown, down or not Ethernet.
    """
    names = [known for _, known in socket.if_nameindex()]
    if name not in names:
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
        guess = f"did you mean {near[0]}? " if near else ""
        raise LinkError(
            f"there is no network interface {name!r}", hint=f"{guess}there are: {', '.join(names)}"
        )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        flags = ask(asking, SIOCGIFFLAGS, name)
        kind = ask(asking, SIOCGIFHWADDR, name)
    if kind not in (ARPHRD_ETHER, ARPHRD_LOOPBACK):
        raise LinkError(f"network interface {name} is not Ethernet (ARPHRD type {kind})")
    if not flags & IFF_UP:
        raise LinkError(f"network interface {name} is down", hint=f"sudo ip link set {name} up")


def no_link(name: str, number: int) -> LinkError | None:
    """Return the error for errno `number` if it means "no carrier"; None if it has another cause.

    Without a carrier, the kernel refuses frames with ENOBUFS ("No buffer space available").
    """
    if number != errno.ENOBUFS:
        return None
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
            flags = ask(asking, SIOCGIFFLAGS, name)
    except OSError:
        return None  # the interface was renamed or removed: keep the error of the kernel
    if flags & (IFF_UP | IFF_RUNNING) != IFF_UP:
        return None
    return LinkError(
        f"{name} has no link: the cable is unplugged or damaged, or the first device has no power",
        hint=f"check the link lights, and that {name} is the right port; `ip link show {name}` "
        "shows NO-CARRIER until there is a link. For a veth pair, also set the other end up",
    )


def ask(asking: socket.socket, request: int, name: str) -> int:
    """Return the 16 bits after the name in the answer to a SIOCGIF* request (`struct ifreq`)."""
    answer = fcntl.ioctl(asking, request, struct.pack("16s24x", name.encode()))
    return int(struct.unpack_from("=H", answer, 16)[0])


def open_socket(name: str, *, visible: bool = False) -> socket.socket:
    """Open an AF_PACKET socket, which receives no frames until it is bound.

    Args:
        name: Name of the interface, for errors.
        visible: True to send frames through the queue of the kernel, where other programs see them.

    Raises:
        LinkError: Permission is missing, or the kernel lacks a socket option.
    """
    try:
        opened = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    except PermissionError as error:
        raise LinkError(
            f"{name}: no permission for raw Ethernet frames", hint=permission_advice()
        ) from error
    try:
        opened.setblocking(False)
        opened.setsockopt(SOL_PACKET, PACKET_QDISC_BYPASS, not visible)
        # Otherwise, sent frames are also received and look like answers of an empty segment.
        opened.setsockopt(SOL_PACKET, PACKET_IGNORE_OUTGOING, 1)
    except OSError as error:
        opened.close()
        raise LinkError(
            f"{name}: this kernel lacks a socket option ({error.strerror})",
            hint="Linux 4.20 or newer is needed",
        ) from error
    return opened


def request_ring(opened: socket.socket) -> tuple[int, str]:
    """Request a receive ring.

    Returns:
        The size of the ring (0 if the kernel refuses it), and a description of the receive path.
    """
    size = BLOCK_SIZE * BLOCK_COUNT
    request = struct.pack("=4I", BLOCK_SIZE, BLOCK_COUNT, SLOT_SIZE, size // SLOT_SIZE)
    try:
        opened.setsockopt(SOL_PACKET, PACKET_VERSION, TPACKET_V2)
        opened.setsockopt(SOL_PACKET, PACKET_RX_RING, request)
        return size, "mapped ring"
    except OSError as error:
        return 0, f"recv (no mapped ring: {error.strerror})"
