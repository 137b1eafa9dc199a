"""Motors of virtual servos (servo.h): parameters, state, injected loads and faults."""

from catenary.virtual._segment cimport (
    AXIS_SLOTS,
    PROBES,
    Core,
    cat_segment,
    controller,
    lock,
    probe_wire,
    servo_axis,
    servo_place,
    unlock,
)


cdef class Motors:
    """Motors of all devices of `core`. `position`: position of the device; `axis`: axis number.

    Methods raise IndexError if the device or the axis does not exist.
    """

    cdef Core _core
    cdef cat_segment *_segment

    def __init__(self, Core core not None):
        self._core, self._segment = core, core._segment

    def make(self, int position, int axis, *, double inertia, double viscous, double coulomb,
             double rated_torque, double velocity_limit, double counts_per_radian,
             double velocity_per_radian, double position_gain, double velocity_gain,
             double integral_gain, double boot):
        cdef servo_axis *a = self._core._axis(position, axis)
        a.inertia, a.viscous, a.coulomb = inertia, viscous, coulomb
        a.rated_torque, a.velocity_limit = rated_torque, velocity_limit
        a.counts_per_radian, a.velocity_per_radian = counts_per_radian, velocity_per_radian
        a.radian_per_count, a.radian_per_velocity = 1 / counts_per_radian, 1 / velocity_per_radian
        a.per_inertia, a.per_torque = 1 / inertia, 1 / rated_torque
        a.position_gain, a.velocity_gain = position_gain, velocity_gain
        a.integral_gain, a.boot = integral_gain, boot

    def set_quirks(self, int position, int axis, *, double mode_delay, unsigned int refused_modes,
                   bint never_bit_12, bint follows_without_bit_12, bint ignores_quick_stop,
                   bint ignores_disable):
        """Set the differences of the drive from the profile (see devices/servo_quirks.py)."""
        cdef servo_axis *a = self._core._axis(position, axis)
        a.quirks.mode_delay, a.quirks.refused_modes = mode_delay, refused_modes
        a.quirks.never_bit_12 = never_bit_12
        a.quirks.follows_without_bit_12 = follows_without_bit_12
        a.quirks.ignores_quick_stop, a.quirks.ignores_disable = ignores_quick_stop, ignores_disable

    def hide_bit_12(self, int position, int axis, double seconds):
        """Hide bit 12 of the statusword for `seconds`, from the next step on."""
        self._core._axis(position, axis).bit_12_hidden = seconds

    def state(self, int position, int axis):
        """Return (position [rad], velocity [rad/s], torque [N m], state)."""
        cdef servo_axis *a = self._core._axis(position, axis)
        return a.position, a.velocity, a.torque, a.state

    def tune(self, int position, int axis, *, double velocity_gain, double integral_gain):
        """Set the gains of the velocity loop: proportional [N m s/rad], integral [N m/rad]."""
        cdef servo_axis *a = self._core._axis(position, axis)
        a.velocity_gain, a.integral_gain = velocity_gain, integral_gain

    def place(self, int position, int axis, double to):
        """Move the shaft to a position [rad], in a plant at its next step."""
        cdef servo_axis *a = self._core._axis(position, axis)
        lock(self._segment)
        servo_place(a, to)
        unlock(self._segment)

    def load(self, int position, int axis, double load):
        """Apply an external torque to the shaft, until the next call [N m]."""
        self._core._axis(position, axis).load = load

    def inject(self, int position, int axis, int code):
        """Inject a fault with this error code. 0 removes the cause."""
        self._core._axis(position, axis).injected = code

    def set_probe_quirks(self, int position, int axis, *, bint toggles, bint keeps_stored,
                         bint one_edge):
        """Set the differences of the touch probes (see devices/touch_probe.py)."""
        cdef servo_axis *a = self._core._axis(position, axis)
        a.probe_quirks.toggles, a.probe_quirks.keeps_stored = toggles, keeps_stored
        a.probe_quirks.one_edge = one_edge

    def set_probe_switch(self, int position, int axis, int number, double first, double end):
        """Close the switch of a probe input from position `first` to `end` [rad]."""
        cdef servo_axis *a = self._core._axis(position, axis)
        check_probe(number)
        lock(self._segment)
        a.probes[number].from_, a.probes[number].to = first, end
        unlock(self._segment)

    def set_probe_input(self, int position, int axis, int number, bint level):
        """Set the wire of a probe input now."""
        cdef servo_axis *a = self._core._axis(position, axis)
        cdef controller *c = self._core._at(position)
        check_probe(number)
        lock(self._segment)
        probe_wire(c, a, c.slots + axis * AXIS_SLOTS, number, level)
        unlock(self._segment)

    def stop_torque(self, int position, int axis, bint active):
        """Activate or deactivate safe torque off (STO)."""
        self._core._axis(position, axis).sto = active


cdef int check_probe(int number) except -1:
    """Raise IndexError unless a probe input exists."""
    if not 0 <= number < PROBES:
        raise IndexError(f"probe input must be 0 or {PROBES - 1}, not {number}")
    return 0
