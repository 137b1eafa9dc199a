"""Files and firmware of a device, as its application uses them."""

from __future__ import annotations

from collections.abc import Callable

from catenary.virtual.description import MailboxDefault
from catenary.virtual.foe.server import HEADER, FileServer
from catenary.virtual.foe.store import FileStore
from catenary.virtual.mailbox import ERROR_TOO_SHORT, ERROR_UNSUPPORTED_PROTOCOL
from catenary.virtual.mailbox import HEADER as MAILBOX_HEADER
from catenary.virtual.state_machine import BOOT

FIRST_VERSION = "1.0"  # 0x100A if the firmware cannot be replaced


class FileAccess:
    """File server of one device, and the choice of the firmware that it runs."""

    def __init__(
        self,
        store: FileStore | None,
        standard: MailboxDefault | None,
        bootstrap: MailboxDefault | None,
        state: Callable[[], int],
    ) -> None:
        """Initialise the access.

        Args:
            store: Files of the device; None: it does not support FoE.
            standard: Mailbox outside of BOOT.
            bootstrap: Mailbox in BOOT; None: the device has no BOOT.
            state: Function that returns the AL state.
        """
        self._boxes = standard, bootstrap
        self._state = state
        self._flash = store.flash if store is not None else None
        self._server = (
            FileServer(store, rooms=self._rooms, boot=lambda: state() == BOOT)
            if store is not None
            else None
        )

    def serve(self, payload: bytes) -> list[bytes] | int:
        """Return the answers to a message, or the code of a mailbox error."""
        if self._server is None:
            return ERROR_UNSUPPORTED_PROTOCOL
        return ERROR_TOO_SHORT if len(payload) < HEADER.size else self._server.serve(payload)

    def reset(self) -> None:
        """Forget a transfer."""
        if self._server is not None:
            self._server.reset()

    @property
    def lacks_firmware(self) -> bool:
        """True if only the boot loader runs."""
        return self._flash is not None and self._flash.running is None

    @property
    def restart_is_due(self) -> bool:
        """True if the memory does not contain the firmware that runs."""
        return self._flash is not None and self._flash.image != self._flash.running

    def restart(self) -> None:
        """Start the stored firmware, or the boot loader if the memory has no valid image."""
        if self._flash is not None:
            self._flash.restart()

    @property
    def version(self) -> tuple[str, int]:
        """Version of the firmware, and its revision of the device; 0: the usual one."""
        if self._flash is None or self._flash.running is None:
            return FIRST_VERSION, 0
        return self._flash.running

    def _rooms(self) -> tuple[int, int]:
        """Return the maximum data of a packet to and from the device [bytes]."""
        box = self._boxes[self._state() == BOOT]
        if box is None:
            return 0, 0
        headers = MAILBOX_HEADER.size + HEADER.size
        return box.receive_size - headers, box.send_size - headers
