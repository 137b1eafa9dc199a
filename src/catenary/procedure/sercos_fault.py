"""Faults of SERCOS drives: diagnosis, and reset of the errors of class 1. IEC 61800-7-204."""

from __future__ import annotations

from catenary.errors import CatenaryError
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sercos import read_value, run_command
from catenary.procedure.soe import Target

RESET_CLASS_1, MESSAGE, NUMBER = 99, 95, 390
RESET_TIMEOUT = 5.0  # [s]


def read_diagnosis(channel: MailboxChannel, drive: int) -> Procedure[str | None]:
    """Return S-0-0390 and S-0-0095 as text; None if the drive reports neither.

    A drive in trouble may not answer. This is not an error.

    Args:
        channel: The mailbox of the device.
        drive: Number of the drive.
    """
    number = yield from _value(Target(channel, NUMBER, drive))
    message = yield from _value(Target(channel, MESSAGE, drive))
    texts = [f"error code 0x{number:08X} (S-0-0390)"] if isinstance(number, int) else []
    texts += [f"{message!r} (S-0-0095)"] if isinstance(message, str) and message else []
    return ", ".join(texts) or None


def _value(target: Target) -> Procedure[object]:
    try:
        return (yield from read_value(target))
    except CatenaryError:
        return None


def reset_fault(channel: MailboxChannel, drive: int) -> Procedure[None]:
    """Run the procedure command S-0-0099, which resets the errors of class 1.

    Args:
        channel: The mailbox of the device.
        drive: Number of the drive.

    Raises:
        SoeError: The drive refuses the command, or it fails.
        ResponseTimeout: The command does not end, or the device does not answer.
        MailboxError: The device violates the protocol.
    """
    yield from run_command(Target(channel, RESET_CLASS_1, drive), RESET_TIMEOUT)
