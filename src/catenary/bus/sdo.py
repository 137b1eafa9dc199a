"""Sdo: access to the object dictionary of one device, before and during a loop."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol, TypeAlias, TypeVar, overload

from catenary.bus.pending import Pending
from catenary.bus.runner import Watch
from catenary.errors import CatenaryError, MailboxError, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import (
    SMALL_LIMIT,
    SMALL_TIMEOUT,
    UPLOAD_LIMIT,
    UPLOAD_TIMEOUT,
    download,
    upload,
)
from catenary.procedure.sdo_information import DescribedObject, describe_object, list_objects
from catenary.procedure.station import Station, within
from catenary.types import DataType
from catenary.wire.sdo_information import ListType, ObjectDescription

if TYPE_CHECKING:  # a scan without ESI files does not need them
    from catenary.esi.device import EsiDevice

T = TypeVar("T")

EACH_TIMEOUT = 60.0  # [s] to read all objects of one device before a loop

Objects: TypeAlias = dict[tuple[int, int], bytes]  # by index and subindex


class Conversations(Protocol):
    """Interface to run procedures; `MainDevice` implements it."""

    def converse(self, procedure: Procedure[T], watch: Watch | None = None) -> T:
        """Run a procedure to its end, with or without a running loop.

        Args:
            procedure: The procedure to run.
            watch: Function that is called in this thread while it waits.
        """
        ...

    def request(self, procedure: Procedure[T]) -> Pending[T]:
        """Start a procedure. Wait for its end only if no loop runs."""
        ...


class MailboxOwner(Protocol):
    """Interface to a device with a mailbox; `SubDevice` implements it."""

    @property
    def main(self) -> Conversations: ...

    @property
    def station(self) -> Station: ...

    @property
    def channel(self) -> MailboxChannel | None: ...

    @property
    def in_boot(self) -> bool: ...

    @property
    def error(self) -> CatenaryError | None: ...


class ObjectOwner(MailboxOwner, Protocol):
    """Interface to the device of an object dictionary."""

    @property
    def esi(self) -> EsiDevice | None: ...


class Sdo:
    """Access to the object dictionary of one device.

    Example: `sub.sdo.read(0x1018, 1, type=UDINT)`.

    `read` and `write` wait for the answer. While a loop runs, any thread except the iterating one
    may call them. The iterating thread uses `request` and `request_write`, which do not wait.

    `type` is a type of `catenary.types`; without it, values are bytes. `complete` transfers all
    subindices at once, from `subindex` 0 or 1 on. Subindex 0 then has 16 bits. See `types.Array`
    and `types.Record`.
    """

    def __init__(self, sub: ObjectOwner) -> None:
        self._sub = sub
        self.notes: tuple[str, ...] = ()  # objects missing in the last `list`

    @overload
    def read(
        self,
        index: int,
        subindex: int = 0,
        *,
        complete: bool = False,
        limit: int = UPLOAD_LIMIT,
        timeout: float = UPLOAD_TIMEOUT,
    ) -> bytes: ...
    @overload
    def read(
        self,
        index: int,
        subindex: int = 0,
        *,
        type: DataType[T],
        complete: bool = False,
        limit: int = UPLOAD_LIMIT,
        timeout: float = UPLOAD_TIMEOUT,
    ) -> T: ...
    def read(
        self,
        index: int,
        subindex: int = 0,
        *,
        type: DataType[T] | None = None,
        complete: bool = False,
        limit: int = UPLOAD_LIMIT,
        timeout: float = UPLOAD_TIMEOUT,
    ) -> T | bytes:
        """Read an object: bytes, or its value if a `type` is given.

        Args:
            index: Index of the object.
            subindex: Subindex of the object.
            type: Type of the value; None returns bytes.
            complete: Read all subindices from `subindex` on.
            limit: Largest accepted size [bytes].
            timeout: Longest time of a transfer in several segments [s].

        Raises:
            SdoAbort: The device refuses the transfer.
            DecodeError: The bytes are not a value of the type.
            MailboxError: The object is longer than `limit`, or takes longer than `timeout`; or the
                device has no object dictionary.
            ValueError: The index or the subindex is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        asked = self._upload(index, subindex, complete, limit, timeout)
        if type is None:
            return self._sub.main.converse(asked)
        return self._sub.main.converse(_decoded(asked, type))

    @overload
    def write(self, index: int, subindex: int, value: bytes, *, complete: bool = False) -> None: ...
    @overload
    def write(
        self, index: int, subindex: int, value: T, *, type: DataType[T], complete: bool = False
    ) -> None: ...
    def write(
        self,
        index: int,
        subindex: int,
        value: object,
        *,
        type: DataType[T] | None = None,
        complete: bool = False,
    ) -> None:
        """Write an object: bytes, or a value if a `type` is given.

        Args:
            index: Index of the object.
            subindex: Subindex of the object.
            value: Bytes, or a value of the type.
            type: Type of the value; None if `value` is bytes.
            complete: Write all subindices from `subindex` on.

        Raises:
            SdoAbort: The device refuses the transfer.
            MailboxError: The device has no object dictionary.
            TypeError: `value` is neither bytes nor a value of the type.
            ValueError: The index, the subindex or the value is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        self._sub.main.converse(self._download(index, subindex, value, type, complete))

    @overload
    def request(
        self,
        index: int,
        subindex: int = 0,
        *,
        complete: bool = False,
        limit: int = UPLOAD_LIMIT,
        timeout: float = UPLOAD_TIMEOUT,
    ) -> Pending[bytes]: ...
    @overload
    def request(
        self,
        index: int,
        subindex: int = 0,
        *,
        type: DataType[T],
        complete: bool = False,
        limit: int = UPLOAD_LIMIT,
        timeout: float = UPLOAD_TIMEOUT,
    ) -> Pending[T]: ...
    def request(
        self,
        index: int,
        subindex: int = 0,
        *,
        type: DataType[T] | None = None,
        complete: bool = False,
        limit: int = UPLOAD_LIMIT,
        timeout: float = UPLOAD_TIMEOUT,
    ) -> Pending[T] | Pending[bytes]:
        """Read an object while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` raises the error, if any. The arguments are those of `read`. Without a loop, the
        call waits for the answer.
        """
        asked = self._upload(index, subindex, complete, limit, timeout)
        if type is None:
            return self._sub.main.request(asked)
        return self._sub.main.request(_decoded(asked, type))

    @overload
    def request_write(
        self, index: int, subindex: int, value: bytes, *, complete: bool = False
    ) -> Pending[None]: ...
    @overload
    def request_write(
        self, index: int, subindex: int, value: T, *, type: DataType[T], complete: bool = False
    ) -> Pending[None]: ...
    def request_write(
        self,
        index: int,
        subindex: int,
        value: object,
        *,
        type: DataType[T] | None = None,
        complete: bool = False,
    ) -> Pending[None]:
        """Write an object while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` raises the error, if any. The arguments are those of `write`. Without a loop, the
        call waits for the answer.
        """
        return self._sub.main.request(self._download(index, subindex, value, type, complete))

    def list(self, kind: ListType = ListType.ALL) -> tuple[ObjectDescription, ...]:
        """Read the descriptions of all objects of a kind, by index (SDO information).

        The device is queried once per object. If the device lists an object without describing it,
        only the index is known, and `object_code` is 0. `notes` names these objects, and the
        missing part of a truncated list. Without SDO information, the objects are those of the ESI.

        Raises:
            SdoAbort: The device refuses the list.
            MailboxError: The device does not support SDO information.
        """
        self.notes = ()
        channel, esi = self._channel(), self._sub.esi
        if esi is not None and not channel.layout.sdo_information:
            from catenary.bus.esi_objects import list_esi_objects

            self.notes = (f"{self._sub.station} has no SDO information: objects of {esi.source}",)
            return list_esi_objects(esi, kind)
        found, self.notes = self._sub.main.converse(list_objects(channel, kind))
        return found

    def describe(self, index: int) -> DescribedObject:
        """Read the description of one object and its entries: types, lengths, access and names.

        The `notes` of the result name the entries that the device does not describe. Without SDO
        information, the description is that of the ESI.
        """
        channel, esi = self._channel(index), self._sub.esi
        if esi is not None and not channel.layout.sdo_information:
            from catenary.bus.esi_objects import describe_esi_object

            known = describe_esi_object(esi, index)
            if known is not None:
                return known
        return self._sub.main.converse(describe_object(channel, index))

    def upload_small(self, index: int, subindex: int) -> Procedure[bytes]:
        """Return the procedure that reads an object with few bytes, for other procedures."""
        return self._upload(index, subindex, False, SMALL_LIMIT, SMALL_TIMEOUT)

    def download(self, index: int, subindex: int, data: bytes) -> Procedure[None]:
        """Return the procedure that writes an object, for other procedures."""
        return self._download(index, subindex, data, None, False)

    def _upload(
        self, index: int, subindex: int, complete: bool, limit: int, timeout: float
    ) -> Procedure[bytes]:
        channel = self._channel(index, subindex, complete)
        return upload(
            channel, index, subindex, complete_access=complete, limit=limit, timeout=timeout
        )

    def _download(
        self, index: int, subindex: int, value: object, type: DataType[T] | None, complete: bool
    ) -> Procedure[None]:
        channel = self._channel(index, subindex, complete)
        data = value if type is None else type.encode(value)  # type: ignore[arg-type]
        if not isinstance(data, bytes):
            raise TypeError(f"{value!r} is not bytes: give its type, as type=catenary.types.UDINT")
        return download(channel, index, subindex, data, complete_access=complete)

    def _channel(self, index: int = 0, subindex: int = 0, complete: bool = False) -> MailboxChannel:
        if not 0 <= index <= 0xFFFF or not 0 <= subindex <= 0xFF:
            raise ValueError(f"object 0x{index:X}:{subindex:X}: an index has 16 bits, a subindex 8")
        if complete and subindex > 1:
            raise ValueError(f"complete access begins with subindex 0 or 1, not {subindex}")
        channel = self._sub.channel
        if self._sub.in_boot:
            raise MailboxError(
                f"{self._sub.station} is in BOOT, which has no object dictionary",
                hint='bring it to PRE-OP: sub.request_state("PREOP")',
            )
        if self._sub.error is not None:
            raise self._sub.error
        if channel is None or not channel.layout.coe:
            what = "has no mailbox" if channel is None else "does not support CoE"
            raise MailboxError(
                f"{self._sub.station} {what}: cannot access object 0x{index:04X}:{subindex:02X}",
                hint="couplers and simple terminals have no object dictionary",
            )
        return channel


def read_each(sdo: Sdo, places: Sequence[tuple[int, int]]) -> Procedure[Objects]:
    """Read objects one after the other, and return their bytes. Refused objects are omitted.

    Args:
        sdo: Access to the device.
        places: (index, subindex) of each object.
    """
    reading = _read_each(sdo._channel(), places)
    return (yield from within(EACH_TIMEOUT, sdo._sub.station, reading, "its settings were"))


def _read_each(channel: MailboxChannel, places: Sequence[tuple[int, int]]) -> Procedure[Objects]:
    found: Objects = {}
    for index, subindex in places:
        with suppress(SdoAbort):
            found[index, subindex] = yield from upload(channel, index, subindex)
    return found


def _decoded(asked: Procedure[bytes], type: DataType[T]) -> Procedure[T]:
    return type.decode((yield from asked))
