from socket import socket

from catenary.link._table import TableLink

class RawLink(TableLink):
    def __init__(
        self, name: str, socket: socket, ring_size: int, slot_size: int, receive_path: str
    ) -> None: ...
    @property
    def receive_path(self) -> str: ...
    def fileno(self) -> int:
        """Return the descriptor of the socket."""
    def forget(self) -> None: ...
    def flush(self) -> int: ...
