"""TAP interface: Ethernet frames between the network stack of this machine and this program.

The interface is created beforehand, with the user's name, so that Python needs no privileges:

    sudo ip tuntap add dev cat0 mode tap user NAME
    sudo ip link set cat0 up
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import getpass
import os
import select
import socket
import struct
import threading
from typing import Self

from catenary.errors import TapError
from catenary.link.fork import forget_in_child
from catenary.link.interface import IFF_UP, SIOCGIFFLAGS

DEVICE = "/dev/net/tun"
TUNSETIFF = 0x400454CA
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
READ_SIZE = 1 << 16  # [bytes], more than any frame
NAME_MAX = 15


class Tap:
    """An open TAP interface. Frames contain no checksum."""

    def __init__(self, name: str) -> None:
        """Attach to an existing interface.

        Args:
            name: Name of the interface, such as "cat0".

        Raises:
            TapError: The interface does not exist, is not a TAP, is down, is in use, or belongs to
                another user.
            ValueError: The name cannot be that of an interface.
        """
        if not 1 <= len(name.encode()) <= NAME_MAX or "/" in name:
            raise ValueError(f"{name!r} cannot be the name of an interface")
        self.name = name
        _check_interface(name)
        self._file = _open_device()
        try:
            _attach(self._file, name)
        except BaseException:
            os.close(self._file)
            raise
        self._woken, self._waker = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._poll = select.poll()
        for descriptor in (self._file, self._woken):
            self._poll.register(descriptor, select.POLLIN)
        self._is_open = True
        # A thread may still write while another one closes. A closed descriptor may already belong
        # to another file.
        self._lock = threading.Lock()
        forget_in_child(self)

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for a frame, and return True if there is one. `wake` ends the wait.

        Args:
            seconds: Longest time [s]; None: no limit.
        """
        found = self._poll.poll(None if seconds is None else seconds * 1e3)
        return any(descriptor == self._file for descriptor, _ in found)

    def wake(self) -> None:
        """End the present or the next call of `wait`. Any thread may call it.

        No effect if it is detached.
        """
        with self._lock, contextlib.suppress(BlockingIOError):
            if self._is_open:
                os.write(self._waker, b"\0")

    def read(self) -> bytes | None:
        """Return the next frame; None if there is none, or if the interface is down.

        Raises:
            TapError: The interface was deleted.
        """
        try:
            return os.read(self._file, READ_SIZE)
        except OSError as error:
            if error.errno != errno.EBADFD:
                return None  # EAGAIN; EIO: the interface was set down
            raise TapError(
                f"the interface {self.name} was deleted",
                hint="create it, and connect again",
            ) from error

    def write(self, frame: bytes) -> bool:
        """Give a frame to the network stack. Return False if it was dropped.

        Any thread may call it, also after `close`.
        """
        with self._lock:
            try:
                return self._is_open and os.write(self._file, frame) == len(frame)
            except OSError:
                return False  # EIO: the interface is down; EINVAL: not a frame; ENOBUFS

    def close(self) -> None:
        """Detach from the interface, which continues to exist. No effect if it is detached."""
        with self._lock:
            if not self._is_open:
                return
            self._is_open = False
            for descriptor in (self._file, self._woken, self._waker):
                os.close(descriptor)

    def forget(self) -> None:
        """Close the copies of a forked child, so that the TAP is free when the parent ends."""
        self._lock = threading.Lock()  # another thread of the parent may have held it
        self.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()


def _check_interface(name: str) -> None:
    """Raise TapError if the interface does not exist, or is down."""
    create = f"sudo ip tuntap add dev {name} mode tap user {_user()} && sudo ip link set {name} up"
    request = struct.pack("16s24x", name.encode())  # struct ifreq
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        try:
            flags = fcntl.ioctl(asking, SIOCGIFFLAGS, request)
        except OSError as error:
            raise TapError(f"the interface {name} does not exist", hint=create) from error
    (bits,) = struct.unpack_from("=H", flags, 16)
    if not bits & IFF_UP:
        raise TapError(f"the interface {name} is down", hint=f"sudo ip link set {name} up")


def _open_device() -> int:
    try:
        return os.open(DEVICE, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError as error:
        raise TapError(
            f"{DEVICE} does not exist: this kernel or container has no TAP interfaces",
            hint="sudo modprobe tun; in a container, add the device: --device /dev/net/tun",
        ) from error
    except OSError as error:
        raise TapError(
            f"{DEVICE} cannot be opened: {error.strerror}",
            hint=f"ls -l {DEVICE}: the usual mode is 0666; sudo chmod 0666 {DEVICE}",
        ) from error


def _attach(file: int, name: str) -> None:
    request = struct.pack("16sH22x", name.encode(), IFF_TAP | IFF_NO_PI)
    try:
        fcntl.ioctl(file, TUNSETIFF, request)
    except OSError as error:
        raise _attach_error(name, error) from error


def _attach_error(name: str, error: OSError) -> TapError:
    again = (
        f"sudo ip tuntap del dev {name} mode tap; "
        f"sudo ip tuntap add dev {name} mode tap user {_user()}"
    )
    if error.errno == errno.EBUSY:
        return TapError(
            f"the TAP interface {name} is already in use",
            hint="end the other program, or give it a TAP of its own; several devices share one "
            "TAP with main.eoe.connect",
        )
    if error.errno == errno.EPERM:
        return TapError(f"the TAP interface {name} belongs to another user", hint=again)
    if error.errno == errno.EINVAL:
        return TapError(
            f"{name} is not a TAP interface with one queue",
            hint=f"`ip -d link show {name}` shows its kind; create a TAP with another name",
        )
    return TapError(f"the TAP interface {name} cannot be used: {error.strerror}", hint=again)


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "NAME"
