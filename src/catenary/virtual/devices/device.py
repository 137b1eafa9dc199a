"""A device on the segment: its description, its place, and the switches tests turn.

Devices whose AL status merely follows AL control (couplers, simple terminals) need nothing more;
those with a microcontroller add an `Application`.
"""

from __future__ import annotations

from typing import ClassVar

from catenary.virtual._segment import FOREVER, Core
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description
from catenary.virtual.scheduler import Agenda, Scheduler
from catenary.virtual.sii_image import make_sii_image
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks

INIT, PRE_OP, SAFE_OP, OP = 1, 2, 4, 8
RESET_DELAY_NS, RESET_NS = 100_000, 20_000_000  # the EEPROM is loaded again
AL_STATUS, RX_ERRORS, LOST_LINKS, ALIAS = 0x0130, 0x0300, 0x0310, 0x0012


class Device:
    """Owns one virtual device; its place in the segment is given when the segment is made."""

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
            raise ValueError(f"alias {alias} is no 16-bit number")
        if clock_bits not in (32, 64):
            raise ValueError(f"a clock has 32 or 64 bits, not {clock_bits}")
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
        self.position = -1

    def description(self) -> Description:
        raise NotImplementedError

    def sii_image(self) -> bytes:
        """Return the content of its EEPROM."""
        return make_sii_image(self.description(), self.sii_quirks)

    @property
    def core(self) -> Core:
        if self._core is None:
            raise ValueError(f"{self.name} stands in no segment yet: Segment([...]) places it")
        return self._core

    def attach(self, core: Core, position: int, agenda: Agenda) -> None:
        """Puts it into its place and switches it on."""
        if self._core is not None:
            raise ValueError(f"{self.name} stands in a segment already")
        description = self.description()
        core.make_controller(
            position,
            ram=description.ram,
            sii=self.sii_image(),
            slots=description.slots,
            axes=description.axes,
            fmmus=8,
            sync_managers=8,
            clock_bits=self.clock_bits if description.clock else 0,
            lrw=self.lrw,
            identification=description.identification,
            ports=self.ports,
        )
        if not description.loop_control:
            core.ignore_loop_control(position)
        self._core, self._agenda, self.position = core, agenda, position
        self.crystal = self._crystal
        self.switch_on()

    def detach(self) -> None:
        """It is taken out, without power; another segment may have it."""
        self.switch_off()
        self._core = self._agenda = None
        self.position = -1

    def switch_on(self) -> None:
        """Power: it boots with its stored defaults."""
        if self._agenda is None or self._scheduler is not None:
            return
        self._scheduler = Scheduler(self._agenda)
        self.core.switch_power(self.position, True)
        self.started(self._scheduler)

    def switch_off(self) -> None:
        """No power: what it was about to do is not done, what it knew is gone."""
        if self._scheduler is None:
            return
        self._scheduler.end()
        self._scheduler = None
        self.core.switch_power(self.position, False)

    def reset(self) -> None:
        """The MainDevice's reset: off, as soon as the frame that asked has left, and on."""
        if self._scheduler is None or self._agenda is None:
            return
        self._scheduler.after(RESET_DELAY_NS, self.switch_off)
        self._agenda.after(RESET_DELAY_NS + RESET_NS, self.switch_on)

    def started(self, scheduler: Scheduler) -> None:
        """The controller has power; now what the device adds to it."""

    def handle(self, events: int) -> None:
        """Events of the controller, on the service's thread."""

    @property
    def state(self) -> int:
        """The AL state shown: 1 INIT, 2 PRE-OP, 4 SAFE-OP, 8 OP; bit 4 is the error flag; 0: it
        has no power."""
        return self.core.peek(self.position, AL_STATUS, 1)[0] & 0x1F

    @property
    def outputs_taken_ns(self) -> int | None:
        """When it last took its outputs over, on the segment's clock (`segment.now_ns`): with the
        frame, at its own cycle, or at SYNC0; None: not since it was switched on."""
        when = self.core.outputs_at(self.position)
        return None if when == FOREVER else when

    @property
    def crystal(self) -> Crystal:
        """What its clock counts by; it may be changed while the segment runs."""
        return self._crystal

    @crystal.setter
    def crystal(self, crystal: Crystal) -> None:
        self._crystal = crystal
        error, swing = crystal.ppm * 1e-6, crystal.drift_ppm * 1e-6
        period, scatter = crystal.drift_period, crystal.jitter * 1e9
        if self._core is not None:
            self._core.tune_crystal(self.position, error, swing, period, scatter)

    def freeze(self, frozen: bool = True) -> None:
        """The device's model stands still; its controller goes on answering frames."""
        self.core.freeze(self.position, frozen)

    def count_errors(self, port: int, *, invalid_frames: int = 0, lost_links: int = 0) -> None:
        """What a bad cable would leave in the error counters of one port."""
        if not 0 <= port <= 3:
            raise ValueError(f"a controller has ports 0 to 3, not {port}")
        for address, number in (
            (RX_ERRORS + 2 * port, invalid_frames),
            (LOST_LINKS + port, lost_links),
        ):
            before = self.core.peek(self.position, address, 1)[0]
            self.core.poke(self.position, address, bytes([min(before + number, 255)]))

    def write_alias(self, alias: int) -> None:
        """What a rotary switch on the device would say, in the register at once."""
        self.core.poke(self.position, ALIAS, alias.to_bytes(2, "little"))
