"""Policy: the accesses that the gateway allows.

Without permission, only SDO uploads, SDO information and FoE reads pass. Permission for a device
allows all accesses, except those that are dangerous while an axis is enabled. A mailbox message
cannot change a state, so that BOOT needs no rule: in BOOT, a device has files only.
"""

from __future__ import annotations

from collections.abc import Iterable

from catenary.bus import MainDevice, SubDevice
from catenary.gateway.exchange import read_axis_states
from catenary.gateway.refusal import Reason, Refusal
from catenary.gateway.request import Access, Request
from catenary.gateway.transfer import Transfer
from catenary.model.device import DeviceDescription
from catenary.model.process_data import mapped_entries
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.wire.cia402 import POWERED
from catenary.wire.mailbox import Type
from catenary.wire.sii import MailboxProtocol

# Mappings of RxPDOs and TxPDOs (0x16xx, 0x1Axx and the ranges after them), and their assignment
MAPPING = ((0x1600, 0x17FF), (0x1A00, 0x1BFF), (0x1C10, 0x1C2F))
FIRST_AXIS, LAST_AXIS, SLOT = 0x6000, 0xDFFF, 0x800  # objects of the axes of a device
CONTROLWORD, MODE = 0x6040, 0x6060  # of the first axis


class Policy:
    """Permissions of a gateway, and its rules while an axis is enabled."""

    def __init__(self, main: MainDevice, writable: Iterable[int]) -> None:
        """Initialise the policy.

        Args:
            main: The MainDevice.
            writable: Positions of the devices to which clients may write. The permission ends if a
                scan finds another device there.
        """
        self._main = main
        self._writable = {position: main.subs[position].identity for position in writable}

    def refusal(
        self, sub: SubDevice, channel: MailboxChannel, request: Request, transfer: Transfer | None
    ) -> Procedure[Refusal | None]:
        """Return the refusal of a message; None if it may pass.

        The caller must have the turn in the queue of the mailbox.

        Args:
            sub: The device.
            channel: Its mailbox.
            request: The message.
            transfer: Transfer that the message continues or ends; None if it begins one.
        """
        if request.access is Access.END or is_read(request, transfer):
            return None
        if not self.permits(sub):
            text = f"{request.what}: write access is not enabled for this device"
            return Refusal(Reason.NOT_ALLOWED, text)
        if not is_dangerous(request, transfer, sub.description):
            return None
        # Within a transfer, reading the statusword would end it
        unknown = None if transfer is not None else (yield from self._not_at_rest(sub, channel))
        why = unknown or self._powered()
        return None if why is None else Refusal(Reason.AXIS_ENABLED, f"{request.what}: {why}")

    def permits(self, sub: SubDevice) -> bool:
        """Return True if clients may write to a device. New firmware may change its revision."""
        known = self._writable.get(sub.position)
        if known is None:
            return False
        return known.same_kind(sub.identity) and known.serial == sub.identity.serial

    def _powered(self) -> str | None:
        """Return the reason if the loop has enabled an axis, or does not know it."""
        axes = self._main.powered_axes
        if axes:
            return f"{', '.join(axes)} enabled; disable all axes first"
        if axes is None and self._main.has_loop:
            return "the loop does not report its axes"
        return None

    def _not_at_rest(self, sub: SubDevice, channel: MailboxChannel) -> Procedure[str | None]:
        """Return the reason if the device itself reports power, or its state is not known."""
        slots = axis_slots(sub.description)
        if not slots:
            serves_soe = MailboxProtocol.SOE in channel.layout.protocols
            return "a SERCOS drive in a loop" if serves_soe and self._main.has_loop else None
        if sub.in_boot:
            return None  # in BOOT, a drive has no power stage and no objects
        states = yield from read_axis_states(channel, slots)
        if None in states:
            return "the state of its axes (0x6041) cannot be read"
        powered = [state.name for state in states if state in POWERED and state is not None]
        return f"an axis is in {powered[0]}; disable it first" if powered else None


def is_read(request: Request, transfer: Transfer | None) -> bool:
    """Return True if a message only reads.

    Args:
        request: Message of a client.
        transfer: Transfer that the message continues or ends; None if there is none.
    """
    if request.access in (Access.CONTINUE, Access.END):
        return transfer is not None and not transfer.writes
    return request.access is Access.READ


def is_dangerous(request: Request, transfer: Transfer | None, device: DeviceDescription) -> bool:
    """Return True if a message must not pass while an axis is enabled.

    The subindex does not count: complete access writes several of them.

    Args:
        request: Message of a client.
        transfer: Transfer that the message continues; None if there is none.
        device: Description of the device, with its present mapping.
    """
    if is_read(request, transfer) or request.access is Access.END:
        return False
    first = request if transfer is None else transfer.first
    if first.index is None or first.message.type is not Type.COE:
        return True  # files, and messages that are not parsed
    return controls_motion(first.index, device)


def controls_motion(index: int, device: DeviceDescription) -> bool:
    """Return True if an object controls an axis, or belongs to the process data or their mapping.

    Args:
        index: Index of the object.
        device: Description of the device, with its present mapping.
    """
    if any(first <= index <= last for first, last in MAPPING):
        return True
    if FIRST_AXIS <= index <= LAST_AXIS and index % SLOT in (CONTROLWORD % SLOT, MODE % SLOT):
        return True
    mapped = mapped_entries((*device.outputs, *device.inputs))
    return any(entry.index == index for entry in mapped)


def axis_slots(device: DeviceDescription) -> tuple[int, ...]:
    """Return the slots of the axes of a device.

    A device that does not state its profile has one axis if it receives a controlword. Further
    slots do not count then: 0x7040 is also an output of the channel 4 of a terminal (ETG.5001).
    """
    receives = any(entry.index == CONTROLWORD for entry in mapped_entries(device.outputs))
    return device.slots or ((0,) if receives else ())
