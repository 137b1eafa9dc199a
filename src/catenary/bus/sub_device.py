"""SubDevice: the handle of one device. It stays valid across scans if the identity is the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from catenary.bus.aoe import Aoe
from catenary.bus.device_diagnosis import DeviceDiagnosis
from catenary.bus.eoe import Eoe, TapConnector
from catenary.bus.foe import Foe
from catenary.bus.latch import Latch, LatchEdge
from catenary.bus.pdo_table import PdoTable
from catenary.bus.sdo import Conversations, Objects, Sdo
from catenary.bus.voe import Voe
from catenary.errors import CatenaryError
from catenary.model.device import DeviceDescription, Identity
from catenary.procedure.al_state import DeviceState, read_state
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.station import Station, station_of
from catenary.wire.al import AlState
from catenary.wire.coe import Emergency

if TYPE_CHECKING:  # plan imports NumPy, which a scan does not need
    from catenary.bus.states import Outcome
    from catenary.esi.device import EsiDevice


class DeviceOwner(Conversations, Protocol):
    """Interface of a MainDevice to its devices. `MainDevice` documents the calls."""

    @property
    def subs(self) -> Sequence[SubDevice]: ...

    @property
    def eoe(self) -> TapConnector: ...

    def require_no_loop(self) -> None: ...

    def request_states(
        self, subs: Sequence[SubDevice], positions: Sequence[int], state: AlState
    ) -> Mapping[int, Outcome]: ...

    def read_objects(
        self, wanted: Mapping[int, Sequence[tuple[int, int]]]
    ) -> Mapping[int, Objects]: ...


class SubDevice:
    """Handle of one device, such as `main.scan()[2]`. It stays valid across scans.

    Attributes never cause traffic; calls with a verb do. `sub.sdo` reads and writes its objects,
    `sub.foe` its files, `sub.aoe` its ADS data. `sub.voe` exchanges vendor-specific messages.
    `sub.eoe` is its Ethernet port. `sub.diagnosis` reads the messages that it stores.
    """

    def __init__(
        self, main: DeviceOwner, description: DeviceDescription, channel: MailboxChannel | None
    ) -> None:
        self.main = main
        self.description = description
        self.channel = channel  # None if it has no mailbox
        self._boot_channel: MailboxChannel | None = None  # its mailbox in BOOT
        self.state: AlState | None = None  # last known state; None if unknown
        self.error: CatenaryError | None = None  # of the last scan, if PRE-OP was not reached
        # 0x1C32:01 and 0x1C33:01 before the first loop with clocks, to restore them
        self.sync_types: dict[int, bytes] = {}
        self.esi: EsiDevice | None = None  # ESI that the last scan used for it
        self.sdo = Sdo(self)
        self.foe = Foe(self)
        self.eoe = Eoe(self)
        self.aoe = Aoe(self)
        self.voe = Voe(self)
        self.diagnosis = DeviceDiagnosis(self)

    @property
    def position(self) -> int:
        """Position on the segment; 0 is the first device."""
        return self.description.position

    @property
    def name(self) -> str:
        """Name in the SII, such as "EL2004".

        If the SII has no name, this is the order code, otherwise vendor and product. It is
        "unknown" if the SII cannot be used, and empty after `passive_scan(names=False)`.
        """
        return self.description.name

    @property
    def order(self) -> str:
        """Order code of the manufacturer; empty if the SII has none."""
        return self.description.order

    @property
    def identity(self) -> Identity:
        """Vendor, product, revision and serial number."""
        return self.description.identity

    @property
    def alias(self) -> int:
        """Station alias; 0 if the device has none."""
        return self.description.alias

    @property
    def is_drive(self) -> bool:
        """True if the device has CiA 402 axes."""
        return self.description.is_drive

    @property
    def slots(self) -> tuple[int, ...]:
        """Slots of the CiA 402 axes. The objects of slot k are 0x800·k above those of slot 0."""
        return self.description.slots

    @property
    def pdos(self) -> PdoTable:
        """Mapping as of the last scan or plan: PDO, object, name, type and bit offset."""
        return PdoTable(self.description)

    @property
    def emergencies(self) -> tuple[Emergency, ...]:
        """Most recent emergencies of the device, oldest first."""
        received = self.channel.emergencies if self.channel is not None else ()
        return tuple(each.emergency for each in received)

    @property
    def station(self) -> Station:
        """Station address, with position and name for messages."""
        return station_of(self.description)

    @property
    def in_boot(self) -> bool:
        """True if the device is in BOOT, as far as known."""
        return self.state is AlState.BOOT

    @property
    def file_channel(self) -> MailboxChannel | None:
        """Mailbox for files in the present state; None if the device has none."""
        if self.in_boot:
            return self._boot_channel
        return self.channel if self.error is None else None

    def give_name(self, name: str) -> None:
        """Use the name of a machine file in messages, before the name in the SII."""
        self.description = replace(self.description, given_name=name)
        if self.channel is not None:
            self.channel.station = self.station

    def latch(
        self, number: int = 0, *, edge: LatchEdge = "rising", continuous: bool = False
    ) -> Latch:
        """Return a handle of a latch input of the device's clock.

        The first `read` or `request` of the handle sets the input up.

        Args:
            number: Number of the input, 0 or 1.
            edge: "rising", "falling" or "both".
            continuous: True to keep the last edge; False to keep the first since the last reading.

        Raises:
            ValueError: The input or the edge does not exist.
            ConfigurationError: The device has no distributed clock.
        """
        return Latch(self, number, edge, continuous)

    def read_state(self) -> DeviceState:
        """Read the EtherCAT state of the device, and update `state`."""
        found = self.main.converse(read_state(self.station))
        self.state = found.state
        return found

    def request_state(self, state: AlState | str) -> DeviceState:
        """Bring this device to a state, leave it there, and update the attribute `state`.

        The device passes through all intermediate states. For SAFE-OP and OP, a device below
        SAFE-OP passes through INIT and is configured with its current mapping. For BOOT, it passes
        through INIT, and gets its bootstrap mailbox. Do not call this while a loop runs, because
        the loop configures its devices itself.

        Args:
            state: `State.SAFE_OP`, or its name: "SAFE_OP".

        Returns:
            The reached state.

        Raises:
            StateError: The device refuses the state. The error gives the reason.
            EepromError: The bootstrap mailbox of the device is not known.
            ValueError: The text or the number is not a state.
        """
        target = AlState.from_name(state) if isinstance(state, str) else AlState(state)
        if target is AlState.BOOT and (self._boot_channel is None or not self.in_boot):
            self._prepare_boot()
        outcome = self.main.request_states(self.main.subs, [self.position], target)[self.position]
        if isinstance(outcome, CatenaryError):
            raise outcome
        self.state = outcome.state
        if target in (AlState.INIT, AlState.BOOT) and self.channel is not None:
            self.channel.reset()  # its SyncManagers are configured again on the way to PRE-OP
        return outcome

    @contextmanager
    def boot(self) -> Iterator[Foe]:
        """Bring this device to BOOT within the block, and to PRE-OP afterwards.

            with sub.boot() as foe:
                foe.write("app.efw", Path("app.efw"), password=0x1234)

        In BOOT, a device has no other mailbox services than FoE. If the block raises an error, the
        device is left in INIT. A device that restarts with its new firmware leaves the segment for
        a moment: a StateError or ResponseTimeout at the end then requires another scan.

        Raises:
            StateError: The device refuses a state.
            EepromError: The bootstrap mailbox of the device is not known.
            RuntimeError: A loop runs.
        """
        self.main.require_no_loop()
        self._prepare_boot()  # before the device leaves its state, because this may fail
        self.request_state(AlState.INIT)  # also restarts the mailbox of a device in BOOT
        try:
            self.request_state(AlState.BOOT)
            yield self.foe
        except BaseException:
            with suppress(CatenaryError):
                self.request_state(AlState.INIT)
            raise
        self.request_state(AlState.INIT)
        self.request_state(AlState.PRE_OP)

    def _prepare_boot(self) -> None:
        """Make the mailbox for BOOT. Its counter restarts with that of the device."""
        known = self.description.bootstrap
        if known is None:
            from catenary.procedure.state_path import read_bootstrap

            known = self.main.converse(read_bootstrap(self.station))
            self.description = replace(self.description, bootstrap=known)
        self._boot_channel = MailboxChannel(self.station, known)

    def __repr__(self) -> str:
        return f"<SubDevice {self.position} {self.name!r} {self.state or 'state unknown'}>"
