"""Compiled side of a plant (plant.h): it accesses a MuJoCo model and its arrays by address."""

from libc.stdint cimport int64_t, uintptr_t
from libc.stdlib cimport calloc

from catenary.virtual._segment cimport (
    Core,
    cat_segment,
    lock,
    monotonic_now,
    mujoco_message,
    plant,
    plant_free,
    plant_hang,
    plant_joint,
    segment_work,
    unlock,
)

cdef extern from "<time.h>" nogil:
    enum:
        CLOCK_MONOTONIC, TIMER_ABSTIME
    struct timespec:
        int64_t tv_sec
        long tv_nsec
    int clock_nanosleep(int clock, int flags, const timespec *until, timespec *left)

cdef enum:
    LONGEST_SLEEP = 20000000             # maximum delay until the thread notices `end` [ns]


cdef void _sleep(int64_t until) noexcept nogil:
    cdef timespec t
    t.tv_sec, t.tv_nsec = until // 1000000000, until % 1000000000
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL)


cdef class CompiledPlant:
    """View of the plant of `core`. After `begin`, the core owns the plant."""

    cdef Core _core
    cdef plant *_plant

    def __init__(self, Core core, int joints, *, uintptr_t step, uintptr_t set_handler, uintptr_t model,
                 uintptr_t data, int64_t period_ns, keep):
        """Create a plant for the segment.

        Args:
            core: The compiled segment.
            joints: Number of joints with a motor.
            step: Address of mj_step.
            set_handler: Address of the function that sets the message handler of a thread; 0: none.
            model: Address of an mjModel.
            data: Address of an mjData.
            period_ns: Time step [ns].
            keep: Owner of the model and its data, which the core keeps alive.

        Raises:
            ValueError: The segment already has a plant, or a value is out of range.
            MemoryError: Out of memory.
        """
        cdef plant *p
        if core._segment.plant != NULL:
            raise ValueError("the segment already has a plant")
        if not (0 < joints <= 4096 and period_ns >= 1000 and step and model and data):
            raise ValueError(f"invalid plant: {joints} joints, period {period_ns} ns; all addresses must"
                             " be non-zero")
        p = <plant *>calloc(1, sizeof(plant))
        self._core, self._plant = core, p
        if p != NULL:
            p.joints = <plant_joint *>calloc(joints, sizeof(plant_joint))
        if p == NULL or p.joints == NULL:
            raise MemoryError("cannot allocate memory for the plant")
        p.step = <void (*)(const void *, void *) noexcept nogil>step
        p.set_handler = <void (*)(void (*)(const mujoco_message *) noexcept nogil) noexcept nogil>set_handler
        p.model, p.data = <const void *>model, <void *>data
        p.count, p.period = joints, period_ns
        core._plant = keep

    def __dealloc__(self):
        if self._core is not None and self._core._segment.plant != self._plant:
            plant_free(self._plant)          # `begin` was never called

    cdef plant_joint *_joint(self, int n) except NULL:
        if not 0 <= n < self._plant.count:
            raise IndexError(f"the plant has no joint {n}")
        return &self._plant.joints[n]

    def make_joint(self, int n, *, uintptr_t q, uintptr_t v, uintptr_t force, uintptr_t friction,
                   double ratio, double zero, double dry, double brake, int64_t brake_delay_ns):
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

    def hang(self, int n, int position, int axis):
        """Connect the motor of an axis to joint n, and copy the state of the joint to the motor.

        Args:
            n: Number of the joint.
            position: Position of the device.
            axis: Axis number.

        Raises:
            IndexError: The joint, the device or the axis does not exist.
        """
        cdef plant_joint *j = self._joint(n)
        lock(self._core._segment)
        try:
            plant_hang(j, self._core._axis(position, axis))
        finally:
            unlock(self._core._segment)

    def begin(self):
        """Start to step the plant. Call this after `make_joint` for all joints."""
        lock(self._core._segment)
        self._plant.due = self._core._segment.now + self._plant.period
        self._core._segment.plant = self._plant
        if self._plant.due < self._core._segment.next_due:
            self._core._segment.next_due = self._plant.due
        unlock(self._core._segment)

    def run(self):
        """Run the plant and the due work of the segment in real time.

        The method returns after `end` was called, or after a step has failed.
        """
        cdef cat_segment *s = self._core._segment
        cdef plant *p = self._plant
        cdef int64_t now, due
        with nogil:
            lock(s)
            now = monotonic_now()
            if p.due < now:
                p.due = now
            while not p.ending and not p.wild and not p.words[0]:
                now = monotonic_now()
                segment_work(s, now, 1)
                due = p.due
                unlock(s)
                _sleep(due if due < now + LONGEST_SLEEP else now + LONGEST_SLEEP)
                lock(s)
            p.ending = 0
            unlock(s)

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
    def complaint(self) -> str:
        """Warning or error message of MuJoCo that stopped the plant; empty: none."""
        return (<bytes>self._plant.words).decode("utf-8", "replace")
