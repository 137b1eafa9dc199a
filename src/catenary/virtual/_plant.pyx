"""Compiled side of a plant (plant.h): it accesses a MuJoCo model and its arrays by address."""

from libc.stdint cimport int64_t, uint8_t, uint64_t, uintptr_t
from libc.stdlib cimport calloc

from catenary.virtual._segment cimport (
    MAX_MEMBERS,
    MAX_SENSORS,
    Core,
    controller,
    mujoco_message,
    plant,
    plant_begin,
    plant_free,
    plant_hang,
    plant_joint,
    plant_lock,
    plant_run,
    plant_sensor,
    plant_unlock,
)


cdef class CompiledPlant:
    """Owner of a plant, which keeps its model and the segments that belong to it alive."""

    cdef plant *_plant
    cdef list _cores
    cdef object _keep

    def __init__(self, int joints, *, uintptr_t step, uintptr_t set_handler, uintptr_t model, uintptr_t data,
                 int64_t period_ns, keep):
        """Create a plant without segments.

        Args:
            joints: Number of joints with a motor.
            step: Address of mj_step.
            set_handler: Address of the function that sets the message handler of a thread; 0: none.
            model: Address of an mjModel.
            data: Address of an mjData.
            period_ns: Time step [ns].
            keep: Owner of the model and its data.

        Raises:
            ValueError: A value is out of range.
            MemoryError: Out of memory.
        """
        cdef plant *p
        if not (0 <= joints <= 4096 and period_ns >= 1000 and step and model and data):
            raise ValueError(f"invalid plant: {joints} joints, period {period_ns} ns; all addresses must"
                             " be non-zero")
        p = self._plant = <plant *>calloc(1, sizeof(plant))
        if p != NULL:
            p.joints = <plant_joint *>calloc(joints + 1, sizeof(plant_joint))
        if p == NULL or p.joints == NULL:
            raise MemoryError("cannot allocate memory for the plant")
        p.step = <void (*)(const void *, void *) noexcept nogil>step
        p.set_handler = <void (*)(void (*)(const mujoco_message *) noexcept nogil) noexcept nogil>set_handler
        p.model, p.data = <const void *>model, <void *>data
        p.count, p.period = joints, period_ns
        self._cores, self._keep = [], keep

    def __dealloc__(self):
        plant_free(self._plant)

    cdef plant_joint *_joint(self, int n) except NULL:
        if not 0 <= n < self._plant.count:
            raise IndexError(f"the plant has no joint {n}")
        return &self._plant.joints[n]

    def make_joint(self, int n, *, uintptr_t q, uintptr_t v, uintptr_t force, uintptr_t friction,
                   double ratio, double zero, double dry, double brake, int64_t brake_delay_ns=0):
        """Set the parameters of joint n.

        Args:
            n: Number of the joint.
            q: Address of its value in qpos.
            v: Address of its value in qvel.
            force: Address of its value in qfrc_applied.
            friction: Address of its value in dof_frictionloss.
            ratio: Motor angle per joint angle, signed.
            zero: Joint position at which the motor angle is 0 [rad or m].
            dry: Dry friction at the joint [N·m or N].
            brake: Additional friction of the closed brake [N·m or N].
            brake_delay_ns: Closing time of the brake [ns].

        Raises:
            IndexError: The joint does not exist.
            ValueError: An address or the ratio is 0.
        """
        cdef plant_joint *j = self._joint(n)
        if not (q and v and force and friction and ratio):
            raise ValueError(f"invalid joint {n}: the addresses and the ratio must be non-zero")
        j.q, j.v, j.force, j.friction = <double *>q, <double *>v, <double *>force, <double *>friction
        j.ratio, j.zero, j.dry, j.brake = ratio, zero, dry, brake
        j.brake_delay = brake_delay_ns

    def hang(self, int n, Core core, int position, int axis):
        """Connect the motor of an axis to joint n, and copy the state of the joint to the motor.

        Args:
            n: Number of the joint.
            core: The segment of the motor.
            position: Position of the device.
            axis: Axis number.

        Raises:
            IndexError: The joint, the device or the axis does not exist.
        """
        cdef plant_joint *j = self._joint(n)
        core._axis(position, axis)           # raises before the lock is taken
        plant_lock(self._plant)
        plant_hang(j, core._axis(position, axis))
        plant_unlock(self._plant)

    def show(self, uintptr_t value, Core core, int position, int slot, *, double scale, double bias,
             double noise, uint64_t seed):
        """Show a number of the model in a slot of a device after each step, as REAL32.

        Args:
            value: Address of the number, in sensordata.
            core: The segment of the device.
            position: Position of the device.
            slot: Number of the slot.
            scale: Factor of the sum of value, bias and noise.
            bias: Constant error.
            noise: Standard deviation of the noise.
            seed: Start of the sequence of the noise.

        Raises:
            IndexError: The device or the slot does not exist.
            ValueError: The plant has too many sensors, or the address is 0.
        """
        cdef controller *c = core._at(position)
        cdef plant_sensor *n
        if not 0 <= slot < c.slot_count:
            raise IndexError(f"the device at position {position} has no slot {slot}")
        n = self._free_sensor()
        if n == NULL or not value:
            raise ValueError(f"devices can show at most {MAX_SENSORS} numbers of a model")
        plant_lock(self._plant)
        n.value, n.slot = <const double *>value, &c.slots[slot]
        n.scale, n.bias, n.noise, n.random = scale, bias, noise, seed
        plant_unlock(self._plant)

    cdef plant_sensor *_free_sensor(self) noexcept:
        """Return a sensor without a device; NULL if there is none."""
        cdef plant *p = self._plant
        cdef int k
        for k in range(p.sensor_count):
            if p.sensors[k].slot == NULL:
                return &p.sensors[k]
        if p.sensor_count == MAX_SENSORS:
            return NULL
        p.sensor_count += 1
        return &p.sensors[p.sensor_count - 1]

    def free(self, uintptr_t active):
        """Deactivate a constraint before the next step.

        Args:
            active: Address of its value in eq_active.

        Raises:
            ValueError: The address is 0.
        """
        if not active:
            raise ValueError("the address of the constraint must be non-zero")
        plant_lock(self._plant)
        self._plant.freed = <uint8_t *>active
        plant_unlock(self._plant)

    def add_member(self, Core core):
        """Step the plant together with a segment.

        Raises:
            ValueError: The segment already has a plant, or the plant has too many segments.
        """
        cdef plant *p = self._plant
        if core._segment.plant != NULL:
            raise ValueError("the segment already has a plant")
        if p.member_count == MAX_MEMBERS:
            raise ValueError(f"a plant can have at most {MAX_MEMBERS} segments")
        p.members[p.member_count] = core._segment
        p.member_count += 1
        core._segment.plant = p
        core._plant, core._partners = self, self._cores
        self._cores.append(core)
        plant_begin(p, core._segment.now)

    def run(self):
        """Run the plant and the due work of its segments in real time.

        The method returns after `end` was called, or after a step has failed.
        """
        with nogil:
            plant_run(self._plant)

    def end(self):
        self._plant.ending = 1

    @property
    def steps(self) -> int:
        return self._plant.steps

    @property
    def wild(self) -> int:
        """Number of the joint whose velocity exceeded the maximum and stopped the plant; -1: none."""
        return self._plant.wild - 1

    @property
    def apart(self) -> bool:
        """True if the plant was stopped because its segments do not have the same clock."""
        return bool(self._plant.apart)

    @property
    def complaint(self) -> str:
        """Warning or error message of MuJoCo that stopped the plant; empty: none."""
        return (<bytes>self._plant.words).decode("utf-8", "replace")
