"""DeviceDiagnosis: messages of a device's diagnosis history, and its synchronisation counters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol, TypeVar

from catenary.bus.sdo import ObjectOwner, Sdo
from catenary.errors import DecodeError, MailboxError, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.procedure.sdo import OBJECT_MISSING
from catenary.wire.diagnosis_history import ACKNOWLEDGED, CLEAR, HISTORY

if TYPE_CHECKING:
    from catenary.model.diagnosis_history import HistoryMessage, RawHistory, SyncCounters

T = TypeVar("T")


class DiagnosedDevice(ObjectOwner, Protocol):
    """Interface to the device of a diagnosis; `SubDevice` implements it."""

    @property
    def sdo(self) -> Sdo: ...


class DeviceDiagnosis:
    """Diagnosis of one device, as it reports itself: `sub.diagnosis`.

        for message in sub.diagnosis.messages():
            print(message)
        sub.diagnosis.acknowledge()

    The calls read or write objects: 0x10F3, 0x10F8, 0x1C32 and 0x1C33. They wait for the answer,
    like `sub.sdo.read`. Texts come from the ESI file of the device.
    """

    def __init__(self, sub: DiagnosedDevice) -> None:
        self._sub = sub

    def messages(self) -> tuple[HistoryMessage, ...]:
        """Read all messages of the diagnosis history, oldest first.

        Reading the newest message clears the device's flag for new messages.

        Raises:
            SdoAbort: The device refuses an object.
            DecodeError: The device reports an impossible number.
            MailboxError: The device has no diagnosis history, or no object dictionary.
        """
        from catenary.model.diagnosis_history import described

        found = self._history()
        texts = self.texts
        return tuple(described(each, texts, found.now_ns) for each in found.messages)

    def acknowledge(self, newest: HistoryMessage | None = None) -> None:
        """Acknowledge a message and all older ones, so that the device may overwrite them.

        Args:
            newest: Newest message to acknowledge; None: all present messages, also those that have
                arrived after `messages`.

        Raises:
            SdoAbort: The device refuses the value.
            MailboxError: The device has no diagnosis history, or no object dictionary.
        """
        from catenary.procedure.diagnosis_history import read_newest

        if newest is not None:
            self._write(newest.subindex)
            return
        subindex = self._converse(read_newest(self._sub.sdo.upload_small))
        if subindex:
            self._write(subindex)

    def clear(self) -> None:
        """Delete the messages: all of them, or the acknowledged ones in the acknowledge mode.

        Raises:
            SdoAbort: The device refuses the value.
            MailboxError: The device has no diagnosis history, or no object dictionary.
        """
        self._write(CLEAR)

    def synchronisation(self) -> tuple[SyncCounters, ...]:
        """Read the counters of synchronisation errors, outputs first; empty without counters.

        Raises:
            MailboxError: The device has no object dictionary.
        """
        from catenary.procedure.diagnosis_history import read_sync_counters

        return self._sub.main.converse(read_sync_counters(self._sub.sdo.upload_small))

    @property
    def texts(self) -> Mapping[int, str]:
        """Texts of messages by text ID, from the ESI file; empty without one."""
        esi = self._sub.esi
        return {} if esi is None else esi.diagnosis_texts

    def _history(self) -> RawHistory:
        from catenary.procedure.diagnosis_history import read_history

        return self._converse(read_history(self._sub.sdo.upload_small))

    def _write(self, value: int) -> None:
        self._converse(self._sub.sdo.download(HISTORY, ACKNOWLEDGED, bytes((value,))))

    def _converse(self, procedure: Procedure[T]) -> T:
        """Run a procedure. Raises MailboxError if the device does not have the object."""
        try:
            return self._sub.main.converse(procedure)
        except DecodeError as error:
            raise DecodeError(f"{self._sub.station}: {error.message}", hint=error.hint) from error
        except SdoAbort as error:
            if error.code in OBJECT_MISSING and error.index == HISTORY:
                raise MailboxError(
                    f"{self._sub.station} has no diagnosis history (object 0x10F3)",
                    hint="emergencies and `catenary diag` report faults of other devices",
                ) from error
            raise
