"""Registers that Catenary's bring-up sets itself, so that commands of an ENI only restate them."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.esi.eni.values import EniDevice, EniFile, RegisterCommand
from catenary.wire.datagram import EcatCommand

OWN_REGISTERS = (  # first and last address, reason
    (0x0010, 0x0011, "Catenary sets the station addresses"),
    (0x0100, 0x0103, "Catenary sets the ports and the alias address"),
    (0x0120, 0x0135, "Catenary changes the states"),
    (0x0200, 0x0201, "Catenary does not use the events of the datagrams"),
    (0x0300, 0x0313, "Catenary keeps the error counters for its diagnosis"),
    (0x0400, 0x0401, "the plan sets the watchdog"),
    (0x0420, 0x0421, "the plan sets the watchdog"),
    (0x0500, 0x050F, "Catenary reads the EEPROM and assigns it"),
    (0x0600, 0x06FF, "the plan sets the FMMUs"),
    (0x0800, 0x08FF, "the plan sets the SyncManagers"),
    (0x0900, 0x09A7, "the plan sets the clocks"),
)
UPWARDS = frozenset(("IP", "PS", "SO"))
READS = (EcatCommand.APRD, EcatCommand.FPRD)
WRITES = (EcatCommand.APWR, EcatCommand.FPWR)
LOGICAL = (EcatCommand.LRD, EcatCommand.LWR, EcatCommand.LRW)
BY_POSITION = (EcatCommand.APRD, EcatCommand.APWR)


def own_reason(command: RegisterCommand) -> str:
    """Return the reason why Catenary does not run a command; empty if it runs it."""
    if command.command in LOGICAL:  # its address is not that of a register
        return ""
    last = command.offset + len(command.data) - 1
    for first, end, reason in OWN_REGISTERS:
        if first <= command.offset and last <= end:
            return reason
    return ""


def overlap(command: RegisterCommand) -> str:
    """Return the reason of the first register that a command shares with the bring-up."""
    last = command.offset + len(command.data) - 1
    for first, end, reason in OWN_REGISTERS:
        if command.offset <= end and first <= last:
            return reason
    return ""


def is_upward(transitions: Sequence[str]) -> bool:
    """Return True if Catenary makes one of the transitions with commands: IP, PS or SO."""
    return not UPWARDS.isdisjoint(transitions)


def vendor_commands(device: EniDevice) -> tuple[RegisterCommand, ...]:
    """Return the register commands of a device that Catenary runs."""
    return tuple(
        each for each in device.commands if is_upward(each.transitions) and not own_reason(each)
    )


def left_out(eni: EniFile, without: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the commands that Catenary does not run although nothing restates them.

    These are commands of downward transitions and of BOOT, disabled ones, and those of the mailbox
    protocols in `without`.

    Args:
        eni: The file.
        without: Mailbox protocols, such as "EoE".
    """
    notes = []
    for device in eni.devices:
        for each in device.commands:
            if not is_upward(each.transitions) and not own_reason(each):
                way = ", ".join(each.transitions)
                notes.append(f"{each.source}: {device.name}: {each} is not sent at {way}")
        for request in device.requests:
            what = f"{request.source}: {device.name}: {request.protocol} command"
            what += f" ({request.comment})" * bool(request.comment)
            if request.disabled:
                notes.append(f"{what} is disabled")
            elif request.protocol in without:
                notes.append(f"{what} is left out")
            elif not is_upward(request.transitions):
                notes.append(f"{what} is not sent at {', '.join(request.transitions)}")
    return tuple(notes)
