"""Oversampling terminals: several samples of each channel in one cycle, with CoE.

Each channel has a PDO with one entry per sample. SYNC1 occurs once per cycle, and SYNC0 at each
sample. At SYNC1, a terminal with inputs shows the samples since the last SYNC1, and a terminal with
outputs begins to put out the samples that it has received. The input 0x1D09:98
(StartTimeNextLatch) is the system time of this SYNC1: the first of the shown samples is one cycle
older. Sources: Beckhoff, EL5031-0011 ("StartTimeNextLatch") and EL47xx ("Time-related cooperation
with other terminals").
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from catenary.virtual.coe.dictionary import (
    INTEGER16,
    MAP_RX,
    MAP_TX,
    READ_ANY,
    UNSIGNED32,
    UNSIGNED64,
    WRITE_ANY,
    Entry,
)
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import AppliedDevice, MailboxOptions
from catenary.virtual.devices.synchronisation import ACTIVATION, DC_SYNC1, PULSES, Synchronisation
from catenary.virtual.op_modes import FREE_RUN, OpMode
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import NO_SII_QUIRKS

Wave = Callable[[float], int]

STEP_NS = 250_000  # internal cycle without distributed clocks
MINIMUM_CYCLE_NS = 5_000  # shortest SYNC0 cycle
IDLE_NS = 1_000_000  # interval between two checks of whether SYNC1 is active
AHEAD_NS = 1_000  # time before SYNC1 at which the samples are complete
CHANNELS_MAX, SAMPLES_MAX = 8, 30
NEXT_SYNC1 = 0x0998  # register
TIME_INDEX, TIME_SUBINDEX = 0x1D09, 0x98  # named after the register of SYNC1
TIME_NAME = "StartTimeNextLatch"
RECORDED_MAX = 1_000_000  # samples that a terminal with outputs records


class OversamplingTerminal(AppliedDevice):
    """Terminal with 1 to 8 oversampling inputs or outputs of 16 bits."""

    kind = "oversampling"

    def __init__(
        self,
        *,
        direction: Literal["inputs", "outputs"] = "inputs",
        channels: int = 2,
        samples: int = 10,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
    ) -> None:
        """Initialise the terminal.

        Args:
            direction: "inputs" or "outputs".
            channels: Number of channels, 1 to 8.
            samples: Number of samples of each channel in a cycle, 1 to 30.
            name: Device name; empty: a default name.
            alias: Station alias.
            serial: Serial number.
            lrw: True if the device supports LRW.
            crystal: Frequency error and jitter of the clock.
            clock_bits: Width of the clock, 32 or 64. The input 0x1D09:98 has this width.

        Raises:
            ValueError: A value is out of range.
        """
        if direction not in ("inputs", "outputs"):
            raise ValueError(f"direction must be 'inputs' or 'outputs', not {direction!r}")
        if not 1 <= channels <= CHANNELS_MAX:
            raise ValueError(f"channels must be 1 to {CHANNELS_MAX}, not {channels}")
        if not 1 <= samples <= SAMPLES_MAX:
            raise ValueError(f"samples must be 1 to {SAMPLES_MAX}, not {samples}")
        super().__init__(
            name=name or f"Catenary virtual oversampling {direction}",
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=NO_SII_QUIRKS,
            mailbox=MailboxOptions(),
        )
        self.direction = direction
        self.channels = channels
        self.samples = samples
        self._waves: list[Wave] = [_silence] * channels
        self._recorded: list[tuple[float, tuple[int, ...]]] = []
        self._shown = 0  # SYNC1 of the last samples [ns]

    def apply_wave(self, channel: int, wave: Wave) -> None:
        """Apply a signal to an input.

        Args:
            channel: Number of the channel, from 0.
            wave: Returns the sample at a system time of the terminal [s].
        """
        self._waves[channel] = wave

    @property
    def wave(self) -> Sequence[tuple[float, tuple[int, ...]]]:
        """Samples that the outputs have put out, as (system time [s], value of each channel)."""
        return tuple(self._recorded)

    @property
    def _time_type(self) -> int:
        return UNSIGNED64 if self.clock_bits == 64 else UNSIGNED32

    def description(self) -> Description:
        pdos = [self._pdo(channel) for channel in range(self.channels)]
        time = MappedEntry(TIME_INDEX, TIME_SUBINDEX, self.clock_bits, TIME_NAME, self._time_type)
        is_input = self.direction == "inputs"
        tx = (*pdos, Pdo(0x1A10, "NextSync1Time", (time,), 3)) if is_input else ()
        rx = () if is_input else tuple(pdos)
        sampled = OpMode(
            name=f"DcSync{self.samples}",
            assign_activate=0x0700,
            sync0_factor=-self.samples,
            sync1_factor=-1,
        )
        return Description(
            name=self.name,
            order=f"CV{'I' if is_input else 'O'}S{self.channels:02d}{self.samples:02d}",
            group="Oversampling terminals",
            product_code=(0x0007_0000 if is_input else 0x0008_0000)
            + (self.channels << 8)
            + self.samples,
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(self.mailbox_bytes),
            sync_managers=sync_managers_of(self.mailbox_bytes, rx, tx),
            fmmus=(1, 2, 3),
            rx_pdos=rx,
            tx_pdos=tx,
            clock=True,
            slots=self.channels * self.samples + 1,
            op_modes=(FREE_RUN, sampled),
            lrw=self.lrw,
        )

    def _pdo(self, channel: int) -> Pdo:
        base, index, manager = (
            (0x1A00, 0x6000, 3) if self.direction == "inputs" else (0x1600, 0x7000, 2)
        )
        entries = tuple(
            MappedEntry(index + 0x10 * channel, n + 1, 16, f"Sample {n}", INTEGER16)
            for n in range(self.samples)
        )
        return Pdo(base + channel, f"Channel {channel + 1}", entries, manager)

    def add_objects(self, application: Application) -> None:
        is_input = self.direction == "inputs"
        index, name = (0x6000, "Samples") if is_input else (0x7000, "Output samples")
        access = READ_ANY | MAP_TX if is_input else READ_ANY | WRITE_ANY | MAP_RX
        for channel in range(self.channels):
            first = channel * self.samples
            entries = [
                application.slot_entry(f"Sample {n}", INTEGER16, 16, first + n, access)
                for n in range(self.samples)
            ]
            title = f"{name} channel {channel + 1}"
            application.dictionary.add_record(index + 0x10 * channel, title, entries)
        if is_input:
            slot = self.channels * self.samples
            time = application.slot_entry(TIME_NAME, self._time_type, self.clock_bits, slot, access)
            entry: dict[int, Entry] = {TIME_SUBINDEX: time}
            application.dictionary.add(TIME_INDEX, "Distributed clocks", entry)
        application.synchronisation = Synchronisation(
            self.core,
            self.position,
            application.dictionary,
            step_ns=STEP_NS,
            minimum_cycle_ns=MINIMUM_CYCLE_NS,
            copy_ns=0,
            missed_limit=3,
            synchronous_type=DC_SYNC1,
        )

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        self._shown = 0
        self.core.run_model(self.position, STEP_NS)
        scheduler.after(IDLE_NS, lambda: self._sample(scheduler))

    # -- sampling --------------------------------------------------------------------------------

    def _sample(self, scheduler: Scheduler) -> None:
        """Prepare or take the samples of one cycle, and schedule the next call."""
        wait = IDLE_NS
        synchronisation = self.application.synchronisation
        assert synchronisation is not None
        active = self.core.peek(self.position, ACTIVATION, 1)[0] & PULSES[DC_SYNC1]
        cycle = synchronisation.cycle_ns
        if active and cycle:
            now = self.core.system_time(self.position)
            register = self.core.peek(self.position, NEXT_SYNC1, self.clock_bits // 8)
            span = 1 << self.clock_bits  # the register has the low bits of the time
            ahead = (int.from_bytes(register, "little") - now + span // 2) % span - span // 2
            pulse = now + ahead
            wait = ahead - AHEAD_NS
            if 0 < ahead <= 2 * AHEAD_NS and pulse != self._shown:
                self._shown = pulse
                self._exchange(pulse, cycle)
            if wait <= 0:
                wait = ahead + cycle - AHEAD_NS if ahead > 0 else AHEAD_NS
        scheduler.after(max(wait, AHEAD_NS // 4), lambda: self._sample(scheduler))

    def _exchange(self, pulse: int, cycle: int) -> None:
        """Show the samples before a SYNC1, or record those that the last SYNC1 began to put out."""
        begun = pulse - cycle
        times = [(begun + n * cycle // self.samples) * 1e-9 for n in range(self.samples)]
        if self.direction == "inputs":
            for channel, wave in enumerate(self._waves):
                for n, time in enumerate(times):
                    slot = channel * self.samples + n
                    self.core.put_slot(self.position, slot, wave(time))
            shown = pulse % (1 << self.clock_bits)
            self.core.put_slot(self.position, self.channels * self.samples, shown)
            return
        if not self.core.outputs_valid(self.position) or len(self._recorded) >= RECORDED_MAX:
            return
        values = [
            [self.core.slot(self.position, channel * self.samples + n) for n in range(self.samples)]
            for channel in range(self.channels)
        ]
        self._recorded += zip(times, zip(*values, strict=True), strict=True)


def _silence(time: float) -> int:
    return 0
