"""Clock modes, mailbox, start-up commands, timeouts and watchdog of an ESI, for a description."""

from __future__ import annotations

from dataclasses import replace

from catenary.esi.device import EsiDevice, EsiInitCommand, EsiMailbox, EsiOpMode
from catenary.model.device import DeviceDescription, MailboxLayout, OpMode
from catenary.model.esi_settings import (
    IdnCommand,
    InitCommand,
    ModeAssignment,
    NamedMapping,
    Timeouts,
    WatchdogValues,
)

TIMEOUT_MAX = 60.0  # [s]; those of known files reach 9 s. Errors such as µs must not block a loop

# Properties of CoE by field: their names in an ESI
_PROPERTIES = {
    "complete_access": "CompleteAccess",
    "sdo_information": "SdoInfo",
    "pdo_assign": "PdoAssign",
    "pdo_configuration": "PdoConfig",
}


def with_settings(device: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
    """Return the description with the settings of an ESI. Notes name contradictions to the SII.

    Args:
        device: Description of the device.
        esi: Its ESI.
    """
    mailbox, notes = _mailbox(device.mailbox, esi.mailbox)
    commands = () if esi.mailbox is None else esi.mailbox.init_commands
    return replace(
        device,
        mailbox=mailbox,
        op_modes=_op_modes(device.op_modes, esi.op_modes),
        sii_denies_lrw=device.sii_denies_lrw or esi.use_lrd_lwr,
        init_commands=tuple(map(init_command, commands)),
        idn_commands=_idn_commands(esi.mailbox),
        named_mappings=tuple(
            NamedMapping(each.name, each.default, each.pdos, str(each.source))
            for each in esi.alternative_mappings
        ),
        timeouts=_timeouts(esi),
        watchdog=WatchdogValues(esi.watchdog.divider, esi.watchdog.pdi, esi.watchdog.sync_managers),
        notes=(*device.notes, *notes),
    )


def _mailbox(
    layout: MailboxLayout | None, described: EsiMailbox | None
) -> tuple[MailboxLayout | None, list[str]]:
    """Return the mailbox with the properties that its SII does not state."""
    if described is None:
        return layout, []
    if layout is None:
        return None, [f"{described.source}: its ESI describes a mailbox, but its SII does not"]
    values = {name: getattr(described, name) for name in _PROPERTIES}
    if not layout.stated:
        return replace(layout, **values, source=str(described.source)), []
    different = [
        text for name, text in _PROPERTIES.items() if getattr(layout, name) != values[name]
    ]
    if not different or not layout.coe or not layout.receive_size:
        return layout, []
    return layout, [
        f"{described.source}: its ESI and its SII differ in {', '.join(different)}; those of the "
        "SII are used"
    ]


def _op_modes(known: tuple[OpMode, ...], described: tuple[EsiOpMode, ...]) -> tuple[OpMode, ...]:
    """Return the modes of the ESI, then those that only the SII has."""
    modes = tuple(map(_op_mode, described))
    names = {mode.name.casefold() for mode in modes}
    return modes + tuple(
        mode for mode in known if not modes or (mode.name and mode.name.casefold() not in names)
    )


def _op_mode(described: EsiOpMode) -> OpMode:
    return OpMode(
        name=described.name,
        description=described.description,
        assign_activate=described.assign_activate,
        sync0_ns=described.sync0_ns,
        sync0_factor=described.sync0_factor,
        shift_ns=described.shift_ns,
        shift_factor=described.shift_factor,
        shift_of_inputs=described.shift_of_inputs,
        sync1_ns=described.sync1_ns,
        sync1_factor=described.sync1_factor,
        sync1_shift_ns=described.sync1_shift_ns,
        assignments=tuple(
            ModeAssignment(each.index, each.pdos, each.oversampling)
            for each in described.sync_managers
            if each.pdos
        ),
        source=str(described.source),
    )


def init_command(described: EsiInitCommand) -> InitCommand:
    """Return a start-up command of an ESI as a value of the model."""
    return InitCommand(
        described.transitions,
        described.index,
        described.subindex,
        described.data,
        described.complete_access,
        described.fixed,
        described.comment,
        str(described.source),
    )


def _idn_commands(mailbox: EsiMailbox | None) -> tuple[IdnCommand, ...]:
    return tuple(
        IdnCommand(
            each.transitions,
            each.number,
            each.data,
            each.drive,
            comment=each.comment,
            source=str(each.source),
        )
        for each in (() if mailbox is None else mailbox.idn_commands)
    )


def _timeouts(esi: EsiDevice) -> Timeouts:
    """Return the timeouts [s], at most 60 s."""
    given = esi.timeouts
    each = (
        *(given.pre_op, given.safe_op_and_op, given.back_to_init, given.back_to_safe_op),
        *(given.mailbox_request, given.mailbox_response),
    )
    return Timeouts(*(None if ms is None else min(ms / 1000, TIMEOUT_MAX) for ms in each))
