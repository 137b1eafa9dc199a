"""Reading of one device for a clone: SII, then state and mailbox, then objects."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias, TypeVar

from catenary.errors import CatenaryError, MailboxError
from catenary.line.mapping import mapping_of_objects, mapping_of_sii
from catenary.line.values import SERIAL_WITHHELD, ClonedDevice
from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Identity
from catenary.model.text import printable
from catenary.procedure.clone_access import (
    Before,
    join_mailbox,
    lower,
    raise_to_pre_op,
    read_eeprom_owner,
    remember,
    return_eeprom,
    while_writable,
)
from catenary.procedure.clone_objects import Question, read_dictionary
from catenary.procedure.clone_registers import Present
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sii import read_identity, read_words
from catenary.procedure.sii_owner import with_eeprom
from catenary.procedure.sii_size import Extent, read_extent
from catenary.procedure.station import Station, within
from catenary.wire.al import AlState
from catenary.wire.register import INFORMATION
from catenary.wire.sii import IDENTITY_WORD

T = TypeVar("T")
Progress: TypeAlias = Callable[[str, int, int], None]  # text, done, total

SII_TIMEOUT = 30.0  # [s] per part
SII_PART = 256  # words between two progress reports
SERIAL_PLACE = 2 * (IDENTITY_WORD + 6)  # byte offset of the serial number in the SII
NOT_WRITTEN = "not read: the device is in {state}, and this reading writes to the device"
IN_INIT = "not read: the device is in INIT; --pre-op (pre_op=True) brings it to PRE-OP meanwhile"


class Conversing(Protocol):
    """Part of a MainDevice that this module needs."""

    def converse(self, procedure: Procedure[T]) -> T: ...


@dataclass(frozen=True, slots=True)
class Source:
    """A device, its address (None: it is not written to), and its place in the tree."""

    present: Present
    address: int | None
    parent: int | None
    parent_port: int | None


def silent(text: str, done: int, total: int) -> None:
    """Ignore the progress.

    Args:
        text: What is read.
        done: Number of parts that were read.
        total: Number of parts.
    """


class DeviceClone:
    """Reading of one device. It owns the parts that were read so far."""

    def __init__(
        self,
        main: Conversing,
        source: Source,
        *,
        pre_op: bool,
        serials: bool,
        objects_timeout: float,
        progress: Progress,
    ) -> None:
        self._main = main
        self._source = source
        self._present = source.present
        self._pre_op = pre_op
        self._serials = serials
        self._timeout = objects_timeout
        self._report = progress
        self._missing: dict[str, str] = {}
        self._notes: list[str] = []
        self._names = [str(self._station)]  # of the device, in errors

    @property
    def _station(self) -> Station:
        return Station(self._present.rank, self._source.address or 0)

    def identity(self) -> Identity | None:
        """Read the identity in the SII; None if it cannot be read."""
        if self._source.address is None:
            return None
        try:
            found = self._from_eeprom(read_identity(self._station))
        except CatenaryError:  # the reading of the whole SII reports the reason
            return None
        return found if self._serials else found._replace(serial=0)

    def fits(self, earlier: ClonedDevice, identity: Identity) -> bool:
        """Return True if a finished device of an earlier clone is this device.

        Args:
            earlier: The device in the folder.
            identity: Identity of this device.
        """
        place = (self._source.parent, self._source.parent_port, self._present.alias)
        return (
            earlier.complete
            and earlier.identity == identity
            and (earlier.parent, earlier.parent_port, earlier.alias) == place
            and self._has_wanted_serials(earlier)
        )

    def surpassed(self, device: ClonedDevice, earlier: ClonedDevice) -> bool:
        """Return True if an earlier clone of the device is complete, and this one is not.

        If the identity cannot be read now, the controller and the alias are compared.

        Args:
            device: The device as it was read now.
            earlier: The device in the folder.
        """
        if device.complete or not earlier.complete or not self._has_wanted_serials(earlier):
            return False
        if device.identity is not None:
            return device.identity == earlier.identity
        same = (earlier.information, earlier.alias) == (device.information, device.alias)
        return same and (self._serials or not (earlier.identity and earlier.identity.serial))

    def _has_wanted_serials(self, earlier: ClonedDevice) -> bool:
        reasons = (entry.reason for each in earlier.objects for entry in each.entries)
        return not self._serials or SERIAL_WITHHELD not in reasons

    def read(self) -> ClonedDevice:
        """Read the whole device. Parts that cannot be read are missing, with a reason."""
        image = self._image()
        description = self._description(image)
        device = self._bare(image, description)
        if description is None or not description.coe:
            return self._finished(device, description)
        return self._finished(self._with_objects(device, description), description)

    def _bare(self, image: bytes | None, description: DeviceDescription | None) -> ClonedDevice:
        present = self._present
        device = ClonedDevice(
            position=present.rank,
            name="unknown",
            identity=None,
            station_address=present.station_address,
            alias=present.alias,
            al_status=present.al_status,
            al_status_code=present.al_status_code,
            registers=present.blocks,
            parent=self._source.parent,
            parent_port=self._source.parent_port,
            sii=image,
        )
        if description is None:
            return device
        return replace(
            device,
            name=printable(description.name) or "unknown",
            identity=description.identity,
            order=description.order,
            group=description.group,
            mailbox=description.mailbox,
        )

    def _finished(
        self, device: ClonedDevice, description: DeviceDescription | None
    ) -> ClonedDevice:
        assignments, source = mapping_of_objects(device.objects), "CoE"
        if not assignments and description is not None:
            assignments = mapping_of_sii((*description.outputs, *description.inputs))
            source = "SII"
        return replace(
            device,
            assignments=assignments,
            mapping_source=source if assignments else "",
            missing=dict(self._missing),
            notes=tuple(self._notes),
        )

    def _description(self, image: bytes | None) -> DeviceDescription | None:
        if image is None:
            return None
        present = self._present
        found = describe(
            present.rank,
            station_address=self._station.address,
            alias=present.alias,
            dl_status=present.dl_status,
            information=present.blocks[INFORMATION.address],
            image=image,
        )
        self._notes += found.notes
        self._names.insert(0, str(found))  # the longer one first
        return found

    def _image(self) -> bytes | None:
        """Read the whole SII. Serial numbers are zero if they are left out."""
        if self._source.address is None:
            self._missing["sii"] = self._not_written()
            self._missing["objects"] = self._not_written()
            return None
        try:
            extent = self._from_eeprom(read_extent(self._station))
            image = b"".join(self._parts(extent))
        except CatenaryError as error:
            self._missing["sii"] = self._reason(error)
            self._missing["objects"] = "not read: its SII, which describes its mailbox, is missing"
            return None
        self._notes += [extent.note] if extent.note else []
        if not self._serials:
            image = image[:SERIAL_PLACE] + bytes(4) + image[SERIAL_PLACE + 4 :]
        return image

    def _parts(self, extent: Extent) -> Iterator[bytes]:
        total = extent.size // 2
        for first in range(0, total, SII_PART):
            words = min(SII_PART, total - first)
            yield self._from_eeprom(read_words(self._station, first, words))
            self._report(f"device {self._present.rank}: EEPROM", first + words, total)

    def _from_eeprom(self, procedure: Procedure[T]) -> T:
        """Run a reading of the EEPROM while the device is in INIT or PRE-OP.

        The EEPROM returns to its owner, also after Ctrl-C.
        """
        bounded = within(SII_TIMEOUT, self._station, procedure, "its EEPROM was")
        reading = while_writable(self._station, with_eeprom(self._station, bounded))
        owner = self._main.converse(read_eeprom_owner(self._station))
        try:
            return self._main.converse(reading)
        except KeyboardInterrupt as interrupt:
            try:
                self._main.converse(return_eeprom(self._station, owner))
            except CatenaryError as error:
                interrupt.add_note(f"its EEPROM may be assigned to EtherCAT: {error.message}")
            raise

    def _reason(self, error: CatenaryError) -> str:
        """Return the message of an error on one line, without the device at its start."""
        text = " ".join(error.message.split())
        for name in self._names:
            text = text.removeprefix(name).lstrip(": ")
        return text

    def _not_written(self) -> str:
        state = self._present.state
        number = f"state {self._present.al_status & 0x0F}"
        return NOT_WRITTEN.format(state=number if state is None else state)

    def _with_objects(self, device: ClonedDevice, description: DeviceDescription) -> ClonedDevice:
        if self._present.state is AlState.INIT and not self._pre_op:
            self._missing["objects"] = IN_INIT
            return device
        pdos = tuple(each.index for each in (*description.output_pdos, *description.input_pdos))
        question = Question(pdos, self._serials, self._timeout)

        def report(done: int, total: int) -> None:
            self._report(f"{description}: objects", done, total)

        try:
            with self._mailbox(description) as channel:
                found = self._main.converse(read_dictionary(channel, question, report))
        except CatenaryError as error:
            self._missing["objects"] = self._reason(error)
            return device
        if found.missing:
            self._missing["objects"] = found.missing
        self._notes += found.notes
        raised = self._present.state is AlState.INIT
        return replace(device, objects=found.objects, raised=raised)

    @contextmanager
    def _mailbox(self, description: DeviceDescription) -> Iterator[MailboxChannel]:
        """Yield the mailbox of the device. A device in INIT is raised, and brought back."""
        if self._present.state is AlState.PRE_OP:
            yield join_mailbox(description, self._present)
            return
        before = self._main.converse(remember(self._station))
        try:
            channel = self._main.converse(raise_to_pre_op(description))
            if channel is None:
                raise MailboxError(f"{description} has no mailbox")
            yield channel
        except BaseException as error:
            if reason := self._lower(before):
                error.add_note(f"{description}: {reason}")
            raise
        self._lower(before)

    def _lower(self, before: Before) -> str:
        """Bring the device back to INIT. Return the reason if it fails, else an empty text."""
        try:
            self._main.converse(lower(before))
        except CatenaryError as error:
            self._missing["state"] = f"not brought back to INIT: {self._reason(error)}"
        return self._missing.get("state", "")
