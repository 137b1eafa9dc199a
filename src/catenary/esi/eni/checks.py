"""Checks of an ENI before anything is sent: content that Catenary cannot do is refused."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Never

from catenary.errors import MachineFileError
from catenary.esi.eni.commands import DOWNLOAD
from catenary.esi.eni.known import PROTOCOLS
from catenary.esi.eni.own_registers import (
    BY_POSITION,
    READS,
    WRITES,
    is_upward,
    overlap,
    own_reason,
    vendor_commands,
)
from catenary.esi.eni.values import EniDevice, EniFile, MailboxCommand, RegisterCommand
from catenary.esi.source import Source
from catenary.wire.datagram import EcatCommand
from catenary.wire.soe import DRIVES

SOE_WRITE = 3  # OpCode


def check_commands(eni: EniFile, without: Sequence[str] = ()) -> None:
    """Check that Catenary can run all commands of upward transitions.

    Args:
        eni: The file.
        without: Mailbox protocols whose commands are left out, such as "EoE".

    Raises:
        MachineFileError: A command cannot be run. The error names file, line and element.
        ValueError: A protocol in `without` is unknown, or is CoE.
    """
    for name in without:
        if name not in PROTOCOLS or name == "CoE":
            others = ", ".join(each for each in PROTOCOLS if each != "CoE")
            raise ValueError(f"without={name!r}: choose from {others}")
    for command in eni.commands:
        if is_upward(command.transitions) and not own_reason(command):
            _refuse(
                eni,
                f"Master/InitCmds/InitCmd {command}",
                command.source,
                "commands of the MainDevice to other registers are not supported",
                "move it to the device that needs it",
            )
    for device in eni.devices:
        for command in vendor_commands(device):
            _check_register(eni, device, command)
        for request in device.requests:
            if not request.disabled and is_upward(request.transitions):
                _check_request(eni, device, request, without)


def _check_register(eni: EniFile, device: EniDevice, command: RegisterCommand) -> None:
    place = f"{device.name}: InitCmds/InitCmd {command}"
    if eni.encrypted:
        _refuse(
            eni,
            place,
            command.source,
            "the file is encrypted, so the data of this register command may be scrambled",
            "export the ENI without encryption",
        )
    if command.command not in (*READS, *WRITES):
        name = EcatCommand(command.command).name
        _refuse(
            eni,
            place,
            command.source,
            f"{name} is not supported",
            "use APRD, APWR, FPRD or FPWR (1, 2, 4, 5)",
        )
    if command.command in WRITES and overlap(command):
        _refuse(
            eni,
            place,
            command.source,
            f"it writes registers of the bring-up together with others: {overlap(command)}",
            "write the other registers with a separate command",
        )
    by_position = command.command in BY_POSITION
    own = -device.position & 0xFFFF if by_position else device.station_address
    if command.device != own:
        _refuse(
            eni,
            place,
            command.source,
            f"Adp is {command.device}, but this device has {own}",
            "a command in a Slave element must address this device",
        )


def _check_request(
    eni: EniFile, device: EniDevice, request: MailboxCommand, without: Sequence[str]
) -> None:
    what = f" ({request.comment})" if request.comment else ""
    place = f"{device.name}: Mailbox/{request.protocol}/InitCmds/InitCmd{what}"
    if request.protocol == "SoE" and request.protocol not in without:
        _check_idn(eni, place, request)
    elif request.protocol != "CoE":
        if request.protocol not in without:
            _refuse(
                eni,
                place,
                request.source,
                f"{request.parameter}: {request.protocol} is not supported".removeprefix(": "),
                f'to run the bus without it: cat.Machine(..., without=["{request.protocol}"])',
            )
    elif request.operation != DOWNLOAD:
        _refuse(
            eni,
            place,
            request.source,
            f"Ccs {request.operation} is not supported",
            "only downloads (Ccs 1) can be run",
        )


def _check_idn(eni: EniFile, place: str, request: MailboxCommand) -> None:
    """Refuse a SoE command that does not write one element of an IDN."""
    if request.operation != SOE_WRITE:
        what, hint = (
            f"OpCode {request.operation} is not supported",
            "only writes (OpCode 3) can be run",
        )
    elif request.elements.bit_count() != 1:
        what = f"Elements 0x{request.elements:02X} is not supported"
        hint = "write one element with each command; 0x40 is the value"
    elif request.drive not in DRIVES:
        what, hint = f"DriveNo {request.drive} is out of range", "drives have the numbers 0 to 7"
    else:
        return
    _refuse(eni, place, request.source, f"{request.parameter}: {what}", hint)


def _refuse(eni: EniFile, key: str, source: object, message: str, hint: str) -> Never:
    line = source.line if isinstance(source, Source) else None
    raise MachineFileError(message, path=eni.path, line=line, key=key, hint=hint)
