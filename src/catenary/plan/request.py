"""Process-data requests (`ProcessDataRequest`): objects to exchange, before their places are known.

`loop` and `drive` share this interface, so that a Loop accepts requests of any kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from catenary.model.device import Direction
from catenary.model.esi_settings import IdnCommand
from catenary.model.module import ConfiguredModule
from catenary.model.sercos_axis import SercosAxis
from catenary.plan.axis_report import AxisReport
from catenary.plan.cycle import AxisPlan, Column, ImageArea, ImageCopy, Number
from catenary.plan.numbers import ANY, Which
from catenary.plan.start_up_object import StartUp

Reals = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Words = npt.NDArray[np.uint16]
Serials = npt.NDArray[np.uint32]
Bytes = npt.NDArray[np.uint8]
Modes = npt.NDArray[np.int8]
Cycles = npt.NDArray[np.uint64]

TX_PDOS = 0x1A00  # indices of TxPDOs begin here (inputs); RxPDOs from 0x1600 (outputs)
SYNC_TIME_END = 4.29  # [s]; the registers 0x09A0 and 0x09A4 hold 32 bits [ns]


@dataclass(frozen=True, slots=True)
class ObjectReference:
    """Entry of the object dictionary, to be mapped into the process data.

    If it is not `required` and the device cannot map it, it is omitted.
    """

    index: int
    subindex: int
    bit_length: int
    required: bool = True

    @property
    def place(self) -> tuple[int, int, int]:
        """Index, subindex and length, as `Entry.place`."""
        return self.index, self.subindex, self.bit_length


@dataclass(frozen=True, slots=True)
class WrittenPdo:
    """PDO that the application or an OpMode specified.

    If `entries` is None, the device keeps its entries.
    """

    index: int
    entries: tuple[ObjectReference, ...] | None = None
    sync_manager: int | None = None  # None: the SyncManager for process data of its direction
    copies: int = 1  # with oversampling: PDOs with consecutive indices, one per sample
    name: str = ""  # by which the application chose it, or its mapping; empty for a number
    source: str = ""  # of the OpMode or the named mapping

    @property
    def direction(self) -> Direction:
        return Direction.OUTPUT if self.index < TX_PDOS else Direction.INPUT


@dataclass(frozen=True, slots=True, kw_only=True)
class DistributedClock:
    """Distributed clocks of a device: SYNC signals, in phase with those of all other devices.

    Options that are None come from an OpMode of the device's ESI or SII: the one named `op_mode`.
    Without a name, it is the first one that starts SYNC0 or, if there is none, SYNC1. If there is
    none of these either, SYNC0 fires every period, without a shift and without SYNC1
    (AssignActivate 0x0300).

    Args:
        op_mode: Name or description of the OpMode, as in the ESI file; case is ignored.
        sync0: Period of SYNC0 [s], a multiple or an integer fraction of the loop's period.
        sync1: Time from SYNC0 to SYNC1 [s].
        shift: Time of SYNC0 after the common SYNC0 time [s], less than a cycle. It may be negative.
        assign_activate: Registers 0x0980 and 0x0981, as in the ESI file. 0x0500 starts
            SYNC1 alone.

    Raises:
        TypeError: `op_mode` is not a string.
        ValueError: A time or `assign_activate` is out of range.
    """

    op_mode: str | None = None
    sync0: float | None = None
    sync1: float | None = None
    shift: float | None = None
    assign_activate: int | None = None

    def __post_init__(self) -> None:
        if self.op_mode is not None and not isinstance(self.op_mode, str):
            raise TypeError(f"op_mode={self.op_mode!r}: must be the name of an OpMode, or None")
        if self.sync0 is not None and not 1e-9 <= self.sync0 < SYNC_TIME_END:
            raise ValueError(f"sync0={self.sync0} s: must be 1 ns to {SYNC_TIME_END} s")
        if self.sync1 is not None and not 0 <= self.sync1 < SYNC_TIME_END:
            raise ValueError(f"sync1={self.sync1} s: must be 0 to {SYNC_TIME_END} s")
        if self.shift is not None and not math.isfinite(self.shift):
            raise ValueError(f"shift={self.shift} s: must be finite")
        if self.assign_activate is not None and not 0 <= self.assign_activate <= 0xFFFF:
            raise ValueError(f"assign_activate={self.assign_activate}: must be 0 to 0xFFFF")

    def __str__(self) -> str:
        """Return the call that makes this value, as source text."""
        given = [
            f"{name}={value!r}"
            for name, value in (
                ("op_mode", self.op_mode),
                ("sync0", self.sync0),
                ("sync1", self.sync1),
                ("shift", self.shift),
            )
            if value is not None
        ]
        if self.assign_activate is not None:
            given.append(f"assign_activate=0x{self.assign_activate:04X}")
        return f"cat.DistributedClock({', '.join(given)})"


@dataclass(frozen=True, slots=True)
class DeviceRequest:
    """Objects that one device must exchange cyclically.

    An existing mapping is only changed if a required object is missing or `pdos` requires it.
    Several requests may name one device. Its divider is then the greatest common divisor of their
    dividers, and it is required if any of them requires it. A divider of 0 leaves the choice to the
    other requests. Without them, it is 1.
    """

    outputs: tuple[ObjectReference, ...] = ()  # MainDevice → device (RxPDO)
    inputs: tuple[ObjectReference, ...] = ()  # device → MainDevice (TxPDO)
    start_up: tuple[tuple[int, int, bytes], ...] = ()  # SDOs in PRE-OP: index, subindex, data
    clock: DistributedClock | None = None
    divider: int = 1  # n: exchanged in every n-th cycle; 0: see above
    required: bool = True  # True if a cycle without it is bad
    pdos: tuple[WrittenPdo, ...] = ()  # PDOs to use in their directions, without a search
    objects: tuple[StartUp, ...] = ()  # start-up objects of the application, in their order
    modules: tuple[ConfiguredModule, ...] | None = None  # None: those in the description
    telegrams: tuple[SercosAxis, ...] = ()  # of a SERCOS device; empty: those in the description
    idns: tuple[IdnCommand, ...] = ()  # IDNs of a SERCOS device, written in PRE-OP


class ImageLayout(Protocol):
    """Places of the mapped objects. `which` selects one of several places of an object."""

    def output(
        self, device: int, index: int, subindex: int, which: Which = ANY
    ) -> Number | None: ...
    def input(
        self, device: int, index: int, subindex: int, which: Which = ANY
    ) -> Number | None: ...
    def sync_unit(self, device: int) -> int: ...
    def byte_range(self, device: int, direction: Direction) -> range:
        """Return the bytes of a device in the image of a direction."""

    def pdo_bits(self, device: int, direction: Direction, index: int) -> range | None:
        """Return the bits of a PDO in the image of a direction; None if it is not assigned."""


@dataclass(frozen=True, slots=True)
class RequestTables:
    """Axes and columns of a request. `axis_reports` has one entry per axis, or is empty."""

    axes: tuple[AxisPlan, ...] = ()
    output_columns: tuple[Column, ...] = ()
    input_columns: tuple[Column, ...] = ()
    axis_reports: tuple[AxisReport, ...] = ()
    output_areas: tuple[ImageArea, ...] = ()
    input_areas: tuple[ImageArea, ...] = ()
    copies: tuple[ImageCopy, ...] = ()


class Mover(Protocol):
    """Source of targets while the loop is iterated, such as the moves of some drives."""

    def step(self, now: float, /) -> None:
        """Write the targets of the next commit. `now` is the time of the cycle [s]."""

    def check(self) -> None:
        """End the motions of stopped axes, after a cycle that reported a stop or a problem."""

    def end(self) -> None:
        """End all motions, because the loop ends."""


@dataclass(frozen=True, slots=True)
class Views:
    """Views, without copies, of one request's part of the loop's private buffers.

    An array has one element for each of the n axes, or for each column of a bank. Only `next(loop)`
    changes `actual_*` and reads `target_*`.
    """

    actual_position: Reals  # (n,) [rad]
    actual_velocity: Reals  # (n,) [rad/s]
    actual_torque: Reals  # (n,) [N·m]
    statusword: Words  # (n,)
    mode_actual: Modes  # (n,)
    axis_state: Bytes  # (n,) CiA 402 state, wire.cia402.AxisState
    # axis_flags (n,): bit 0: set-points are followed; 1: the last one was limited; 2: the core
    # stopped the axis; 3: the target was refused (NaN, infinite, further than the step limit);
    # 4: no fresh target: fallback; 5: the drive refused the last mode change; bits 6 and 7: the
    # requested state in force
    axis_flags: Bytes
    stop_reason: Bytes  # (n,) plan.stop_reason.StopReason of the last stop, 0 after a new request
    stop_cycle: Cycles  # (n,) number of the cycle of that stop
    jogged: Bytes  # (n,) 1 while an operator moves the axis, which ignores its targets
    target_position: Reals
    target_velocity: Reals
    target_torque: Reals
    mode_target: Modes
    # requested_state (n,): 0 disabled, 1 enabled, 2 quick stop, 3 disabled with a fault reset (it
    # acknowledges a fault without motion). It takes effect when `request` changes. After a stop by
    # the core, only a new request enables the axis again.
    requested_state: Bytes
    request: Serials  # (n,) serial number of the request
    controlword_bits: Words  # (n,) the mode's own control bits (4, 5, 6, 9, 11 to 15), added by OR
    input_reals: Reals
    input_integers: Integers
    input_bits: Bytes
    input_bytes: Bytes  # of all areas, in order
    output_reals: Reals
    output_integers: Integers
    output_bits: Bytes
    output_bytes: Bytes
    unit_valid: Bytes  # (units of the whole plan,) 1 if the unit's last exchange was valid
    movers: list[Mover] = field(default_factory=list)  # active movers of the whole loop
    # Returns True while the loop runs. After the loop, requests have no effect.
    is_open: Callable[[], bool] = lambda: True
    # Returns True while a law or a stream sets the targets
    is_led: Callable[[], bool] = lambda: False
    # Returns the system time of the distributed clocks at the start of the present cycle [ns]; None
    # without distributed clocks
    system_time: Callable[[], int | None] = lambda: None


class ProcessDataRequest(Protocol):
    """Request for process data of some devices, such as `Drives` or `ProcessData`."""

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the requested objects by device position."""

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return the axes and columns of the request for a known layout."""

    def bind(self, views: Views) -> None:
        """Receive the views when the loop opens."""
