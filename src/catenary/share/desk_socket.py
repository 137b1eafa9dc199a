"""Socket of a share, over which clients receive the memory for their commands (SCM_RIGHTS).

The memory has no name, because a user with write access to a file can truncate it, and the loop
would then receive SIGBUS. The kernel checks the permissions of the socket when a client connects.
The client checks the user of the server with SO_PEERCRED. See unix(7) and memfd_create(2).
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
TIMEOUT = 2.0  # [s]
RETRY = 0.1  # [s] pause after a failed accept, for example if no descriptor is free
PAUSE = 0.002  # [s] after each client, and between the attempts of a client
CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: struct ucred


class DeskSocket:
    """Owner of a listening socket and of the thread that sends a descriptor to each client."""

    def __init__(self, folder: Path, descriptor: int, mode: int) -> None:
        """Create a listening socket at a draft path, and take ownership of the descriptor.

        `publish` names the socket and starts the thread.
        """
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
        """Rename the socket to `under`, and start the thread.

        It replaces the socket of a killed process.
        """
        self.path.rename(under)
        self.path = under
        self._thread.start()

    def close(self) -> None:
        """Remove the socket from its folder, end the thread, and close the descriptor.

        If the thread does not end within TIMEOUT, the socket and the descriptor stay open.
        """
        self._ended.set()
        self.path.unlink(missing_ok=True)
        with suppress(OSError):  # if the socket never listened
            self._listening.shutdown(socket.SHUT_RDWR)  # wake accept
        if self._thread.is_alive():
            self._thread.join(TIMEOUT)
        if self._thread.is_alive():
            return  # the thread is starved and could send a new descriptor with this number
        self._listening.close()
        os.close(self._descriptor)

    def _serve(self) -> None:
        from catenary.bus.thread_priority import step_behind  # a reader must not import bus

        step_behind()
        while not self._ended.is_set():
            try:
                client, _ = self._listening.accept()
            except OSError:
                self._ended.wait(RETRY)
                continue
            with client, suppress(OSError):
                client.setblocking(False)  # do not wait for a client that does not read
                socket.send_fds(client, [ANSWER], [self._descriptor])
            self._ended.wait(PAUSE)  # limit the load from clients that connect continuously


def request_descriptor(path: Path, owner: int) -> int:
    """Return the descriptor that the server of a socket sends. The caller owns it.

    Args:
        path: path of the socket.
        owner: expected user id of the server.

    Raises:
        FileNotFoundError: the socket does not exist.
        PermissionError: this user must not connect to the socket.
        ShareError: no process answers in time, or it belongs to another user or sends no
            descriptor.
    """
    flags = socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC
    with socket.socket(socket.AF_UNIX, flags) as connection:
        connection.settimeout(TIMEOUT)
        try:
            _connect(connection, path)
            peer = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
            _, uid, _ = CREDENTIALS.unpack(peer)
            if uid != owner:
                raise ShareError(
                    f"a process of user {uid} answers on {path}, but the share belongs to "
                    f"user {owner}"
                )
            flags = socket.MSG_CMSG_CLOEXEC
            _, descriptors, _, _ = socket.recv_fds(connection, len(ANSWER), 1, flags)
        except (FileNotFoundError, PermissionError):
            raise
        except OSError as error:  # refused, or timed out
            raise ShareError(f"{path} does not answer: {error.strerror or error}") from error
    if not descriptors:
        raise ShareError(f"the process that answers on {path} sent no memory for commands")
    return descriptors[0]


def _connect(connection: socket.socket, path: Path) -> None:
    """Connect, and retry while the queue is full: the kernel then returns EAGAIN."""
    deadline = time.monotonic() + TIMEOUT
    while True:
        try:
            return connection.connect(str(path))
        except BlockingIOError:
            if time.monotonic() >= deadline:
                raise
        time.sleep(PAUSE)
