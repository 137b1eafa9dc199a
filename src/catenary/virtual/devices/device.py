"""Base class of virtual devices: description, position, power, and functions for tests.

It is sufficient for devices whose AL status follows AL control (couplers and simple terminals).
Devices with a microcontroller add an `Application`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, ClassVar

from catenary.virtual._segment import FOREVER, Core
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description
from catenary.virtual.scheduler import Agenda, Scheduler
from catenary.virtual.sii_image import make_sii_image
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks

if TYPE_CHECKING:
    from catenary.virtual.devices.described import DescribedDevice
    from catenary.virtual.devices.twin import Twin, TwinOptions

INIT, PRE_OP, SAFE_OP, OP = 1, 2, 4, 8
RESET_DELAY_NS, RESET_NS = 100_000, 20_000_000  # delay, and time to reload the EEPROM
AL_STATUS, RX_ERRORS, LOST_LINKS, ALIAS = 0x0130, 0x0300, 0x0310, 0x0012


class Device:
    """A virtual device. The segment assigns its position."""

    kind: ClassVar[str]
    ports: tuple[int, ...] = (0, 1)

    def __init__(
        self,
        *,
        name: str,
        alias: int,
        serial: int,
        lrw: bool,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
        sii_quirks: SiiQuirks = NO_SII_QUIRKS,
    ) -> None:
        if not 0 <= alias <= 0xFFFF:
            raise ValueError(f"alias must be 0 to 65535, not {alias}")
        if clock_bits not in (32, 64):
            raise ValueError(f"clock_bits must be 32 or 64, not {clock_bits}")
        self.name = name
        self.alias = alias
        self.serial = serial
        self.lrw = lrw
        self.clock_bits = clock_bits
        self.sii_quirks = sii_quirks
        self._crystal = crystal
        self._core: Core | None = None
        self._agenda: Agenda | None = None
        self._scheduler: Scheduler | None = None
        self._resets = False  # True while a reset keeps the device off
        self.position = -1

    @staticmethod
    def from_sii(
        source: bytes | str | PathLike[str],
        *,
        name: str = "",
        alias: int | None = None,
        serial: int | None = None,
        clock: bool | None = None,
        options: TwinOptions | None = None,
    ) -> Twin:
        """Return a virtual device with the EEPROM and the default process data of an SII.

        Args:
            source: The image, or the path of a binary file, as `catenary sii read` writes it.
            name: Name in messages; empty: that of the SII.
            alias: Station alias; None: that of the image.
            serial: Serial number; None: that of the image.
            clock: True if the device has a clock; None: True if the image has modes for it.
            options: Motors, quirks and clock of the device.

        Raises:
            ConfigurationError: The file cannot be read, or the image is not valid or has no
                identity.
            ValueError: A number is out of range.
        """
        from catenary.virtual.devices.twins import twin_from_sii

        return twin_from_sii(
            source, name=name, alias=alias, serial=serial, clock=clock, options=options
        )

    @staticmethod
    def from_esi(
        path: str | PathLike[str],
        device: str = "",
        *,
        product: int | None = None,
        revision: int | None = None,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        options: TwinOptions | None = None,
    ) -> DescribedDevice:
        """Return a virtual device with the EEPROM, objects and rules of an ESI.

        Args:
            path: Path of the ESI file.
            device: Device in the file: order code or name. Needed if the file has several devices,
                and `product` is None.
            product: Product code of the device in the file.
            revision: Revision of the device; None: the newest one.
            name: Name in messages; empty: that of the ESI.
            alias: Station alias.
            serial: Serial number.
            options: Motors, modules, quirks and clock of the device.

        Raises:
            EsiError: The file cannot be read.
            ConfigurationError: The file has no such device, gives no valid SII, or a slot does not
                accept a module.
            ValueError: A number is out of range, or `revision` is given without `product`.
        """
        from catenary.virtual.devices.twins import twin_from_esi

        return twin_from_esi(
            path,
            device,
            product=product,
            revision=revision,
            name=name,
            alias=alias,
            serial=serial,
            options=options,
        )

    def description(self) -> Description:
        raise NotImplementedError

    def sii_image(self) -> bytes:
        """Return the content of the EEPROM."""
        return make_sii_image(self.whole_description(), self.sii_quirks)

    def whole_description(self) -> Description:
        """Return the description with the SII variant, which changes the revision."""
        variant = "" if self.sii_quirks == NO_SII_QUIRKS else repr(self.sii_quirks)
        return replace(self.description(), sii_variant=variant)

    @property
    def core(self) -> Core:
        if self._core is None:
            raise ValueError(f"{self.name} is not in a segment; add it with Segment([...])")
        return self._core

    def attach(self, core: Core, position: int, agenda: Agenda) -> None:
        """Add the device to a segment and switch it on.

        Args:
            core: The compiled segment.
            position: Position in the segment.
            agenda: Delayed actions of the segment.

        Raises:
            ValueError: The device is already in a segment, or the position is occupied.
        """
        if self._core is not None:
            raise ValueError(f"{self.name} is already in a segment; create a new device")
        description = self.description()
        core.make_controller(
            position,
            ram=description.ram,
            sii=self.sii_image(),
            slots=description.slots,
            axes=description.axes,
            fmmus=description.fmmu_count,
            sync_managers=description.sync_manager_count,
            clock_bits=self.clock_bits if description.clock else 0,
            lrw=description.lrw,
            identification=description.identification,
            ports=self.ports,
        )
        if not description.loop_control:
            core.ignore_loop_control(position)
        self._core, self._agenda, self.position = core, agenda, position
        self.crystal = self._crystal
        self.switch_on()

    def detach(self) -> None:
        """Switch the device off and forget its segment. Another segment can then use the device."""
        self.switch_off()
        self._core = self._agenda = None
        self.position = -1

    def switch_on(self) -> None:
        """Switch the power on. The device boots with its stored defaults.

        A no-op if the device has power or is not in a segment.
        """
        if self._agenda is None or self._scheduler is not None:
            return
        self._scheduler = Scheduler(self._agenda)
        self.core.switch_power(self.position, True)
        self.started(self._scheduler)

    def switch_off(self) -> None:
        """Switch the power off. Pending actions are dropped and volatile values are lost."""
        self._resets = False
        if self._scheduler is None:
            return
        self._scheduler.end()
        self._scheduler = None
        self.core.switch_power(self.position, False)

    def power_on(self) -> None:
        """Switch the power on. Any thread may call it."""
        self._soon(self.switch_on)

    def power_off(self) -> None:
        """Switch the power off. Its neighbours lose the link. Any thread may call it."""
        self._soon(self.switch_off)

    def _soon(self, action: Callable[[], None]) -> None:
        if self._agenda is None:
            action()
        else:
            self._agenda.soon(action)

    def reset(self) -> None:
        """Schedule a power cycle for the time when the requesting frame has left the device.

        A no-op if the device has no power.
        """
        if self._scheduler is not None:
            self._scheduler.after(RESET_DELAY_NS, self._begin_reset)

    def _begin_reset(self) -> None:
        self.switch_off()
        if self._agenda is not None:
            self._resets = True
            self._agenda.after(RESET_NS, self._end_reset)

    def _end_reset(self) -> None:
        if self._resets:
            self.switch_on()

    def started(self, scheduler: Scheduler) -> None:
        """Initialise the device after power-on. Subclasses add their part."""

    def handle(self, events: int) -> None:
        """Handle events of the controller. Called in the service thread."""

    @property
    def state(self) -> int:
        """AL status: 1 INIT, 2 PRE-OP, 4 SAFE-OP, 8 OP; bit 4: error; 0: no power."""
        return self.core.peek(self.position, AL_STATUS, 1)[0] & 0x1F

    @property
    def outputs_taken_ns(self) -> int | None:
        """Time of the last output update on the segment's clock (`segment.now_ns`) [ns].

        Depending on the device, outputs change with the frame, with its internal cycle, or at SYNC
        pulses. None: no update since power-on.
        """
        when = self.core.outputs_at(self.position)
        return None if when == FOREVER else when

    @property
    def crystal(self) -> Crystal:
        """Crystal of the device's clock. It can be changed while the segment runs."""
        return self._crystal

    @crystal.setter
    def crystal(self, crystal: Crystal) -> None:
        self._crystal = crystal
        error, swing = crystal.ppm * 1e-6, crystal.drift_ppm * 1e-6
        period, scatter = crystal.drift_period, crystal.jitter * 1e9
        if self._core is not None:
            self._core.tune_crystal(self.position, error, swing, period, scatter)

    def freeze(self, frozen: bool = True) -> None:
        """Freeze or resume the device's model. Its controller continues to answer frames."""
        self.core.freeze(self.position, frozen)

    def count_errors(self, port: int, *, invalid_frames: int = 0, lost_links: int = 0) -> None:
        """Increase the error counters of one port, as a bad cable would, up to 255.

        Args:
            port: Port number, 0 to 3.
            invalid_frames: Number of invalid frames to add.
            lost_links: Number of lost links to add.

        Raises:
            ValueError: The port does not exist, or the device is not in a segment.
        """
        if not 0 <= port <= 3:
            raise ValueError(f"port must be 0 to 3, not {port}")
        for address, number in (
            (RX_ERRORS + 2 * port, invalid_frames),
            (LOST_LINKS + port, lost_links),
        ):
            before = self.core.peek(self.position, address, 1)[0]
            self.core.poke(self.position, address, bytes([min(before + number, 255)]))

    def set_latch_input(self, number: int, active: bool) -> None:
        """Set the level of a latch input of the clock now.

        Args:
            number: Number of the input, 0 or 1.
            active: Level of the input.
        """
        self.core.latch_input(self.position, number, active)

    def write_alias(self, alias: int) -> None:
        """Set the alias register, as a rotary switch on the device would."""
        self.core.poke(self.position, ALIAS, alias.to_bytes(2, "little"))
