"""Why a kernel master could not be had, and why an object could not."""

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
    """The device has no mailbox for objects."""


def sdo_error(
    who: str, position: int, index: int, subindex: int, result: int, code: int
) -> CatenaryError:
    """The error for an SDO that failed with -errno, and the device's abort code if it sent one."""
    what = f"{who}: SDO 0x{index:04X}:{subindex:02X}"
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
        return NoMailboxError(f"{what}: the device has no objects", hint="it does not speak CoE")
    if -result in (errno.EOVERFLOW, errno.ENOBUFS):
        return MailboxError(f"{what} is longer than expected", hint="give a larger limit=")
    return MailboxError(
        f"{what}: no answer ({os.strerror(-result)})",
        hint="a device without CoE has no objects; else the kernel's log says more: dmesg | tail",
    )


def refused(index: int, number: int, library: Library) -> LinkError:
    """Why a master could not be reserved, as far as can be seen from outside the kernel."""
    node = NODE.format(index)
    if not os.path.exists(node) and number != errno.EBUSY:
        if not MODULE.exists():
            return LinkError(
                f"master {index}: the kernel module ec_master is not loaded, {node} is not there",
                hint="sudo systemctl start ethercat; where that fails, the module was not built "
                "for this kernel: docs/igh.md",
            )
        return LinkError(
            f"master {index}: the module ec_master is loaded, but {node} is not there",
            hint=f"give MASTER{index}_DEVICE in /etc/ethercat.conf, then "
            "sudo systemctl restart ethercat",
        )
    if number != errno.EBUSY and not os.access(node, os.R_OK | os.W_OK):
        return LinkError(
            f"master {index}: no permission to open {node}",
            hint='echo \'KERNEL=="EtherCAT[0-9]*", MODE="0660", GROUP="realtime"\' | sudo tee '
            "/etc/udev/rules.d/99-ethercat.rules; sudo udevadm control --reload; sudo udevadm "
            "trigger; and be in that group: sudo usermod -aG realtime $USER",
        )
    if number == errno.ENODEV:
        return LinkError(
            f"master {index} waits for its network interface: none has the address that "
            f"MASTER{index}_DEVICE in /etc/ethercat.conf gives, or its driver is not loaded",
            hint="ip link shows the addresses, lsmod | grep ec_ the driver; then sudo systemctl "
            "restart ethercat",
        )
    if number == errno.EIO:
        return LinkError(
            f"master {index} cannot be taken into operation: the kernel refuses (EIO)",
            hint="dmesg | tail says why",
        )
    if number == errno.EBUSY:
        return LinkError(
            f"master {index} is reserved by another application",
            hint=f"end it first: sudo fuser -v {node} names it",
        )
    return LinkError(
        f"master {index}: {library.path} (version {library.version}) and the kernel module "
        f"(version {_module_version()}) do not work together",
        hint="they come from two builds, and the version of their ioctl() differs: ethercat "
        "version tells; install both from one source, then sudo systemctl restart ethercat. Where "
        f"they agree, another application may hold the master: sudo fuser -v {node}",
    )


def _module_version() -> str:
    try:
        return (MODULE / "version").read_text().strip()
    except OSError:
        return "unknown"
