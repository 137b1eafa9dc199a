"""Register commands of an ENI (ETG.2100, `InitCmds/InitCmd`).

A wrong working counter is tried again `Retries` times. A command with `Validate` is repeated until
the reply has the expected bits, or until its timeout.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.errors import ConfigurationError
from catenary.model.register_command import DEFAULT_TIMEOUT, RegisterCommand
from catenary.procedure.exchange import Procedure, Reply, Request, after, physical
from catenary.procedure.station import Deadline, Pace, Station
from catenary.wire.datagram import EcatCommand


def run_commands(
    station: Station, commands: Sequence[RegisterCommand], transition: str
) -> Procedure[None]:
    """Run the commands of a transition, in their order.

    Args:
        station: The device.
        commands: Commands of all transitions.
        transition: The transition, such as "PS".

    Raises:
        ConfigurationError: The working counter or the reply of a command is wrong.
    """
    for each in commands:
        if transition in each.transitions:
            yield from run_command(station, each, transition)


def run_command(station: Station, command: RegisterCommand, transition: str) -> Procedure[None]:
    """Run one command.

    Args:
        station: The device.
        command: The command. Its device address is replaced by the station address.
        transition: The transition, for the error.

    Raises:
        ConfigurationError: The working counter or the reply is wrong.
    """
    reads = EcatCommand(command.command).reads
    kind = EcatCommand.FPRD if reads else EcatCommand.FPWR
    request = Request(kind, physical(station.address, command.offset), command.data, reads)
    validation = command.validation
    seconds = validation.timeout if validation is not None else command.timeout
    deadline, pace, tries = Deadline(seconds or DEFAULT_TIMEOUT), Pace(), 0
    while True:
        [reply] = yield [request]
        fault = _fault(command, reply)
        if not fault:
            return
        waits = validation is not None and _answered(command, reply)
        tries += not waits
        if tries > command.retries or deadline.passed(reply):
            raise _failed(station, command, transition, fault)
        yield after(pace.pause())


def _answered(command: RegisterCommand, reply: Reply) -> bool:
    """Return True if the working counter is right."""
    if reply.lost:
        return False
    if command.count is not None:
        return reply.working_counter == command.count
    return command.validation is None or reply.working_counter > 0


def _fault(command: RegisterCommand, reply: Reply) -> str:
    """Return the fault of a reply; empty if it is right."""
    if reply.lost:
        return "the frame did not come back"
    if not _answered(command, reply):
        expected = "at least 1" if command.count is None else command.count
        return f"expected working counter {expected}, received {reply.working_counter}"
    validation = command.validation
    if validation is None or validation.accepts(reply.data):
        return ""
    mask = f" under mask {validation.mask.hex(' ')}" if validation.is_masked else ""
    found = reply.data[: len(validation.data)].hex(" ")
    return f"expected {validation.data.hex(' ')}{mask}, read {found}"


def _failed(
    station: Station, command: RegisterCommand, transition: str, fault: str
) -> ConfigurationError:
    return ConfigurationError(
        f"{station}: ENI {command.source}: command at {transition} to register {command}: {fault}",
        hint="check that the ENI was made for this device and its firmware",
    )
