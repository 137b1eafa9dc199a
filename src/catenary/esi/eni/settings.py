"""Settings of an ENI added to the description of a device: commands, watchdog and timeouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.esi.eni.own_registers import WRITES, vendor_commands
from catenary.esi.eni.values import EniDevice, EniFile, MailboxCommand, RegisterCommand
from catenary.model.device import DeviceDescription
from catenary.model.esi_settings import IdnCommand, Timeouts, WatchdogValues
from catenary.model.register_command import Validation
from catenary.wire import register

ASSIGN_ACTIVATE = register.ACTIVATION.address - 1  # 0x0980, SYNC unit control
TIMEOUT_MAX = 60.0  # [s], as for those of an ESI
SII_DATA = 0x0508
SII_CONTROL = 0x0502
REVISION_WORD, SERIAL_WORD = 0x000C, 0x000E  # words of the SII


def with_eni(
    description: DeviceDescription, eni: EniFile, without: Sequence[str] = ()
) -> DeviceDescription:
    """Return the description with the commands, watchdog and timeouts of an ENI.

    The commands replace those of an ESI: the configurator made them from the ESI. A device that is
    not in the file, or is another product, keeps its description.

    Args:
        description: The device.
        eni: The file.
        without: Mailbox protocols whose commands are left out.
    """
    if description.position >= len(eni.devices):
        return description
    device = eni.devices[description.position]
    if not device.identity.same_kind(description.identity):
        return description
    requests = [each for each in device.requests if not each.disabled]
    return replace(
        description,
        init_commands=tuple(each.download for each in requests if each.download is not None),
        register_commands=vendor_commands(device),
        idn_commands=() if "SoE" in without else _idn_commands(requests),
        commands_origin="ENI",
        watchdog=watchdog_of(device),
        timeouts=_timeouts(device),
    )


def _idn_commands(requests: Sequence[MailboxCommand]) -> tuple[IdnCommand, ...]:
    return tuple(
        IdnCommand(
            each.transitions,
            each.idn,
            each.data,
            each.drive,
            each.elements,
            each.comment,
            str(each.source),
        )
        for each in requests
        if each.idn is not None
    )


def written(device: EniDevice, address: int, transition: str) -> RegisterCommand | None:
    """Return the last command that writes from an address on at a transition.

    Args:
        device: The device.
        address: Address of the first byte.
        transition: The transition, such as "PS".
    """
    found = [
        each
        for each in device.commands
        if each.offset == address and each.command in WRITES and transition in each.transitions
    ]
    return found[-1] if found else None


def watchdog_of(device: EniDevice) -> WatchdogValues:
    """Return the watchdog registers that a device's commands write."""

    def word(address: int) -> int | None:
        command = written(device, address, "IP") or written(device, address, "PS")
        return None if command is None else int.from_bytes(command.data[:2], "little")

    return WatchdogValues(
        divider=word(register.WATCHDOG_DIVIDER.address),
        process_data=word(register.WATCHDOG_TIME_PROCESS_DATA.address),
    )


def _timeouts(device: EniDevice) -> Timeouts:
    """Return the timeouts of the commands that request a state, and of the mailbox commands."""

    def longest(*transitions: str) -> float | None:
        commands = (written(device, register.AL_CONTROL.address, each) for each in transitions)
        times = [each.timeout for each in commands if each is not None and each.timeout]
        return min(max(times), TIMEOUT_MAX) if times else None

    answer = max((each.timeout for each in device.requests), default=0.0)
    return Timeouts(
        pre_op=longest("IP"),
        safe_op_and_op=longest("PS", "SO"),
        mailbox_response=min(answer, TIMEOUT_MAX) or None,
    )


def checked_words(commands: Sequence[RegisterCommand]) -> dict[int, Validation]:
    """Return the validations of words of the SII that the commands read, such as the revision.

    A read of the SII data register is preceded by the command that starts it, with the word in its
    data (ETG.1000.4 §6.4).
    """
    found: dict[int, Validation] = {}
    word = None
    for each in commands:
        if each.offset == SII_CONTROL and len(each.data) >= 6:
            word = int.from_bytes(each.data[2:6], "little")
        elif each.offset == SII_DATA and each.validation is not None and word is not None:
            found[word] = each.validation
    return found
