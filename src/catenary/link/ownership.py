"""Locks that allow one MainDevice per network interface, and detection of other masters.

A MainDevice holds an abstract Unix socket named after the interface. Such a name is
unique within a network namespace. The kernel releases it when the process ends, even by SIGKILL.
Masters without this lock are detected by their packet sockets or by their frames.

SOEM (oshw/linux/nicdrv.c) and IgH's generic driver (devices/generic.c) open a packet socket for
0x88A4 and bind it to the interface: /proc/net/packet lists it. A capture program requests
all protocols (0x0003) and does not count as a master.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

from catenary.errors import LinkError
from catenary.link._raw import RawLink
from catenary.link._ring import RingLink
from catenary.link.fork import forget_in_child
from catenary.link.interface import ETHERTYPE
from catenary.link.protocol import Link
from catenary.wire.frame import is_alien

NAME = "\0catenary/"  # start of a lock's name, before that of the interface; abstract, see unix(7)
WAITING = 4096  # backlog: programs that may query the owner of a lock; no connection is accepted
SETTLE_NS = 20_000_000  # time within which late answers to a master that has just ended arrive
WINDOW_NS, WINDOWS = 40_000_000, 2  # a live master sends frames in each
FRAMES = 256  # read per window: more than a receive ring holds

PACKETS = Path("/proc/thread-self/net/packet")  # sockets of this thread's namespace, packet(7)
HINT = (
    "end it first. force=True (--force) opens the interface anyway: two masters then disturb "
    "each other, and a scan stops the devices of both"
)
OWN_HINT = (
    "a MainDevice of this program has it open: call its close() first, as a with block does. In a "
    "notebook, close it before its cell runs again, or restart the kernel"
)


class Ownership:
    """Locks of the network interfaces that a link uses.

    `others` describes the evidence of other masters that `force` has overridden.
    """

    def __init__(self, link: Link, *, force: bool = False) -> None:
        """Lock the interfaces of a link. Unless `force`, listen for other masters for 0.1 s.

        Args:
            link: The link; a link without network interfaces needs no lock.
            force: True to continue although another master uses an interface.

        Raises:
            LinkError: Another master uses one of the interfaces, and `force` is False. Or a lock
                cannot be taken for another reason.
        """
        self._locks: list[socket.socket] = []
        forget_in_child(self)
        raws = raw_links(link)
        try:
            self.others = tuple(self._lock(raws, force)) or lasting_sockets(link)
            if force or not raws:
                return
            self.others = self.others or foreign_frames(raws)
        except BaseException:
            self.release()
            raise
        if self.others:
            self.release()
            raise _refused(self.others)

    def _lock(self, raws: Sequence[RawLink], force: bool) -> Iterator[str]:
        """Take the locks in the order of names. Yield the holder of each lock that is not free.

        Stop at the first of these unless `force` is True. The fixed order prevents two rings from
        refusing each other.
        """
        for raw in sorted(raws, key=lambda each: each.name):
            lock = locked(raw.name)
            if lock is not None:
                self._locks.append(lock)
                continue
            yield f"{holder(raw.name)} has {raw.name} open"
            if not force:
                return

    def forget(self) -> None:
        """Close the copies in a forked child."""
        self.release()

    def release(self) -> None:
        """Close this process's copies of the locks. A lock is free after all copies are closed."""
        while self._locks:
            self._locks.pop().close()


def _refused(others: Sequence[str]) -> LinkError:
    own = described(os.getpid())
    hint = OWN_HINT if any(each.startswith(own) for each in others) else HINT
    return LinkError(f"another EtherCAT master is live: {'; '.join(others)}", hint=hint)


def raw_links(link: Link) -> tuple[RawLink, ...]:
    """Return the raw links that a link is, wraps or consists of; () if there are none."""
    if isinstance(link, RawLink):
        return (link,)
    if isinstance(link, RingLink):
        return tuple(raw for each in link.links for raw in raw_links(each))
    inner = getattr(link, "link", None)
    return () if inner is None else raw_links(inner)


def locked(name: str) -> socket.socket | None:
    """Lock an interface. Return the lock, or None if another MainDevice holds it.

    Raises:
        LinkError: The lock cannot be taken for another reason.
    """
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        lock.bind(NAME + name)
        lock.listen(WAITING)  # from here on, `holder` can query its process
    except OSError as error:
        lock.close()
        if error.errno == errno.EADDRINUSE:
            return None
        raise LinkError(f"{name}: cannot take the lock of the interface: {error}") from error
    return lock


def holder(name: str) -> str:
    """Describe the process that holds the lock of an interface."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.setblocking(False)
        try:
            asking.connect(NAME + name)
            credentials = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
        except OSError:  # the lock was released, or its backlog is full
            return "a process that does not report its number"
    return described(struct.unpack("3i", credentials)[0])


def described(pid: int) -> str:
    """Describe a process: "PID 42 (python3)"."""
    if pid == 0:  # unix(7): a process of another PID namespace
        return "a process that is invisible here (another container or PID namespace)"
    if pid == os.getpid():
        return f"this process (PID {pid})"
    try:
        name = Path(f"/proc/{pid}/comm").read_text(errors="replace").strip()
    except OSError:
        return f"PID {pid}, which has ended: a child that it forked"
    return f"PID {pid} ({''.join(c if c.isprintable() else '?' for c in name)})"


def other_sockets(link: Link) -> tuple[str, ...]:
    """Describe the EtherCAT packet sockets on the interfaces of a link, except its own."""
    return tuple(
        f"{_holder_of_socket(inode)} has an EtherCAT packet socket on {raw.name}"
        for raw in raw_links(link)
        for inode in _others(raw)
    )


def lasting_sockets(link: Link) -> tuple[str, ...]:
    """Describe the sockets of `other_sockets` that are still open after 20 ms.

    A MainDevice opens its socket before it takes the lock, and closes it at once if the lock is not
    free. Without this wait, two MainDevices that open at the same time could refuse each other.
    """
    if not any(_others(raw) for raw in raw_links(link)):
        return ()
    _pause(raw_links(link)[0], SETTLE_NS)
    return other_sockets(link)


def _others(raw: RawLink) -> list[int]:
    own = os.fstat(raw.fileno()).st_ino
    return [inode for inode in _ethercat_sockets(raw.name) if inode != own]


def _ethercat_sockets(name: str) -> list[int]:
    """Return the inodes of the packet sockets for 0x88A4 that are bound to an interface."""
    try:
        interface = socket.if_nametoindex(name)
        rows = [line.split() for line in PACKETS.read_text().splitlines()[1:]]
    except OSError:  # the interface was removed, or a container without /proc
        return []
    # sk RefCnt Type Proto Iface R Rmem User Inode
    return [int(r[8]) for r in rows if int(r[3], 16) == ETHERTYPE and int(r[4]) == interface]


def _holder_of_socket(inode: int) -> str:
    """Describe the process that has a socket open, if this user may see it."""
    wanted = f"socket:[{inode}]"
    for folder in Path("/proc").glob("[0-9]*/fd"):
        with contextlib.suppress(OSError):  # it has ended, or belongs to another user
            if wanted in map(_target, os.scandir(folder)):
                return described(int(folder.parent.name))
    return "a process that is invisible here, or the kernel's EtherCAT master,"


def _target(entry: os.DirEntry[str]) -> str:
    """Return the target of a descriptor; "" if it no longer exists."""
    try:
        return os.readlink(entry)
    except OSError:
        return ""


def foreign_frames(raws: Sequence[RawLink]) -> tuple[str, ...]:
    """Listen for 0.1 s. Describe the interfaces on which EtherCAT frames arrive.

    This process must not send meanwhile. The frames are discarded.
    One burst is not sufficient: late answers to a master that was just killed may still arrive.
    """
    _pause(raws[0], SETTLE_NS)
    active = {raw.name for raw in raws}
    for raw in raws:
        _receives(raw)
    for _ in range(WINDOWS):
        _pause(raws[0], WINDOW_NS)
        active &= {raw.name for raw in raws if _receives(raw)}
    return tuple(f"EtherCAT frames of another master arrive on {name}" for name in sorted(active))


def _pause(raw: RawLink, duration_ns: int) -> None:
    until = raw.now() + duration_ns
    while raw.now() < until:
        raw.wait_until(until, False)


def _receives(raw: RawLink) -> bool:
    """Read the frames that have arrived; return True if one of them is an EtherCAT frame."""
    active = False
    for _ in range(FRAMES):
        frame = raw.receive()
        if frame is None:
            break
        active = active or not is_alien(frame)
    return active
