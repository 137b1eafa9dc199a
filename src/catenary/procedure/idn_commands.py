"""Start-up commands of SERCOS drives: IDNs that an ESI or ENI writes at state transitions."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.errors import SoeError
from catenary.model.esi_settings import IdnCommand
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.soe import Target, write
from catenary.wire.soe import Element

PRE_OP_STEPS, SAFE_OP_STEPS = ("IP", "PS"), ("SO",)  # the mailbox is not available in INIT


def run_idn_commands(
    channel: MailboxChannel, commands: Sequence[IdnCommand], steps: Sequence[str]
) -> Procedure[None]:
    """Write the IDNs of transitions, one transition after the other, in the order of the file.

    Args:
        channel: The mailbox of the device.
        commands: Commands of all transitions.
        steps: The transitions, such as "IP" and "PS".

    Raises:
        SoeError: The drive refuses one. The message names file and line of the command.
    """
    chosen = [each for step in steps for each in commands if step in each.transitions]
    for each in chosen:
        target = Target(channel, each.number, each.drive)
        try:
            yield from write(target, each.data, Element(each.element))
        except SoeError as error:
            raise SoeError(
                f"{error.message} (start-up command of {each.source} {each.comment})".rstrip(),
                position=error.position,
                idn=error.idn,
                drive=error.drive,
                code=error.code,
                hint=error.hint,
            ) from error
