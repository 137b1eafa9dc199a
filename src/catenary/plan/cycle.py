"""CyclePlan: all data that the compiled core needs to run a cycle, as a frozen value.

Offsets count from the start of the process images: one image of outputs (MainDevice → SubDevices),
one of inputs. Bits are numbered as on the wire: bit 0 of byte 0 first (little endian).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

ExecutionMode = Literal["threaded", "inline"]
ReceiveMode = Literal["poll", "wait", "busy"]
Profile = Literal["cia402", "sercos"]
FollowedClock = Literal["reference", "main"]
OnLoss = Literal["quick_stop", "disable", "csp_hold"]


class NumberKind(IntEnum):
    """Interpretation of the bits of a value."""

    UNSIGNED = 0
    SIGNED = 1
    REAL = 2  # IEEE 754, 32 or 64 bits


@dataclass(frozen=True, slots=True)
class Number:
    """Place of a value in a process image, and its scale.

    SI value = raw * scale + offset.
    """

    bit_offset: int
    bit_length: int  # 1 to 64; REAL: 32 or 64
    kind: NumberKind
    scale: float = 1.0
    offset: float = 0.0


class Bank(IntEnum):
    """Array that contains a column."""

    REAL = 0  # float64, SI units
    INTEGER = 1  # int64, raw
    BIT = 2  # uint8, 0 or 1


@dataclass(frozen=True, slots=True)
class Column:
    """Named value of any mapped object, outside the axes.

    Its index in its bank's array is its rank among the columns of the same bank and direction, in
    the order of the plan.
    """

    name: str
    number: Number
    bank: Bank
    device: int  # position on the segment
    sync_unit: int
    group: str = ""  # adjacent columns of a bank with the same group form one array of this name


@dataclass(frozen=True, slots=True)
class ImageArea:
    """Bytes of an image that an application reads or writes unchanged.

    Their place among the private bytes follows from the sizes of the preceding areas in the plan.
    For outputs, `safe` holds the bytes that are sent when the loop ends; it is as long as the area.
    """

    name: str
    image_offset: int
    size: int
    device: int  # position on the segment
    sync_unit: int
    safe: bytes = b""
    field: str = ""  # name in the rows of a sink; empty: input_bytes or output_bytes


@dataclass(frozen=True, slots=True)
class ImageCopy:
    """Bits of the input image that the core sends as outputs in the next cycle.

    They are whole bytes in both images, or at most 64 bits.
    """

    name: str  # both places as text
    input_bit: int
    output_bit: int
    bit_length: int
    device: int  # position of the destination on the segment
    sync_unit: int  # of the destination


class DatagramKind(IntEnum):
    """Purpose of a datagram in the cycle."""

    PROCESS_DATA = 0
    AL_STATUS = 1  # the BRD of every cycle
    CLOCK = 2  # FPWR of link time, FRMW of the reference clock's time, or FPRD of a difference
    CYCLE_NUMBER = 3  # a NOP, which no device changes; it identifies the frame exactly


@dataclass(frozen=True, slots=True)
class Copy:
    """Bytes to copy between a frame and an image. `frame_offset` counts from the frame's start."""

    frame_offset: int
    image_offset: int
    size: int


@dataclass(frozen=True, slots=True)
class DatagramPlan:
    """One datagram of a cyclic frame."""

    kind: DatagramKind
    command: int
    offset: int  # of its 10-byte header, from the start of the Ethernet frame
    length: int  # of its data
    expected_counter: int
    sync_unit: int  # -1: none
    outputs: tuple[Copy, ...] = ()  # image → frame, before the frame is sent
    inputs: tuple[Copy, ...] = ()  # frame → image, after it returned with the expected counter


@dataclass(frozen=True, slots=True)
class FramePlan:
    """One frame of the cycle.

    `template` is the whole Ethernet frame with zeroed data. The core writes the index of every
    datagram and the outputs into it.
    """

    template: bytes
    datagrams: tuple[DatagramPlan, ...]
    divider: int = 1  # cycles between two transmissions
    phase: int = 0  # sent in cycles with this number modulo `divider`


@dataclass(frozen=True, slots=True)
class SyncUnit:
    """Unit of validity: the data of its devices is valid or stale together."""

    name: str
    devices: tuple[int, ...]  # positions
    optional: bool = False  # True if its loss does not make the cycle bad
    divider: int = 1  # n: exchanged in every n-th cycle


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Limits that the core enforces for all set-points. None: no limit, except for `step`."""

    position_min: float | None = None  # [rad]
    position_max: float | None = None  # [rad]
    velocity: float | None = None  # [rad/s], symmetric; in CSP it bounds the step per cycle
    torque: float | None = None  # [N·m], symmetric
    # [rad] largest difference between two CSP set-points; a larger one is refused.
    # None: max(0.1, 2 · velocity · period · cycles between the two)
    step: float | None = None


@dataclass(frozen=True, slots=True)
class AxisPlan:
    """One CiA 402 axis: slot k of a device (objects + 0x800·k), and the places of its quantities.

    A SERCOS axis is drive k of a device: `controlword` is the place of S-0-0134, `statusword` that
    of S-0-0135, `mode` that of S-0-0032. It has no other modes. A
    quantity that is not exchanged is None. For a linear axis, read rad, rad/s and N·m below as m,
    m/s and N.
    """

    name: str
    device: int
    slot: int
    sync_unit: int
    mode: int  # modes of operation 0x6060 at the start: 1 PP, 3 PV, 8 CSP, 9 CSV, 10 CST
    controlword: Number
    statusword: Number
    mode_target: Number | None = None  # 0x6060
    mode_actual: Number | None = None  # 0x6061
    target_position: Number | None = None  # 0x607A
    target_velocity: Number | None = None  # 0x60FF
    target_torque: Number | None = None  # 0x6071
    actual_position: Number | None = None  # 0x6064
    actual_velocity: Number | None = None  # 0x606C
    actual_torque: Number | None = None  # 0x6077
    position_demand: Number | None = None  # 0x6062
    torque_demand: Number | None = None  # 0x6074
    velocity_offset: Number | None = None  # 0x60B1, if the application writes it as a column
    limits: AxisLimits = AxisLimits()
    # Used only for the fallback and the return from it, never for the application's set-points:
    # docs/explanation/safety.md
    acceleration: float = 25.0  # [rad/s²] on return to the set-points
    deceleration: float = 25.0  # [rad/s²] to standstill, and before a position limit in CSV
    linear: bool = False  # True for m, m/s and N
    standstill: float = 0.05  # [rad/s] largest velocity of an axis at rest
    step_floor: float = 0.1  # [rad] smallest default of the step limit
    torque_slope: float | None = None  # [N·m/s] on return to the set-points in CST; None: at once
    on_loss: OnLoss = "quick_stop"  # reaction when the core stops the axis
    profile: Profile = "cia402"


@dataclass(frozen=True, slots=True)
class ClockPlan:
    """Synchronisation of the cycle and the distributed clocks.

    docs/explanation/distributed_clocks.md explains it.

    If `follow` is "reference", the cycle starts follow the reference clock. If it is "main", the
    reference clock follows the link's clock.
    """

    follow: FollowedClock
    reference: int  # position
    reference_station: int
    followers: tuple[int, ...]  # positions of devices with SYNC signals, without the reference
    stations: tuple[int, ...]  # station addresses of the followers
    phase_ns: int  # of the cycle starts in the reference clock's time, modulo the period
    wire_ns: int  # wire time of the frames, and the delay of all devices
    allowance_ns: int  # longest time from the cycle start to the frames
    bandwidth: float  # final bandwidth of the phase controller [1 / cycle]
    rate_limit_ns: float  # largest total change of a period
    drift_limit_ns: float  # largest permanent change of a period
    step_ns: int  # a larger phase error is a step, not drift
    bound_ns: int  # for the differences from the reference, and for the phase error
    burst: int = 15_000  # frames that carry the time before the cycle begins


@dataclass(frozen=True, slots=True)
class CyclePlan:
    """All data that the core needs to run a cycle."""

    period_ns: int
    execution: ExecutionMode
    receive_mode: ReceiveMode
    collect_deadline_ns: int  # threaded: time from the wake-up until the frames must be back
    output_size: int
    input_size: int
    frames: tuple[FramePlan, ...]
    sync_units: tuple[SyncUnit, ...]
    device_count: int
    axes: tuple[AxisPlan, ...] = ()
    output_columns: tuple[Column, ...] = ()
    input_columns: tuple[Column, ...] = ()
    output_areas: tuple[ImageArea, ...] = ()
    input_areas: tuple[ImageArea, ...] = ()
    copies: tuple[ImageCopy, ...] = ()  # between devices
    lost_limit: int = 3  # consecutive bad cycles before WorkingCounterError
    # Time without fresh set-points (at least 3 cycles) before a quick stop; 0: never (not in CST)
    late_limit_position_ns: int = 50_000_000  # CSP
    late_limit_velocity_ns: int = 50_000_000  # CSV
    late_limit_torque_ns: int = 10_000_000  # CST
    handover_ns: int = 20_000_000  # time for which CST keeps its torque after a law or stream ended
    # Time for which the set-points of a background program are valid after an update
    command_timeout_velocity_ns: int = 200_000_000  # CSV; then the axis decelerates
    command_timeout_torque_ns: int = 20_000_000  # CST; then the axis makes a quick stop
    stop_deadline_ns: int = 2_000_000_000  # longest time from quick stop to standstill
    wire_ns: int = 0  # wire time of the cyclic frames in the busiest cycle
    acyclic_ns: int = 0  # wire time per cycle for acyclic frames; one frame is always allowed
    busy_wait_ns: int = 0  # busy-wait before each cycle start
    log_cycles: int = 1000  # number of cycles in the log
    log_axes: bool = False  # True if the log also has the values of the axes
    cpu: int | None = None  # CPU of the native thread; None: unchanged
    priority: int | None = 80  # SCHED_FIFO; None: unchanged
    clock: ClockPlan | None = None  # None: no distributed clocks
