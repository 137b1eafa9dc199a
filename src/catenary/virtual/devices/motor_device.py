"""Base class of devices with motors: servos, and twins of drives.

The motors, their control loops and the state machine of CiA 402 are compiled (`servo.h`).
They run in the internal cycle of the device.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from catenary.virtual import _segment
from catenary.virtual._motors import Motors
from catenary.virtual.devices.applied import AppliedDevice
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.servo_quirks import NO_QUIRKS, ServoQuirks
from catenary.virtual.devices.touch_probe import ProbeOptions
from catenary.virtual.scheduler import Scheduler

STEP_NS = 250_000  # internal cycle
BOOT_SECONDS = 0.02
VELOCITY_BANDWIDTH = 2 * math.pi * 80  # rad/s
POSITION_BANDWIDTH = 100.0  # rad/s
STATES = (
    "NOT READY TO SWITCH ON",
    "SWITCH ON DISABLED",
    "READY TO SWITCH ON",
    "SWITCHED ON",
    "OPERATION ENABLED",
    "QUICK STOP ACTIVE",
    "FAULT REACTION ACTIVE",
    "FAULT",
)


class Received(NamedTuple):
    """Outputs of one axis, as raw values of its objects."""

    controlword: int  # 0x6040
    position: int  # 0x607A, counts
    velocity: int  # 0x60FF, counts per second
    torque: int  # 0x6071, per mille of the rated torque


RECEIVED_SLOTS = (
    _segment.SLOT_CONTROLWORD,
    _segment.SLOT_TARGET_POSITION,
    _segment.SLOT_TARGET_VELOCITY,
    _segment.SLOT_TARGET_TORQUE,
)


class MotorDevice(AppliedDevice):
    """A virtual device with 0 to 8 CiA 402 axes and their motors."""

    motors: tuple[Motor, ...] = ()
    quirks: ServoQuirks = NO_QUIRKS
    touch_probe: ProbeOptions | None = None

    def install_motors(self, motors: Sequence[Motor], quirks: ServoQuirks = NO_QUIRKS) -> None:
        """Set the motors of the axes, before the device is added to a segment.

        Args:
            motors: Motor of each axis, at most 8.
            quirks: Differences of the axes from the profile.

        Raises:
            ValueError: There are too many axes.
        """
        if len(motors) > _segment.AXES_MAX:
            raise ValueError(f"axes must be 1 to {_segment.AXES_MAX}, not {len(motors)}")
        self.motors = tuple(motors)
        self.quirks = quirks
        self._inertias = [motor.inertia for motor in motors]  # for which the loops are tuned

    @property
    def axes(self) -> int:
        """Number of axes."""
        return len(self.motors)

    def started(self, scheduler: Scheduler) -> None:
        for axis in range(self.axes):
            self._start_motor(axis)
        super().started(scheduler)
        if self.axes:
            self.core.run_model(self.position, STEP_NS)

    def _start_motor(self, axis: int) -> None:
        motor, quirks = self.motors[axis], self.quirks
        velocity_gain, integral_gain = self._gains(axis)
        self._motors.make(
            self.position,
            axis,
            inertia=motor.inertia,
            viscous=motor.viscous_friction,
            coulomb=motor.coulomb_friction,
            rated_torque=motor.rated_torque,
            velocity_limit=motor.max_velocity,
            counts_per_radian=motor.counts_per_radian,
            velocity_per_radian=motor.velocity_per_radian,
            position_gain=POSITION_BANDWIDTH,
            velocity_gain=velocity_gain,
            integral_gain=integral_gain,
            boot=BOOT_SECONDS,
        )
        self._motors.set_quirks(
            self.position,
            axis,
            mode_delay=quirks.mode_delay,
            refused_modes=quirks.refused_mask,
            never_bit_12=quirks.bit_12 == "never",
            follows_without_bit_12=quirks.follows_without_bit_12,
            ignores_quick_stop=quirks.ignores_quick_stop,
            ignores_disable=quirks.ignores_disable,
        )
        if self.touch_probe is not None:
            self._motors.set_probe_quirks(
                self.position,
                axis,
                toggles=self.touch_probe.toggles,
                keeps_stored=self.touch_probe.keeps_stored,
                one_edge=self.touch_probe.one_edge,
            )
        for slot, value in self.presets(axis).items():
            self.core.put_slot(self.position, _segment.SLOTS_PER_AXIS * axis + slot, value)

    def presets(self, axis: int) -> dict[int, int]:
        """Return the initial values of the slots of an axis."""
        quick_stop = self.quirks.quick_stop_option
        return {
            **self.motors[axis].presets(),
            _segment.SLOT_ABORT_CONNECTION_OPTION: self.quirks.abort_connection_option,
            _segment.SLOT_QUICK_STOP_OPTION: 2 if quick_stop == "absent" else quick_stop,
        }

    def _gains(self, axis: int) -> tuple[float, float]:
        velocity_gain = self._inertias[axis] * VELOCITY_BANDWIDTH
        return velocity_gain, velocity_gain * VELOCITY_BANDWIDTH / 5

    def tune(self, inertia: float, axis: int = 0) -> None:
        """Tune the velocity loop to a total inertia.

        Args:
            inertia: Total inertia at the motor shaft, including the motor [kg·m²].
            axis: Axis number.
        """
        self._inertias[axis] = inertia
        velocity_gain, integral_gain = self._gains(axis)
        self._motors.tune(
            self.position, axis, velocity_gain=velocity_gain, integral_gain=integral_gain
        )

    @property
    def _motors(self) -> Motors:
        return Motors(self.core)

    # -- for tests and plants ------------------------------------------------------------------

    def axis_position(self, axis: int = 0) -> float:
        """Return the exact position of the motor [rad]."""
        return self._motors.state(self.position, axis)[0]

    @property
    def position_rad(self) -> float:
        """Exact position of the first axis [rad]."""
        return self.axis_position()

    @property
    def velocity_rad_s(self) -> float:
        """Exact velocity of the first axis [rad/s]."""
        return self._motors.state(self.position, 0)[1]

    @property
    def torque_nm(self) -> float:
        """Motor torque of the first axis [N·m]."""
        return self._motors.state(self.position, 0)[2]

    def received(self, axis: int = 0) -> Received:
        """Return the present controlword and targets of the axis, as raw values."""
        first = _segment.SLOTS_PER_AXIS * axis
        return Received(*(self.core.slot(self.position, first + slot) for slot in RECEIVED_SLOTS))

    def drive_state(self, axis: int = 0) -> str:
        """Return the name of the CiA 402 state."""
        return STATES[self._motors.state(self.position, axis)[3]]

    def move_to(self, position: float, axis: int = 0) -> None:
        """Move the shaft to a position, as if by hand.

        Args:
            position: New position [rad].
            axis: Axis number.
        """
        self._motors.place(self.position, axis, position)

    def apply_load(self, torque: float, axis: int = 0) -> None:
        """Apply an external torque to the shaft, until the next call.

        Args:
            torque: Torque [N·m].
            axis: Axis number.
        """
        self._motors.load(self.position, axis, torque)

    def inject_fault(self, code: int, axis: int = 0) -> None:
        """Inject a fault.

        Args:
            code: Error code (0x603F). 0 removes the cause, so that the fault can be reset.
            axis: Axis number.
        """
        self._motors.inject(self.position, axis, code)

    def set_probe_input(self, probe: int, active: bool, axis: int = 0) -> None:
        """Set the input of a touch probe now.

        Args:
            probe: Number of the input, 1 or 2.
            active: Level of the input.
            axis: Axis number.
        """
        self._motors.set_probe_input(self.position, axis, probe - 1, active)

    def place_probe_switch(
        self, probe: int, first: float, end: float = math.inf, axis: int = 0
    ) -> None:
        """Place a switch at the input of a touch probe. It is closed from `first` to `end`.

        Args:
            probe: Number of the input, 1 or 2.
            first: Position of the motor at which the switch closes in positive direction [rad].
            end: Position at which it opens again [rad].
            axis: Axis number.
        """
        self._motors.set_probe_switch(self.position, axis, probe - 1, first, end)

    def hide_bit_12(self, seconds: float, axis: int = 0) -> None:
        """Hide bit 12 of the statusword from the next step on.

        While the bit is hidden, the drive holds its last demand value. With the quirk
        `follows_without_bit_12`, it follows its targets instead.

        Args:
            seconds: Duration [s]; `inf`: without end.
            axis: Axis number.
        """
        self._motors.hide_bit_12(self.position, axis, seconds)

    def switch_sto(self, active: bool, axis: int = 0) -> None:
        """Activate or deactivate safe torque off (STO).

        Args:
            active: True activates STO, which removes the torque.
            axis: Axis number.
        """
        self._motors.stop_torque(self.position, axis, active)
