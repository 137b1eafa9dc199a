"""The socket next to a share: over it, clients get the memory for their commands (SCM_RIGHTS).

The memory has no name, because whoever may write in a file can truncate it: the loop would get a
SIGBUS. The kernel checks the socket's permissions when a client connects. The client checks with
SO_PEERCRED which user answers. unix(7), memfd_create(2).
"""

from __future__ import annotations

import os
import socket
import struct
import threading
import time
from contextlib import suppress
from pathlib import Path

from catenary.errors import ShareError
from catenary.share.folder import draft_path

ANSWER = b"desk"
BACKLOG = 16
PATIENCE = 2.0  # [s]
RETRY = 0.1  # [s] after an accept that failed: the process has no descriptor left
PAUSE = 0.002  # [s] after each client; before a client tries again
CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: struct ucred


class DeskSocket:
    """Owns a listening socket, and the thread that sends a descriptor to each client."""

    def __init__(self, folder: Path, descriptor: int, mode: int) -> None:
        """Take over the descriptor. The socket gets its name and its thread by `publish`."""
        self._descriptor = descriptor
        self._ended = threading.Event()
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.path = draft_path(folder)
        self._thread = threading.Thread(target=self._serve, name="catenary-desk", daemon=True)
        try:
            self._listening.bind(str(self.path))
            self.path.chmod(mode)  # no client can connect before `listen`
            self._listening.listen(BACKLOG)
        except BaseException:
            self.close()
            raise

    def publish(self, under: Path) -> None:
        """Rename the socket. It replaces one that a killed process has left."""
        self.path.rename(under)
        self.path = under
        self._thread.start()

    def close(self) -> None:
        """Remove the name, then end the thread."""
        self._ended.set()
        self.path.unlink(missing_ok=True)
        with suppress(OSError):  # it never listened
            self._listening.shutdown(socket.SHUT_RDWR)  # wakes accept
        if self._thread.is_alive():
            self._thread.join(PATIENCE)
        if self._thread.is_alive():  # starved: it must not send a descriptor of this number
            return
        self._listening.close()
        os.close(self._descriptor)

    def _serve(self) -> None:
        from catenary.bus.thread_priority import step_behind  # readers of a share need no bus

        step_behind()
        while not self._ended.is_set():
            try:
                client, _ = self._listening.accept()
            except OSError:
                self._ended.wait(RETRY)
                continue
            with client, suppress(OSError):
                client.setblocking(False)  # a client that does not read causes no wait
                socket.send_fds(client, [ANSWER], [self._descriptor])
            self._ended.wait(PAUSE)  # clients that connect without end cost the loop little


def request_descriptor(path: Path, owner: int) -> int:
    """Return the descriptor that the socket sends; the caller owns it.

    Raises:
        FileNotFoundError, PermissionError: from the kernel.
        ShareError: no process answers, or one that is not of user `owner`.
    """
    flags = socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC
    with socket.socket(socket.AF_UNIX, flags) as asking:
        asking.settimeout(PATIENCE)
        try:
            _connect(asking, path)
            peer = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
            _, uid, _ = CREDENTIALS.unpack(peer)
            if uid != owner:
                raise ShareError(f"{path} is answered by user {uid}, its share is of user {owner}")
            flags = socket.MSG_CMSG_CLOEXEC
            _, descriptors, _, _ = socket.recv_fds(asking, len(ANSWER), 1, flags)
        except (FileNotFoundError, PermissionError):
            raise
        except OSError as error:  # refused, or timed out
            raise ShareError(f"{path} does not answer: {error.strerror or error}") from error
    if not descriptors:
        raise ShareError(f"{path} has sent no memory for commands")
    return descriptors[0]


def _connect(asking: socket.socket, path: Path) -> None:
    """Connect. While other clients fill the queue, the kernel refuses with EAGAIN: try again."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return asking.connect(str(path))
        except BlockingIOError:
            if time.monotonic() >= deadline:
                raise
        time.sleep(PAUSE)
