"""Files of a virtual device, and its behaviour when they are read and written.

In TOML: `files = { contents = { "log.txt" = "started" }, password = 0x1234 }`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import msgspec

BOOTSTRAP_SIZES = range(32, 1025, 2)  # [bytes]


class DeviceFirmware(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Firmware of a virtual device. `catenary.virtual.make_firmware` makes images for it.

    A write erases the memory first. Without a complete and valid image, only the boot loader
    starts: the device refuses PRE-OP with AL status code 0x0014.
    """

    name: str = "app.efw"  # file name, which the device accepts only in BOOT
    version: str = "1.0"  # object 0x100A of the first image
    # Start of a new image at the end of BOOT. "state": with the transition to INIT. "power": with a
    # power cycle, so that the device leaves the segment for a moment.
    restart: Literal["state", "power"] = "state"
    # Answer to a read of the firmware. "refused": error 0x8002. "same": the written file. "coded":
    # a file of the same size with other contents. No device with "coded" has been reported.
    reading: Literal["refused", "same", "coded"] = "refused"


class DeviceFiles(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Files of a virtual device, which FoE reads and writes. They survive a loss of power."""

    contents: Mapping[str, Any] = {}  # bytes or text, by name; msgspec has no type for both
    size_limit: int = 1 << 22  # of all files, and of the firmware [bytes]
    password: int = 0  # for all files; 0: none
    new_files: bool = True  # False: only files that exist can be written
    write_protected: tuple[str, ...] = ()
    bootstrap_only: tuple[str, ...] = ()  # the other files are accessible only outside of BOOT
    busy: int = 0  # number of BUSY answers to each request and packet
    # Size of each bootstrap mailbox [bytes]; None: that of the standard mailbox; 0: no BOOT.
    bootstrap_bytes: int | None = None
    firmware: DeviceFirmware | None = None

    # False: errors have no text (SOES, esc_foe.c, FOE_abort).
    error_texts: bool = True

    # Message that continues a read after BUSY in answer to the request. "acknowledgement": that of
    # packet 0 (SSC from 5.11, ecatfoe.c); a second request is then illegal. "request": the same
    # request.
    after_busy: Literal["acknowledgement", "request"] = "acknowledgement"

    # Request during a transfer. "restarts": it begins a new transfer. "refused": it ends the
    # transfer with error 0x8004 (SSC, ecatfoe.c; SOES, esc_foe.c, FOE_read and FOE_write).
    second_request: Literal["restarts", "refused"] = "restarts"

    def __post_init__(self) -> None:
        for name, content in self.contents.items():
            if not isinstance(content, (bytes, str)):
                raise TypeError(f"contents of {name!r} must be bytes or text, not {content!r}")
        if self.bootstrap_bytes and self.bootstrap_bytes not in BOOTSTRAP_SIZES:
            raise ValueError(
                "bootstrap_bytes must be 0 or an even number, 32 to 1024, not "
                f"{self.bootstrap_bytes}"
            )
        if not 0 <= self.password <= 0xFFFF_FFFF:
            raise ValueError(f"password must be 0 to 0xFFFFFFFF, not {self.password:#x}")
        if self.firmware is not None and self.bootstrap_bytes == 0:
            raise ValueError("a device with firmware needs a bootstrap mailbox: bootstrap_bytes")
