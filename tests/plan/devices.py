"""Descriptions of devices, and of the demo's segment as in its SIIs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Entry,
    Identity,
    MailboxLayout,
    Pdo,
    SyncManager,
)
from catenary.plan.request import DeviceRequest, ImageLayout, ObjectReference, RequestTables, Views
from catenary.wire.features import Feature, Information, PortKind
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

PORTS = (PortKind.MII, PortKind.MII, PortKind.ABSENT, PortKind.ABSENT)
MAILBOX = MailboxLayout(
    0x1000, 128, 0x1080, 128, MailboxProtocol.COE, pdo_assign=True, pdo_configuration=True
)
OUT, IN = SyncManagerUse.OUTPUTS, SyncManagerUse.INPUTS


def controller(*, lrw: bool = True, fmmus: int = 8) -> Information:
    features = Feature(0) if lrw else Feature.NO_LRW
    return Information(0x11, 0, 2, fmmus, 8, 8, PORTS, features)


def device(
    position: int,
    name: str,
    *,
    outputs: tuple[Pdo, ...] = (),
    inputs: tuple[Pdo, ...] = (),
    sync_managers: tuple[SyncManager, ...] = (),
    mailbox: MailboxLayout | None = None,
    lrw: bool = True,
    fmmus: int = 8,
) -> DeviceDescription:
    return DeviceDescription(
        position=position,
        station_address=0x1001 + position,
        alias=0,
        identity=Identity(0x1234, position, 1, 0),
        name=name,
        controller=controller(lrw=lrw, fmmus=fmmus),
        mailbox=mailbox,
        sync_managers=sync_managers,
        outputs=assigned(outputs),
        inputs=assigned(inputs),
        output_pdos=outputs,
        input_pdos=inputs,
    )


def assigned(pdos: tuple[Pdo, ...]) -> tuple[Assignment, ...]:
    channels = sorted({pdo.sync_manager for pdo in pdos if pdo.sync_manager is not None})
    return tuple(
        Assignment(channel, tuple(pdo for pdo in pdos if pdo.sync_manager == channel))
        for channel in channels
    )


def coupler(position: int) -> DeviceDescription:
    return device(position, "Coupler")


def lamps(position: int, *, lrw: bool = True) -> DeviceDescription:
    """Four outputs of one bit."""
    pdos = tuple(
        Pdo(0x1600 + k, (Entry(0x7000 + 16 * k, 1, 1, "Output", 1),), 0, fixed=True)
        for k in range(4)
    )
    channel = SyncManager(0, OUT, 0x0F00, 1, 0x44)
    return device(position, "Lamps", outputs=pdos, sync_managers=(channel,), lrw=lrw)


SERVO_OUTPUTS = (
    Entry(0x6040, 0, 16, "Controlword", 6),
    Entry(0x6060, 0, 8, "Mode", 2),
    Entry(0x60FF, 0, 32, "Target velocity", 4),
    Entry(0x607A, 0, 32, "Target position", 4),
    Entry(0x6071, 0, 16, "Target torque", 3),
)
SERVO_INPUTS = (
    Entry(0x6041, 0, 16, "Statusword", 6),
    Entry(0x6061, 0, 8, "Mode display", 2),
    Entry(0x606C, 0, 32, "Velocity", 4),
    Entry(0x6064, 0, 32, "Position", 4),
    Entry(0x6077, 0, 16, "Torque", 3),
)


def servo(
    position: int, *, fixed: bool = False, lrw: bool = True, coe: bool = True
) -> DeviceDescription:
    """The 13 + 13 bytes of `facts/reference_tables.md` section 1."""
    channels = (
        SyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, 0x26),
        SyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 128, 0x22),
        SyncManager(2, OUT, 0x1100, 13, 0x64),
        SyncManager(3, IN, 0x1400, 13, 0x20),
    )
    return device(
        position,
        "Servo",
        outputs=(Pdo(0x1600, SERVO_OUTPUTS, 2, fixed=fixed),),
        inputs=(Pdo(0x1A00, SERVO_INPUTS, 3, fixed=fixed),),
        sync_managers=channels,
        mailbox=MAILBOX if coe else None,
        lrw=lrw,
    )


def block(position: int, *, outputs: int, inputs: int) -> DeviceDescription:
    """Bytes of outputs and inputs, in adjacent SyncManagers."""
    pdos = [
        Pdo(index, tuple(Entry(index + 0x5A00, k % 255 + 1, 8, "", 5) for k in range(size)), number)
        for index, number, size in ((0x1600, 2, outputs), (0x1A00, 3, inputs))
    ]
    channels = (
        SyncManager(2, OUT, 0x1000, outputs, 0x64),
        SyncManager(3, IN, 0x2000, inputs, 0x20),
    )
    return device(
        position,
        "Block",
        outputs=(pdos[0],) if outputs else (),
        inputs=(pdos[1],) if inputs else (),
        sync_managers=channels,
    )


def demo() -> list[DeviceDescription]:
    """Coupler, lamps, three servos, lamps."""
    return [coupler(0), lamps(1), servo(2), servo(3), servo(4), lamps(5)]


@dataclass
class Asking:
    """A request that only asks."""

    asked: Mapping[int, DeviceRequest] = field(default_factory=dict)

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        return self.asked

    def tables(self, layout: ImageLayout) -> RequestTables:
        return RequestTables()

    def bind(self, views: Views) -> None:
        raise AssertionError("nobody runs this")


def asks(
    position: int,
    *,
    outputs: tuple[tuple[int, int, int], ...] = (),
    inputs: tuple[tuple[int, int, int], ...] = (),
) -> Asking:
    """Objects as (index, subindex, bits)."""
    return Asking(
        {
            position: DeviceRequest(
                tuple(ObjectReference(*each) for each in outputs),
                tuple(ObjectReference(*each) for each in inputs),
            )
        }
    )
