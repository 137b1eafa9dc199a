"""Start-up list of one device, as TwinCAT exports it (root `EtherCATMailbox`)."""

from __future__ import annotations

from pathlib import Path

from catenary.errors import MachineFileError
from catenary.esi.eni.commands import read_mailbox_commands
from catenary.esi.eni.fields import Fields
from catenary.esi.eni.reader import read_root
from catenary.esi.eni.values import MailboxCommand

ROOT = "EtherCATMailbox"


def read_start_up_list(path: str | Path) -> tuple[MailboxCommand, ...]:
    """Return the commands of a start-up list, in the order of the file.

    Args:
        path: The XML file of TwinCAT ("Startup" page of the device, "Export to XML").

    Raises:
        MachineFileError: The file cannot be read, is not such a list, or a value is missing or
            faulty. The error names file, line and element.
    """
    root = read_root(path)
    if root.tag != ROOT:
        raise MachineFileError(
            f"the root is {root.tag}, not {ROOT}",
            path=str(path),
            line=root.line,
            key=root.tag,
            hint='in TwinCAT, open the page "Startup" of the device and choose "Export to XML"',
        )
    return read_mailbox_commands(root, Fields(str(path)))
