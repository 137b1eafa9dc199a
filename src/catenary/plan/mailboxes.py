"""Mailbox-full bits of the devices in the cyclic data.

One bit per device is mapped by a spare FMMU: "mailbox full" in the status of SyncManager 1 (0x080D
bit 3). SOEM maps the whole byte into the group's inputs (ec_config.c). KickCAT maps a bit (bus.cc).
TwinCAT uses its "SyncM status" FMMU. IgH and others poll the register.

The bits have their own datagram. A register answers in every state. In the datagram of the process
data, its answer would increment the working counter and could hide missing inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from catenary.model.device import DeviceDescription
from catenary.plan.cycle import Bank, Column, Number, NumberKind
from catenary.plan.layout import Layout, MailboxFmmu
from catenary.wire.features import Feature

LOGICAL_START = 0x0000_8000  # below the process data
WORD = 32  # bits of a column


@dataclass(frozen=True, slots=True)
class MailboxArea:
    """Mailbox bits in the image of inputs. Bit k belongs to the device at position `devices[k]`."""

    devices: tuple[int, ...]
    input_offset: int  # bytes
    logical_start: int = LOGICAL_START

    @property
    def size(self) -> int:
        """Size in bytes."""
        return (len(self.devices) + 7) // 8

    @property
    def columns(self) -> tuple[Column, ...]:
        """Integer columns, each with the bits of up to 32 devices, in the order of `devices`."""
        return tuple(
            Column(
                "mailboxes",
                Number(
                    8 * self.input_offset + first,
                    min(WORD, len(self.devices) - first),
                    NumberKind.UNSIGNED,
                ),
                Bank.INTEGER,
                self.devices[first],
                sync_unit=-1,
            )
            for first in range(0, len(self.devices), WORD)
        )


def with_mailboxes(
    layout: Layout, devices: Sequence[DeviceDescription]
) -> tuple[Layout, MailboxArea]:
    """Return the layout with the mailbox bits at the end of the inputs, and their area.

    Each device with a mailbox and a spare bit-wise FMMU has a bit.

    Args:
        layout: Layout of the process data.
        devices: All devices, by position.
    """
    able = tuple(
        device.position for device in devices if _can_map(device, len(_fmmus(layout, device)))
    )
    area = MailboxArea(able, layout.input_size)
    bits = {
        position: MailboxFmmu(len(layout.devices[position].fmmus), 8 * LOGICAL_START + bit)
        for bit, position in enumerate(able)
    }
    places = tuple(replace(place, mailbox=bits.get(place.position)) for place in layout.devices)
    return replace(layout, devices=places, input_size=layout.input_size + area.size), area


def _fmmus(layout: Layout, device: DeviceDescription) -> Sequence[object]:
    return layout.devices[device.position].fmmus


def _can_map(device: DeviceDescription, used: int) -> bool:
    if device.mailbox is None or used >= device.controller.fmmu_count:
        return False
    return not device.controller.features & Feature.FMMU_BYTE_ORIENTED
