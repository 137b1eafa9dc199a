"""Errors for a master that cannot be reserved and for SDO transfers that fail."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from catenary.errors import CatenaryError, LinkError, MailboxError, SdoAbort
from catenary.igh.library import Library
from catenary.wire.abort import abort_code

NODE = "/dev/EtherCAT{}"
MODULE = Path("/sys/module/ec_master")


class NoMailboxError(MailboxError):
    """Error for a device without a CoE mailbox."""


def sdo_error(
    name: str, position: int, index: int, subindex: int, result: int, code: int
) -> CatenaryError:
    """Return the error for a failed SDO transfer.

    Args:
        name: Name of the device in the message.
        position: Position of the device.
        index: Index of the object.
        subindex: Subindex of the object.
        result: The result of the call: -errno.
        code: The abort code from the device; 0 if there is none.
    """
    what = f"{name}: SDO 0x{index:04X}:{subindex:02X}"
    if code:
        known = abort_code(code)
        return SdoAbort(
            f"{what} refused with 0x{code:08X}: {known.text}",
            position=position,
            index=index,
            subindex=subindex,
            code=code,
            hint=known.hint or "the manual of the device lists its objects",
        )
    if -result == errno.EPROTONOSUPPORT:
        return NoMailboxError(f"{what}: the device has no objects", hint="it does not support CoE")
    if -result in (errno.EOVERFLOW, errno.ENOBUFS):
        return MailboxError(f"{what} is longer than the limit", hint="pass a larger limit=")
    return MailboxError(
        f"{what}: no answer ({os.strerror(-result)})",
        hint="a device without CoE has no objects; otherwise see the kernel log: dmesg | tail",
    )


def refused(index: int, number: int, library: Library) -> LinkError:
    """Return the error for a master that cannot be reserved, with the cause if it is visible.

    Args:
        index: Number of the master.
        number: errno of `ecrt_request_master`.
        library: The library that was called.
    """
    node = NODE.format(index)
    if number == errno.EBUSY:
        return LinkError(
            f"master {index} is reserved by another application",
            hint=f"end it first: sudo fuser -v {node} shows its name",
        )
    if not os.access(node, os.R_OK | os.W_OK):
        return _unusable_node(index, node)
    if number == errno.ENODEV:
        return LinkError(
            f"master {index} waits for its network interface: no interface has the address of "
            f"MASTER{index}_DEVICE in /etc/ethercat.conf, or its driver is not loaded",
            hint="ip link shows the addresses, lsmod | grep ec_ shows the driver; then sudo "
            "systemctl restart ethercat",
        )
    if number == errno.EIO:
        return LinkError(
            f"master {index} cannot start operation: the kernel refuses (EIO)",
            hint="dmesg | tail shows the reason",
        )
    return LinkError(
        f"master {index}: {library.path} (version {library.version}) and the kernel module "
        f"(version {_module_version()}) do not work together",
        hint="they come from two builds with different ioctl() versions: check with ethercat "
        "version; install both from one source, then sudo systemctl restart ethercat. If the "
        f"versions agree, another application may hold the master: sudo fuser -v {node}",
    )


def _unusable_node(index: int, node: str) -> LinkError:
    """Return the error for a device node that does not exist or cannot be opened."""
    if not os.path.exists(node):
        if not MODULE.exists():
            return LinkError(
                f"master {index}: the kernel module ec_master is not loaded, so there is no {node}",
                hint="sudo systemctl start ethercat; if that fails, the module was not built "
                "for this kernel: docs/how_to/igh.md",
            )
        return LinkError(
            f"master {index}: the module ec_master is loaded, but {node} does not exist",
            hint=f"set MASTER{index}_DEVICE in /etc/ethercat.conf, then "
            "sudo systemctl restart ethercat",
        )
    return LinkError(
        f"master {index}: no permission to open {node}",
        hint='echo \'KERNEL=="EtherCAT[0-9]*", MODE="0660", GROUP="realtime"\' | sudo tee '
        "/etc/udev/rules.d/99-ethercat.rules; sudo udevadm control --reload; sudo udevadm "
        "trigger; then join that group: sudo usermod -aG realtime $USER",
    )


def _module_version() -> str:
    try:
        return (MODULE / "version").read_text().strip()
    except OSError:
        return "unknown"
