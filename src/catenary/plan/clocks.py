"""Choice of clocks, SYNC times, and the time of the cyclic frames before SYNC0.

SYNC0 of all devices fires at multiples of the period in the reference clock's time, plus the shift
of each device. Frames leave early enough before the common SYNC0 time to reach all devices:

    cycle start ──allowance── frames on the wire ──hops── SYNC0 (shift 0)

ETG.1020 §"Distributed clocks"; registers 0x0980 to 0x09A7: ETG.1000.4 §6.8.5. Start times and
alignment follow SOEM's `ecx_dcsync01` and IgH's `ec_fsm_slave_config_state_dc_sync_check`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, OpMode
from catenary.plan.cycle import ClockPlan, ExecutionMode, FollowedClock, FramePlan
from catenary.plan.op_mode import SYNC_BY_ECAT, choose_mode, starts_sync
from catenary.wire.clock import Activation
from catenary.wire.frame import wire_time_ns

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import DistributedClock

BURST = 15_000  # frames: ESC data sheet I §9.1.5; KickCAT uses 15 000, ethercrab 10 000
START_DELAY_NS = 100_000_000  # until the first SYNC pulse, as in SOEM (`SyncDelay`) and IgH
HOP_NS = 1000  # delay of a device and its cable: 0.3 µs by E-bus, up to 1 µs by Ethernet PHYs
# Share of the period between the cycle start and the frames. Threaded: it covers a late wake-up.
# Inline: it also covers the body, which precedes the frames.
ALLOWANCE: dict[ExecutionMode, float] = {"threaded": 0.2, "inline": 0.5}

# Phase controller (docs/explanation/distributed_clocks.md): a critically damped loop with this time
# constant. Its bandwidth starts higher and decreases. Its change of the period is limited.
TIME_CONSTANT = 0.1  # [s]
CYCLES_MIN = 16  # shortest time constant [cycles]; the response takes one or two cycles
RATE_LIMIT = 1e-3  # of the period; small enough for the interpolation of a servo
DRIFT_LIMIT = 8e-4  # of the period, permanent part: crystals 2 · 100 ppm, NTP slew 500 ppm
STEP_SHARE = 1 / 8  # of the period: a larger phase error is a step, not drift
BOUND_NS = 1000

SYNC_TYPE_SYNC0, SYNC_TYPE_SYNC1 = 2, 3  # 0x1C32:01 and 0x1C33:01, ETG.1020 §"Synchronization"
SYNC_OBJECTS = (0x1C32, 0x1C33)
REGISTER_END = 1 << 32  # of 0x09A0 and 0x09A4 [ns]


@dataclass(frozen=True, slots=True)
class SyncPlan:
    """Settings of the SYNC unit of one device."""

    assign_activate: int  # registers 0x0980 (low byte) and 0x0981
    cycle_ns: int  # of SYNC0
    sync1_ns: int  # from SYNC0 to SYNC1
    shift_ns: int  # of SYNC0 after the common SYNC0 time
    op_mode: str = ""  # name of the OpMode in the ESI or SII that it follows
    # Source of the OpMode: "ESI drive.xml:12" or "SII"; empty without an OpMode
    source: str = field(default="", compare=False)

    @property
    def activation(self) -> Activation:
        return Activation(self.assign_activate >> 8)

    @property
    def span_ns(self) -> int:
        """Time after which the signals repeat: SYNC1 may be less frequent than SYNC0."""
        return (self.sync1_ns // self.cycle_ns + 1) * self.cycle_ns

    @property
    def objects(self) -> tuple[tuple[int, int, bytes], ...]:
        """Objects for the device's application in PRE-OP: index, subindex, data."""
        on_sync1 = Activation.SYNC1 in self.activation
        kind = struct.pack("<H", SYNC_TYPE_SYNC1 if on_sync1 else SYNC_TYPE_SYNC0)
        cycle = struct.pack("<I", self.span_ns)
        return tuple(
            (index, subindex, data)
            for index in SYNC_OBJECTS
            for subindex, data in ((1, kind), (2, cycle))
        )


@dataclass(frozen=True, slots=True)
class ClockChoice:
    """Devices that take part in the clock synchronisation."""

    reference: DeviceDescription
    followers: tuple[DeviceDescription, ...]  # with a SYNC signal, without the reference
    listeners: int  # number of devices that answer a broadcast of the time, reference included
    follow: FollowedClock


def choose_clocks(
    devices: Sequence[DeviceDescription],
    requests: Mapping[int, DistributedClock],
    follow: FollowedClock,
    reference: int | None = None,
) -> ClockChoice | None:
    """Return the reference clock and its followers; None if no request needs clocks.

    Args:
        devices: All devices, by position.
        requests: Clock requests by position.
        reference: Position of the reference clock; None: the first device with a system time, as
            in other masters.
        follow: "reference" or "main": see `ClockPlan`.

    Raises:
        ConfigurationError: A device does not exist, has no suitable clock, or precedes the
            reference clock.
    """
    if not requests:
        return None
    running = [device for device in devices if device.clock_bits]
    chosen = running[0] if reference is None and running else None
    if reference is not None:
        chosen = _existing(devices, reference)
    for position in sorted(requests):
        _check_follower(_existing(devices, position), chosen)
    assert chosen is not None  # at least one request has passed the check
    if not chosen.clock_bits:
        raise _no_clock(chosen, "it was given as the reference clock")
    return ClockChoice(
        chosen,
        tuple(d for d in running if d.position in requests and d is not chosen),
        len(running),
        follow,
    )


def make_sync(
    device: DeviceDescription, request: DistributedClock, period_ns: int, lead_ns: int = 0
) -> SyncPlan:
    """Return the settings of a device's SYNC unit, as requested or from its OpMode.

    Args:
        device: Device.
        request: Clock request.
        period_ns: Period of the device's exchange [ns].
        lead_ns: Time from the start of the frames to the common SYNC0 time [ns].

    Raises:
        ConfigurationError: The device has no OpMode with the requested name, or a setting is
            impossible.
    """
    mode = choose_mode(device, request)
    cycle_ns = _in_ns(request.sync0, mode.sync0_ns or _multiple(period_ns, mode.sync0_factor))
    assign = mode.assign_activate if request.assign_activate is None else request.assign_activate
    if request.sync1 is not None:
        assign |= Activation.SYNC1 << 8
    plan = SyncPlan(
        assign,
        cycle_ns,
        _in_ns(request.sync1, _sync1_ns(mode, cycle_ns, period_ns)),
        _in_ns(request.shift, mode.shift_ns),
        mode.name,
        _source(device, mode),
    )
    if request.shift is None and (mode.shift_factor or mode.shift_of_inputs):
        plan = replace(plan, shift_ns=_derived_shift_ns(mode, plan, lead_ns))
    _check_sync(device, request, plan, period_ns)
    return plan


def make_clock_plan(
    choice: ClockChoice,
    frames: Sequence[FramePlan],
    device_count: int,
    period_ns: int,
    execution: ExecutionMode,
    margin: float | None = None,
    burst: int = BURST,
) -> ClockPlan:
    """Return the clock settings of the cycle.

    Args:
        choice: Reference clock and followers.
        frames: Frames of the cycle.
        device_count: Number of devices on the segment.
        period_ns: Period of the cycle [ns].
        execution: Execution mode of the loop.
        margin: Time between the cycle start and the frames [s]; None: a share of the period that
            depends on the execution mode.
        burst: Number of frames for static drift compensation.

    Raises:
        ConfigurationError: The frames and the margin do not fit into the period, or `margin` or
            `burst` is negative.
    """
    if burst < 0:
        raise ConfigurationError(
            f"burst={burst}: must be 0 or more frames", hint="omit burst= for the default"
        )
    wire_ns = sum(wire_time_ns(len(frame.template)) for frame in frames) + HOP_NS * device_count
    allowance_ns = round(ALLOWANCE[execution] * period_ns if margin is None else margin * 1e9)
    if allowance_ns < 0 or wire_ns + allowance_ns > period_ns:
        raise ConfigurationError(
            f"{wire_ns / 1e3:g} us of frames and {allowance_ns / 1e3:g} us before them do not fit "
            f"into a period of {period_ns / 1e3:g} us",
            hint="use a longer period, or a smaller margin before the frames",
        )
    cycles = max(TIME_CONSTANT * 1e9 / period_ns, CYCLES_MIN)
    return ClockPlan(
        follow=choice.follow,
        reference=choice.reference.position,
        reference_station=choice.reference.station_address,
        followers=tuple(device.position for device in choice.followers),
        stations=tuple(device.station_address for device in choice.followers),
        phase_ns=-(wire_ns + allowance_ns) % period_ns,
        wire_ns=wire_ns,
        allowance_ns=allowance_ns,
        bandwidth=1 / cycles,
        rate_limit_ns=RATE_LIMIT * period_ns,
        drift_limit_ns=DRIFT_LIMIT * period_ns,
        step_ns=round(STEP_SHARE * period_ns),
        bound_ns=BOUND_NS,
        burst=burst,
    )


def start_time_ns(now_ns: int, syncs: Sequence[SyncPlan]) -> int:
    """Return the first SYNC0 time.

    All devices can be configured before this time. Apart from shifts, all SYNC signals start at it.

    Args:
        now_ns: Present time of the reference clock [ns].
        syncs: SYNC units of all devices.
    """
    span = math.lcm(*(sync.span_ns for sync in syncs))
    return -(-(now_ns + START_DELAY_NS) // span) * span


def _existing(devices: Sequence[DeviceDescription], position: int) -> DeviceDescription:
    if not 0 <= position < len(devices):
        raise ConfigurationError(
            f"clocks: there is no device {position}; the segment has {len(devices)} devices",
            hint="scan again, or correct the position",
        )
    return devices[position]


def _check_follower(device: DeviceDescription, reference: DeviceDescription | None) -> None:
    if not device.clock_bits:
        raise _no_clock(device, "dc= was requested")
    if reference is not None and device.position < reference.position:
        raise ConfigurationError(
            f"{device} precedes {reference}, the reference clock: frames pass it before they "
            "contain the time",
            hint="choose a reference clock before all devices with dc=",
        )


def _no_clock(device: DeviceDescription, why: str) -> ConfigurationError:
    only = device.controller.supports_clocks
    what = "it only latches receive times" if only else "it has no distributed clock"
    return ConfigurationError(
        f"{device}: {why}, but {what}",
        hint="omit dc= for this device, or look for a variant of it with distributed clocks",
    )


def _check_sync(
    device: DeviceDescription, request: DistributedClock, plan: SyncPlan, period_ns: int
) -> None:
    """Raise ConfigurationError for impossible values.

    The error names the ESI or EEPROM if a value comes from it, as the program does not show it.
    """
    esi = plan.source.removeprefix("ESI ") if plan.source.startswith("ESI ") else ""
    eeprom = f"{device}: {esi or 'its EEPROM'} (OpMode {plan.op_mode!r})"
    file = "ESI" if esi else "EEPROM"
    if not starts_sync(plan.assign_activate):
        own = request.assign_activate is None
        raise ConfigurationError(
            f"{eeprom if own else device}: AssignActivate 0x{plan.assign_activate:04X} does "
            "not start a SYNC signal",
            hint="use the value of its ESI file (Dc/OpMode/AssignActivate), often 0x0300: "
            f"{replace(request, assign_activate=SYNC_BY_ECAT)}",
        )
    if not 0 < plan.cycle_ns < REGISTER_END or plan.sync1_ns >= REGISTER_END:
        raise ConfigurationError(
            f"{eeprom}: SYNC0 every {_time(plan.cycle_ns)} and SYNC1 {_time(plan.sync1_ns)} later "
            "do not fit into registers of 32 bits [ns]",
            hint=f"override it: {replace(request, sync0=period_ns / 1e9, sync1=0.0)}",
        )
    if plan.cycle_ns % period_ns and period_ns % plan.cycle_ns:
        own = request.sync0 is None
        raise ConfigurationError(
            f"{eeprom if own else device}: SYNC0 every {plan.cycle_ns / 1e3:g} us does not fit "
            f"a period of {period_ns / 1e3:g} us",
            hint="one must be a multiple of the other: change the period"
            + f", or override the {file}: {replace(request, sync0=period_ns / 1e9)}" * own,
        )
    if abs(plan.shift_ns) >= plan.span_ns:
        own = request.shift is None
        raise ConfigurationError(
            f"{eeprom if own else device}: a shift of {_time(plan.shift_ns)} is not less than the "
            f"cycle of {_time(plan.span_ns)}",
            hint="use a shift of less than one cycle"
            + f"; override the {file}: {replace(request, shift=0.0)}" * own,
        )


def _time(ns: int) -> str:
    return f"{ns / 1e9:.4g} s" if abs(ns) >= 1_000_000_000 else f"{ns / 1e3:g} us"


def _in_ns(seconds: float | None, default_ns: int) -> int:
    return default_ns if seconds is None else round(seconds * 1e9)


def _multiple(period_ns: int, factor: int) -> int:
    """Return a multiple or an integer fraction of the period: ETG.2000, CycleTimeSync0@Factor.

    A negative factor divides. 0 counts as 1.
    """
    if factor < 0:
        return period_ns // -factor
    return period_ns * (factor or 1)


def _derived_shift_ns(mode: OpMode, plan: SyncPlan, lead_ns: int) -> int:
    """Return the time of SYNC0 after the common SYNC0 time.

    ETG.2000, Dc/OpMode/ShiftTimeSync0: @Factor adds SYNC0 cycles, and @Input counts from the start
    of the frames instead of the outputs. Inputs are then ready for the next frame: an EL3702 has
    -10 us and the factor 1, so SYNC0 fires 10 us before the frames.
    """
    shift_ns = mode.shift_ns + mode.shift_factor * plan.cycle_ns
    if mode.shift_of_inputs:
        shift_ns -= lead_ns
    return shift_ns % plan.span_ns if plan.cycle_ns else shift_ns


def _source(device: DeviceDescription, mode: OpMode) -> str:
    if mode.source:
        return f"ESI {mode.source}"
    return "SII" if mode in device.op_modes else ""


def _sync1_ns(mode: OpMode, cycle_ns: int, period_ns: int) -> int:
    """Return register 0x09A4: the time from SYNC0 to the SYNC1 that follows it.

    ETG.2000, Dc/OpMode/CycleTimeSync1@Factor: the cycle of SYNC1 in SYNC0 cycles, or in
    periods if the factor is negative. This cycle is the SYNC0 cycle plus the register (Beckhoff,
    ESC data sheet I §9.2.3.5; also SOEM's `ecx_dcsync01` and IgH's master/fsm_slave_config.c). An
    EL3702 with four-fold oversampling has the factors -4 and -1: 250 us and 750 us at 1 ms (ecmc's
    notes on DC clocks).
    """
    span_ns = -mode.sync1_factor * period_ns
    if mode.sync1_ns:
        span_ns = mode.sync1_ns
    elif mode.sync1_factor >= 0:
        span_ns = (mode.sync1_factor or 1) * cycle_ns
    return max(0, span_ns - cycle_ns + mode.sync1_shift_ns)
