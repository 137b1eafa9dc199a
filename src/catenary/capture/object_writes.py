"""Objects that a master wrote to a device during its bring-up, and the values that it read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

from catenary.capture.bring_up import BringUp
from catenary.capture.difference import Topic, level
from catenary.capture.events import Step
from catenary.capture.mailbox_contents import MailboxMessage, SdoTransfer
from catenary.capture.mapping_objects import entries, is_mapping
from catenary.capture.text import value_text
from catenary.wire.al import AlState
from catenary.wire.mailbox import Type

Place: TypeAlias = tuple[str, int, int]
"""Protocol, index and subindex: 0x100 for a complete access from subindex 0, 0x101 from 1."""

_COMPLETE = 0x100
_SYNC_OBJECTS = (0x1C32, 0x1C33)  # mode and cycle time of the outputs and the inputs
_PROTOCOLS = {Type.SOE: "SoE", Type.FOE: "FoE"}
_REQUESTS = ("write request",)  # of SoE and FoE: the services that change a device


@dataclass(frozen=True, slots=True)
class ObjectWrite:
    """One written value. `abort` is the abort code; None if there was no abort."""

    place: Place
    data: bytes
    step: Step
    packet: int
    abort: int | None = None
    answered: bool = True
    text: str = ""  # of another protocol than CoE

    @property
    def index(self) -> int:
        """Index of the object."""
        return self.place[1]

    @property
    def subindex(self) -> int:
        """Subindex of the object."""
        return self.place[2] % _COMPLETE

    @property
    def complete(self) -> bool:
        """True for a complete access that is not divided into subindices."""
        return self.place[2] >= _COMPLETE

    @property
    def succeeded(self) -> bool:
        """True if the device accepted the value."""
        return self.answered and self.abort is None

    @property
    def topic(self) -> Topic:
        """The part of the configuration to which the object belongs."""
        if is_mapping(self.index):
            return Topic.MAPPING
        return Topic.SYNC_OBJECT if self.index in _SYNC_OBJECTS else Topic.OBJECT

    @property
    def name(self) -> str:
        """Index and subindex, such as 0x1C12:01."""
        if self.text:
            return self.text
        complete = " complete" if self.complete else ""
        return f"0x{self.index:04X}:{self.subindex:02X}{complete}"

    @property
    def value(self) -> tuple[bytes, int | None, bool]:
        """Data and answer, which are compared."""
        return self.data, self.abort, self.answered

    def __str__(self) -> str:
        if self.text:
            return self.text
        text = f"{self.name} = {value_of(self.data)}"
        if self.abort is not None:
            text += f" aborted 0x{self.abort:08X}"
        return text if self.answered else f"{text} not answered"


@dataclass(frozen=True, slots=True)
class Objects:
    """The writes in their order, and the last values of each object.

    `written` has the values that the device accepted, `known` also those that it returned.
    """

    writes: tuple[ObjectWrite, ...]
    written: dict[Place, bytes]
    known: dict[Place, bytes]


def objects_of(bring_up: BringUp, limit: int) -> Objects:
    """Return the objects of a device.

    Args:
        bring_up: The bring-up of the device.
        limit: Rank of the highest state in which a write counts.
    """
    writes: list[ObjectWrite] = []
    known: dict[Place, bytes] = {}
    for number, event in enumerate(bring_up.events):
        content = event.content
        in_bring_up = number >= bring_up.first and level(event.step.before) <= limit
        if isinstance(content, SdoTransfer):
            found = list(_written(content, _step(event.step), event.packet))
            if content.succeeded:
                known.update((each.place, each.data) for each in found)
            if content.writes and in_bring_up:
                writes += found
        elif isinstance(content, MailboxMessage) and in_bring_up:
            writes += _other(content, event.step, event.packet)
    written = {each.place: each.data for each in writes if each.succeeded}
    return Objects(tuple(writes), written, known)


def _written(transfer: SdoTransfer, step: Step, packet: int) -> Iterable[ObjectWrite]:
    divided = transfer.complete_access and is_mapping(transfer.index)
    for subindex, data in entries(transfer):
        place = subindex + _COMPLETE * (transfer.complete_access and not divided)
        yield ObjectWrite(
            ("CoE", transfer.index, place),
            *(data, step, packet, transfer.abort, transfer.answered),
        )


def _other(message: MailboxMessage, step: Step, packet: int) -> Iterable[ObjectWrite]:
    """Yield the write request of another protocol. The capture has its name, not its value."""
    protocol = _PROTOCOLS.get(message.protocol)
    if protocol and message.to_device and message.text.startswith(_REQUESTS):
        text = f"{protocol} {message.text}"
        yield ObjectWrite((text, 0, 0), b"", step, packet, text=text)


def _step(step: Step) -> Step:
    """Return the step of an SDO: it needs PRE-OP, also if the capture shows the state later."""
    if step.before is AlState.INIT and step.after is AlState.PRE_OP:
        return Step(AlState.PRE_OP, AlState.PRE_OP)
    return step


def value_of(data: bytes) -> str:
    """Return a value as text: decimal for one byte."""
    return str(data[0]) if len(data) == 1 else value_text(data)
