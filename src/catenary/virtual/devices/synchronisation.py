"""Synchronisation of a device with the bus, ETG.1020 §5.2.1, "sync manager parameters".

0x1C32 describes outputs and 0x1C33 inputs. 0x10F1 limits the number of missed events. The module
also checks the configuration of the SYNC unit.

The supported types are 0 (free run) and 2 (DC Sync0). With a quirk, type 3 (DC Sync1) replaces type
2. If 0x1C32:01 was not written, the SYNC unit determines the type: if its signal is active on entry
to SAFE-OP, the device synchronises to the signal. Common device stacks behave in the same way.

A twin follows SYNC1 if this signal is active, otherwise SYNC0. Its objects are those of its file.
They only store values.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from catenary.virtual._segment import Core
from catenary.virtual.coe.dictionary import (
    BOOLEAN,
    FORMATS,
    OUT_OF_RANGE,
    READ_ANY,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_PRE_OP,
    Abort,
    Dictionary,
    Entry,
    number,
)
from catenary.virtual.state_machine import (
    DC_CYCLE_TIME,
    DC_SYNC0_CYCLE_TIME,
    INVALID_DC_CONFIGURATION,
)

FREE_RUN, DC_SYNC0, DC_SYNC1 = 0, 2, 3
# 0x1C32:04: bit 0: free run; bits 2 to 4: DC (1: SYNC0, 2: SYNC1)
SUPPORTED = {DC_SYNC0: 0x0001 | 0x0004, DC_SYNC1: 0x0001 | 0x0008}
OUTPUTS, INPUTS, ERROR_SETTINGS = 0x1C32, 0x1C33, 0x10F1
SYNC_CONTROL, ACTIVATION, SYNC0_CYCLE, SYNC1_CYCLE = 0x0980, 0x0981, 0x09A0, 0x09A4
ACTIVE = 0x01
PULSES = {DC_SYNC0: 0x02, DC_SYNC1: 0x04}  # bits of 0x0981
CYCLE_MAX_NS = 0xFFFF_FFFF
_, _, MISSED, EXCEEDED, SHIFT_SHORT, ERROR = range(6)  # fields of Core.synchronous


class Synchronisation:
    """Synchronisation type of a device, and the objects that represent it."""

    def __init__(
        self,
        core: Core,
        position: int,
        dictionary: Dictionary,
        *,
        step_ns: int,
        minimum_cycle_ns: int,
        copy_ns: int,
        missed_limit: int,
        synchronous_type: int | None = DC_SYNC0,
    ) -> None:
        """Add the objects to the dictionary.

        Args:
            core: The compiled segment.
            position: Position of the device.
            dictionary: Object dictionary of the device.
            step_ns: Internal cycle of the device [ns].
            minimum_cycle_ns: Shortest SYNC0 cycle [ns].
            copy_ns: Minimum time from the arrival of outputs to the pulse [ns].
            missed_limit: Number of consecutive pulses without new outputs after which the device
                reports an error.
            synchronous_type: Type for the signal of the device: DC_SYNC0 or DC_SYNC1. None: the
                type of the active signal, and no objects.
        """
        self._core = core
        self._position = position
        self._step_ns = step_ns
        self._minimum_ns = minimum_cycle_ns
        self._copy_ns = copy_ns
        self._limit = missed_limit
        self._follows_any = synchronous_type is None
        self._synchronous = DC_SYNC0 if synchronous_type is None else synchronous_type
        self._written: int | None = None  # 0x1C32:01
        self._cycle_written = 0  # 0x1C32:02
        self._checked_ns = 0  # cycle of the pulses at the last check; 0: free run
        self._tune()
        if not self._follows_any:
            self._add_objects(dictionary, copy_ns)

    def _add_objects(self, dictionary: Dictionary, copy_ns: int) -> None:
        for index, name, copy in (
            (OUTPUTS, "SM output parameter", copy_ns),
            (INPUTS, "SM input parameter", 0),  # inputs are latched at the pulse
        ):
            dictionary.add(index, name, self._parameters(copy))
        dictionary.add_record(
            ERROR_SETTINGS,
            "Error settings",
            [
                number("Local error reaction", UNSIGNED32, 1),  # change to SAFE-OP with an error
                self._entry(
                    "Sync error counter limit", UNSIGNED16, lambda: self._limit, self._limit_to
                ),
            ],
        )

    # -- for the state machine -----------------------------------------------------------------

    def check(self) -> int:
        """Return 0, or an AL status code if the clock configuration forbids PRE-OP → SAFE-OP.

        Store the period of the pulses for `begin`.
        """
        self._checked_ns = 0
        by_pdi, activation = self._core.peek(self._position, SYNC_CONTROL, 2)
        switched_on = bool(activation & ACTIVE)
        if self._follows_any:
            self._synchronous = DC_SYNC1 if activation & PULSES[DC_SYNC1] else DC_SYNC0
        if not switched_on:
            return INVALID_DC_CONFIGURATION if self._written == self._synchronous else 0
        if self._written == FREE_RUN or not activation & PULSES[self._synchronous] or by_pdi & 1:
            return INVALID_DC_CONFIGURATION
        if self.sync0_cycle_ns < self._minimum_ns:
            return DC_SYNC0_CYCLE_TIME
        own = self._step_ns  # a MainDevice may write the free-run value of 0x1C32:02 back
        cycle_ns = self.cycle_ns
        if cycle_ns > CYCLE_MAX_NS:
            return INVALID_DC_CONFIGURATION
        if self._cycle_written not in (0, own, cycle_ns):
            return DC_CYCLE_TIME
        self._checked_ns = cycle_ns
        return 0

    def begin(self) -> None:
        """Begin the synchronisation on entry to SAFE-OP. A no-op in free run.

        Use the checked values, because frames may have changed the registers in the meantime.
        """
        if self._checked_ns:
            self._core.run_model_by_pulses(
                self._position, PULSES[self._synchronous], self._checked_ns, self._step_ns
            )

    def end(self) -> None:
        if self._is_synchronous:
            self._core.run_model(self._position, self._step_ns)

    def awaits_pulses(self) -> bool:
        """Return True if the device synchronises to pulses and has not received one."""
        active, seen = self._core.synchronous(self._position)[:2]
        return active and not seen

    # -- for the objects -----------------------------------------------------------------------

    @property
    def sync0_cycle_ns(self) -> int:
        return int.from_bytes(self._core.peek(self._position, SYNC0_CYCLE, 4), "little")

    @property
    def cycle_ns(self) -> int:
        """Period of the signal to which the device synchronises [ns].

        SYNC1 follows a SYNC0 after the time in 0x09A4. The first SYNC0 after SYNC1 starts this time
        again (Beckhoff, ESC data sheet I §9.2.3.5).
        """
        sync0_ns = self.sync0_cycle_ns
        if self._synchronous == DC_SYNC0 or not sync0_ns:
            return sync0_ns
        later = int.from_bytes(self._core.peek(self._position, SYNC1_CYCLE, 4), "little")
        return (later // sync0_ns + 1) * sync0_ns

    @property
    def _is_synchronous(self) -> bool:
        return self._core.synchronous(self._position)[0]

    def _type(self) -> int:
        if self._is_synchronous:
            return self._synchronous
        return FREE_RUN if self._written is None else self._written

    def _type_to(self, requested: int) -> None:
        if requested not in (FREE_RUN, self._synchronous):
            raise Abort(OUT_OF_RANGE)
        self._written = requested

    def _cycle(self) -> int:
        return self.cycle_ns if self._is_synchronous else self._cycle_written or self._step_ns

    def _cycle_to(self, cycle_ns: int) -> None:
        self._cycle_written = cycle_ns

    def _limit_to(self, limit: int) -> None:
        if limit == 0:
            raise Abort(OUT_OF_RANGE)
        self._limit = limit
        self._tune()

    def _tune(self) -> None:
        self._core.tune_synchronous(
            self._position, minimum_ns=self._minimum_ns, copy_ns=self._copy_ns, limit=self._limit
        )

    def _counter(self, which: int) -> Callable[[], int]:
        return lambda: int(self._core.synchronous(self._position)[which])

    def _parameters(self, copy_ns: int) -> dict[int, Entry]:
        entry = self._entry
        return {
            0x00: number("Number of entries", UNSIGNED8, 0x20),
            0x01: entry("Sync mode", UNSIGNED16, self._type, self._type_to),
            0x02: entry("Cycle time", UNSIGNED32, self._cycle, self._cycle_to),
            0x03: number("Shift time", UNSIGNED32, 0),  # outputs are valid at the pulse
            0x04: number("Sync modes supported", UNSIGNED16, SUPPORTED[self._synchronous]),
            0x05: number("Minimum cycle time", UNSIGNED32, self._minimum_ns),
            0x06: number("Calc and copy time", UNSIGNED32, copy_ns),
            0x07: number("Minimum delay time", UNSIGNED32, 0),
            0x09: number("Delay time", UNSIGNED32, 0),
            0x0A: entry("Sync0 cycle time", UNSIGNED32, lambda: self.sync0_cycle_ns),
            0x0B: entry("SM event missed counter", UNSIGNED16, self._counter(MISSED)),
            0x0C: entry("Cycle exceeded counter", UNSIGNED16, self._counter(EXCEEDED)),
            0x0D: entry("Shift too short counter", UNSIGNED16, self._counter(SHIFT_SHORT)),
            0x20: entry("Sync error", BOOLEAN, self._counter(ERROR)),
        }

    @staticmethod
    def _entry(
        name: str,
        data_type: int,
        read: Callable[[], int],
        write: Callable[[int], None] | None = None,
    ) -> Entry:
        bits, form = FORMATS[data_type]

        def pack() -> bytes:
            return struct.pack(form, read())

        def unpack(data: bytes) -> None:
            if write is not None:
                write(int.from_bytes(data, "little"))

        access = READ_ANY | (WRITE_PRE_OP if write else 0)
        return Entry(name, data_type, bits, access, pack, unpack if write else None)
