"""Listening socket of the remote service, and its connections. Nothing here blocks.

A connection belongs to one client process. The kernel checks the permissions of the socket when a
client connects (unix(7)).
"""

from __future__ import annotations

import os
import socket
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from catenary.remote.messages import MESSAGE_SIZE
from catenary.share.desk_socket import CREDENTIALS
from catenary.share.folder import draft_path

BACKLOG = 16
STALL_TIMEOUT = 2.0  # [s]
OUTBOX_MAX = 64  # messages
GROUP_WRITES, OTHERS_WRITE = 0o020, 0o002
KIND = socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC


class Peer(NamedTuple):
    """Process of a client."""

    pid: int
    uid: int
    gid: int

    def __str__(self) -> str:
        return f"process {self.pid} of user {self.uid}"


class Listener:
    """Owner of the listening socket, from a draft path to its removal."""

    def __init__(self, folder: Path, mode: int) -> None:
        self._mode = mode
        self._socket = socket.socket(socket.AF_UNIX, KIND)
        self._path = draft_path(folder)
        try:
            self._socket.bind(str(self._path))
            self._path.chmod(mode)  # no client can connect before `listen`
            self._socket.listen(BACKLOG)
        except BaseException:
            self.close()
            raise

    def publish(self, under: Path) -> None:
        """Rename the socket to `under`. It replaces the socket of a killed process."""
        self._path.rename(under)
        self._path = under

    def fileno(self) -> int:
        return self._socket.fileno()

    def accept(self) -> Connection | None:
        """Return the next connection; None if there is none, or its peer is not allowed."""
        try:
            accepted, _ = self._socket.accept()
        except OSError:
            return None
        accepted.setblocking(False)
        raw = accepted.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
        connection = Connection(accepted, Peer(*CREDENTIALS.unpack(raw)))
        if not self._allows(connection.peer):
            connection.close()
            return None
        return connection

    def close(self) -> None:
        """Remove the socket from its folder, and close it."""
        self._path.unlink(missing_ok=True)
        self._socket.close()

    def _allows(self, peer: Peer) -> bool:
        """Return True for this user, root, and users whom the mode allows to write."""
        return peer.uid in (os.geteuid(), 0) or bool(self._mode & (GROUP_WRITES | OTHERS_WRITE))


class Connection:
    """Connection to one client."""

    def __init__(self, connected: socket.socket, peer: Peer) -> None:
        self.peer = peer
        self.open = True
        self.pending = 0  # requests without an answer
        self._socket = connected
        self._outbox: deque[bytes] = deque()
        self._stalled_at = 0.0  # [s] since when the client has not read; 0: it reads

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self) -> bytes | None:
        """Return the next message; None if there is none, or the connection is closed.

        A message that is too long closes the connection.
        """
        try:
            message, _, flags, _ = self._socket.recvmsg(MESSAGE_SIZE)
        except BlockingIOError:
            return None
        except OSError:
            self.close()
            return None
        if not message or flags & socket.MSG_TRUNC:
            self.close()
            return None
        return message

    @property
    def has_mail(self) -> bool:
        """True if messages wait to be sent."""
        return self.open and bool(self._outbox)

    def send(self, *messages: bytes) -> None:
        """Queue messages, and send what the client has room for."""
        self._outbox.extend(messages)
        self.flush(time.monotonic())

    def flush(self, now: float) -> None:
        """Send queued messages. A client that reads none for STALL_TIMEOUT loses the connection.

        Args:
            now: Present time [s].
        """
        try:
            while self.has_mail:
                self._socket.send(self._outbox[0])
                self._outbox.popleft()
                self._stalled_at = 0.0
        except BlockingIOError:
            self._stalled_at = self._stalled_at or now
            if now - self._stalled_at > STALL_TIMEOUT or len(self._outbox) > OUTBOX_MAX:
                self.close()
        except OSError:
            self.close()

    def close(self) -> None:
        """End the connection, also for copies of the socket in forked children."""
        if self.open:
            self.open = False
            with suppress(OSError):  # the client has gone
                self._socket.shutdown(socket.SHUT_RDWR)
            self._socket.close()
