"""Base class of devices with a microcontroller: servos and analogue terminals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from catenary.virtual.coe.diagnosis_history import SEVERITIES, double_word
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import ClockBits, Crystal
from catenary.virtual.description import Description
from catenary.virtual.devices.application import Application, mailbox_of
from catenary.virtual.devices.device import Device
from catenary.virtual.foe.options import DeviceFiles
from catenary.virtual.foe.store import FileStore
from catenary.virtual.protocols import MailboxProtocol
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import SiiQuirks

PARAMETERS_MAX = 8  # of a diagnosis message


@dataclass(frozen=True, slots=True)
class MailboxOptions:
    """Mailbox of a device. The constructor raises ValueError if a value is out of range."""

    size: int = 128  # size of the mailbox in each direction [bytes]
    delay: float = 300e-6  # time until a request is answered [s]
    quirks: MailboxQuirks = NO_MAILBOX_QUIRKS
    files: DeviceFiles | None = None  # None: the device does not support FoE
    protocols: Sequence[MailboxProtocol] = ()  # beside CoE and FoE

    def __post_init__(self) -> None:
        if not 32 <= self.size <= 1024 or self.size % 2:
            raise ValueError(f"mailbox_bytes must be an even number, 32 to 1024, not {self.size}")
        if not 0 <= self.delay <= 10:
            raise ValueError(f"mailbox_delay must be 0 to 10 s, not {self.delay} s")


class AppliedDevice(Device):
    """A virtual device with an application: a mailbox and an object dictionary."""

    def __init__(
        self,
        *,
        name: str,
        alias: int,
        serial: int,
        lrw: bool,
        crystal: Crystal,
        clock_bits: ClockBits,
        sii_quirks: SiiQuirks,
        mailbox: MailboxOptions = MailboxOptions(),
    ) -> None:
        super().__init__(
            name=name,
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=sii_quirks,
        )
        self.mailbox_bytes = mailbox.size
        self.mailbox_quirks = mailbox.quirks
        self._mailbox_delay_ns = round(mailbox.delay * 1e9)
        self.files = mailbox.files
        self.protocols = tuple(mailbox.protocols)
        self._store: FileStore | None = None  # made when the device starts for the first time
        self._application: Application | None = None

    @property
    def application(self) -> Application:
        if self._application is None:
            raise ValueError(f"{self.name} is not in a segment; add it with Segment([...])")
        return self._application

    @property
    def store(self) -> FileStore:
        """Stored files. Raises ValueError if the device has none, or is not in a segment."""
        if self._store is None:
            raise ValueError(f"{self.name} has no files, or is not in a segment")
        return self._store

    def whole_description(self) -> Description:
        """Return the description with all protocols, and the bootstrap mailbox for files."""
        found = super().whole_description()
        if self.protocols:
            numbers = tuple(each.number for each in self.protocols)
            variant = f"{found.sii_variant} protocols {numbers}"
            found = replace(found, protocols=numbers, sii_variant=variant)
        if self.files is None:
            return found
        chosen = self.files.bootstrap_bytes
        size = self.mailbox_bytes if chosen is None else chosen
        return replace(
            found,
            serves_files=True,
            bootstrap=mailbox_of(size) if size else None,
            sii_variant=f"{found.sii_variant} files, bootstrap mailbox of {size} bytes",
        )

    def _start_store(self, product: int) -> None:
        if self.files is None:
            return
        if self._store is None:
            self._store = FileStore(self.files, product)
        if self._store.flash is not None:
            self._store.flash.restart()

    def started(self, scheduler: Scheduler) -> None:
        description = self.whole_description()
        self._start_store(description.product_code)
        self._application = Application(
            self.core,
            self.position,
            scheduler,
            description,
            delay_ns=self._mailbox_delay_ns,
            quirks=self.mailbox_quirks,
            store=self._store,
            protocols=self.protocols,
        )
        if self.files and self.files.firmware and self.files.firmware.restart == "power":
            self._application.on_restart = self.reset
        self.add_objects(self._application)

    def add_objects(self, application: Application) -> None:
        """Add the objects of the device profile to the dictionary."""
        raise NotImplementedError

    def handle(self, events: int) -> None:
        self.application.handle(events)

    def refuse_state(self, state: int, code: int | None, times: int | None = None) -> None:
        """Refuse requests for a state.

        Args:
            state: AL state number.
            code: AL status code of the refusal; None: accept the state again.
            times: Number of requests to refuse; None: all requests.
        """
        refused = self.application.states.refused
        if code is None:
            refused.pop(state, None)
        else:
            refused[state] = code, times

    def delay_state(self, state: int, seconds: float | None) -> None:
        """Set the duration of a state transition.

        Args:
            state: AL state number.
            seconds: Time until the device reaches the state [s]; None: the device never does.
        """
        delay = None if seconds is None else round(seconds * 1e9)
        self.application.states.delays[state] = delay

    @property
    def mailbox_silent(self) -> bool:
        return self.application.mailbox.silent

    @mailbox_silent.setter
    def mailbox_silent(self, silent: bool) -> None:
        """Stop or resume the mailbox. While it is stopped, SM0 stays full and SM1 stays empty."""
        self.application.mailbox.silence(silent)

    def delay_mailbox(self, seconds: float) -> None:
        """Add `seconds` [s] to the response time of the mailbox. A negative sum counts as 0."""
        self.application.mailbox.delay(round(seconds * 1e9))

    def send_emergency(self, code: int, data: bytes = b"") -> None:
        self.application.send_emergency(code, data)

    def store_diagnosis(
        self,
        text_id: int,
        parameters: Sequence[int] = (),
        *,
        severity: Literal["info", "warning", "error"] = "error",
        code: int = 0xE000,
    ) -> None:
        """Store a message in the diagnosis history (0x10F3).

        Args:
            text_id: Text of the message in the ESI of the device.
            parameters: Values for the text, sent as numbers of 32 bits.
            severity: "info", "warning" or "error".
            code: Diagnosis code.

        Raises:
            ValueError: The device has no history, or a value is out of range.
        """
        history = self.application.history
        if history is None:
            raise ValueError(f"{self.name} has no history; add diagnosis=HistoryOptions()")
        if not 0 <= text_id <= 0xFFFF or not 0 <= code <= 0xFFFF_FFFF:
            raise ValueError("text_id has 16 bits, and code has 32 bits")
        if len(parameters) > PARAMETERS_MAX:
            raise ValueError(f"at most {PARAMETERS_MAX} parameters, not {len(parameters)}")
        numbers = [double_word(each) for each in parameters]
        history.add(SEVERITIES.index(severity), code, text_id, numbers)
