"""Access to devices for a clone: which ones may be written to, states and mailboxes.

Reading an EEPROM or an object needs writes to the device. They are allowed in INIT and PRE-OP only.
What is changed is restored.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from catenary.errors import DecodeError, MailboxError, StateError
from catenary.model.describe import MAILBOX_MIN
from catenary.model.device import DeviceDescription, MailboxLayout
from catenary.procedure.al_state import read_state, request_state, write_control
from catenary.procedure.clone_registers import Present
from catenary.procedure.exchange import Procedure, Request, read, write
from catenary.procedure.mailbox import IN, OUT, MailboxChannel
from catenary.procedure.state_path import climb
from catenary.procedure.station import Station, answered, station_of
from catenary.wire.al import STATE_MASK, AlControl, AlState
from catenary.wire.datagram import EcatCommand
from catenary.wire.frame import MAXIMUM_DATA
from catenary.wire.register import (
    PROCESS_RAM,
    SII_CONFIGURATION,
    sync_manager,
    sync_manager_activation,
)
from catenary.wire.sync_manager import (
    Activation,
    Buffering,
    Direction,
    SyncManager,
    decode_sync_manager,
)

T = TypeVar("T")

WRITABLE = (AlState.INIT, AlState.PRE_OP)
MAILBOX = (OUT, IN)


def is_writable(device: Present) -> bool:
    """Return True if a clone may write to the registers of a device."""
    return device.state in WRITABLE


def require_writable(station: Station, *states: AlState) -> Procedure[None]:
    """Check that a device is still in INIT or PRE-OP, or in one of `states`.

    Args:
        station: The device.
        states: The allowed states.

    Raises:
        StateError: It is in another state.
    """
    found = yield from read_state(station)
    if found.state not in (states or WRITABLE):
        raise left_state(station, found.word & STATE_MASK, found.code)


def while_writable(station: Station, procedure: Procedure[T], *states: AlState) -> Procedure[T]:
    """Run a procedure, and read the state of the device before each access that changes it.

    These are writes, and reads of the process memory, which empty a mailbox. If the state is no
    longer allowed, the procedure ends without another access: not even to restore something.

    Args:
        station: The device.
        procedure: The procedure to run.
        states: The allowed states; INIT and PRE-OP by default.

    Raises:
        StateError: The device is in another state.
    """
    try:
        step = next(procedure)
        while True:
            if any(map(_changes_device, step if isinstance(step, list) else ())):
                yield from require_writable(station, *states)
            step = procedure.send((yield step))
    except StopIteration as stop:
        result: T = stop.value
        return result
    finally:
        procedure.close()


def _changes_device(request: Request) -> bool:
    return request.command.writes or request.address >> 16 >= PROCESS_RAM


def left_state(station: Station, state: int, code: int) -> StateError:
    """Return the error for a device that has left the allowed states.

    Args:
        station: The device.
        state: Its state now.
        code: Its AL status code.
    """
    name = str(AlState(state)) if state in tuple(AlState) else f"state {state}"
    return StateError(
        f"{station} is in {name} now; it is not written to",
        position=station.position,
        requested=int(AlState.PRE_OP),
        actual=state,
        code=code,
        hint="another master changed its state: end that program, then clone again",
    )


@dataclass(frozen=True, slots=True)
class Before:
    """Registers of a device before it was raised from INIT to PRE-OP."""

    station: Station
    sync_managers: tuple[bytes, bytes]
    owner: int  # of the EEPROM


def remember(station: Station) -> Procedure[Before]:
    """Read the registers that a change from INIT to PRE-OP writes."""
    out, back, owner = yield [
        *(read(EcatCommand.FPRD, station.address, sync_manager(k)) for k in MAILBOX),
        read(EcatCommand.FPRD, station.address, SII_CONFIGURATION),
    ]
    managers = (
        answered(out, station, "SyncManager 0"),
        answered(back, station, "SyncManager 1"),
    )
    owned = SII_CONFIGURATION.unpack(answered(owner, station, "EEPROM owner"))
    return Before(station, managers, owned)


def read_eeprom_owner(station: Station) -> Procedure[int]:
    """Read the register that assigns the EEPROM to EtherCAT or to the device's processor."""
    [reply] = yield [read(EcatCommand.FPRD, station.address, SII_CONFIGURATION)]
    return SII_CONFIGURATION.unpack(answered(reply, station, "EEPROM owner"))


def return_eeprom(station: Station, owner: int) -> Procedure[None]:
    """Assign the EEPROM to its owner again, after an interrupted reading.

    Args:
        station: The device.
        owner: Content of the register before the reading.

    Raises:
        StateError: The device is neither in INIT nor in PRE-OP.
    """
    yield from require_writable(station)
    request = write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, owner & 1)
    [reply] = yield [request]
    answered(reply, station, "EEPROM owner")


def raise_to_pre_op(device: DeviceDescription) -> Procedure[MailboxChannel | None]:
    """Bring a device from INIT to PRE-OP, with the mailbox of its SII.

    Args:
        device: Description of the device.

    Raises:
        StateError: The device is not in INIT, or does not reach PRE-OP.
    """
    station = station_of(device)
    yield from require_writable(station, AlState.INIT)
    climbing = climb(station, device, AlState.PRE_OP)
    return (yield from while_writable(station, climbing))


def lower(before: Before) -> Procedure[None]:
    """Bring a device back to INIT, and restore its mailbox and the owner of its EEPROM.

    Args:
        before: Registers before the device was raised.

    Raises:
        StateError: The device is no longer in INIT or PRE-OP, or does not reach INIT.
    """
    yield from while_writable(before.station, _lower(before))


def _lower(before: Before) -> Procedure[None]:
    station = before.station
    # After an interruption, a device that still reports INIT may be on its way to PRE-OP.
    yield from write_control(station, AlControl(AlState.INIT))
    yield from request_state(station, AlState.INIT)
    off = [write(EcatCommand.FPWR, station.address, sync_manager_activation(k), 0) for k in MAILBOX]
    blocks = [
        write(EcatCommand.FPWR, station.address, sync_manager(k), data)
        for k, data in zip(MAILBOX, before.sync_managers, strict=True)
    ]
    owner = write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, before.owner & 1)
    for reply in (yield [*off, *blocks, owner]):
        answered(reply, station, "its registers")


def join_mailbox(device: DeviceDescription, registers: Present) -> MailboxChannel:
    """Return the channel of a mailbox that is already configured, for a device in PRE-OP.

    Args:
        device: Description of the device, with a mailbox.
        registers: Its registers.

    Raises:
        MailboxError: The SyncManagers of the mailbox are not configured, or not possible.
    """
    assert device.mailbox is not None
    out, back = (_manager(registers, k) for k in MAILBOX)
    if not (_is_mailbox(out, Direction.WRITE) and _is_mailbox(back, Direction.READ)):
        raise MailboxError(
            f"{device}: its SyncManagers 0 and 1 are not configured as a mailbox",
            hint="bring it to INIT with `catenary state`, then clone with --pre-op",
        )
    assert out is not None
    assert back is not None
    for length in (out.length, back.length):
        if not MAILBOX_MIN <= length <= MAXIMUM_DATA:
            raise MailboxError(
                f"{device}: its mailbox is configured with {length} bytes, "
                f"which is not possible ({MAILBOX_MIN} to {MAXIMUM_DATA})",
                hint="bring it to INIT with `catenary state`, then clone with --pre-op",
            )
    layout = _at(device.mailbox, out, back)
    return MailboxChannel(station_of(device), layout)


def _manager(registers: Present, number: int) -> SyncManager | None:
    data = registers.blocks.get(sync_manager(number).address)
    try:
        return None if data is None else decode_sync_manager(data)
    except DecodeError:
        return None


def _is_mailbox(manager: SyncManager | None, direction: Direction) -> bool:
    return (
        manager is not None
        and bool(manager.activation & Activation.ENABLE)
        and manager.control.buffering is Buffering.MAILBOX
        and manager.control.direction is direction
    )


def _at(layout: MailboxLayout, out: SyncManager, back: SyncManager) -> MailboxLayout:
    return replace(
        layout,
        receive_offset=out.address,
        receive_size=out.length,
        send_offset=back.address,
        send_size=back.length,
    )
