"""Compiled side of a plant: arrays and step function of a MuJoCo model, by address (plant.h)."""

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
    LONGEST_SLEEP = 20000000             # maximum time until its thread ends [ns]


cdef void _sleep(int64_t until) noexcept nogil:
    cdef timespec t
    t.tv_sec, t.tv_nsec = until // 1000000000, until % 1000000000
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL)


cdef class CompiledPlant:
    """View of the plant of `core`, which owns it."""

    cdef Core _core
    cdef plant *_plant

    def __init__(self, Core core, int joints, *, uintptr_t step, uintptr_t set_handler, uintptr_t model,
                 uintptr_t data, int64_t period_ns, keep):
        """Connect a plant to the segment.

        `step`, `set_handler`, `model`, `data`: addresses of mj_step, of the function that sets a thread's
        message handler (0: none), of an mjModel and of an mjData. `keep` owns them.
        """
        cdef plant *p
        if core._segment.plant != NULL:
            raise ValueError("the segment has a plant already")
        if not (0 < joints <= 4096 and period_ns >= 1000 and step and model and data):
            raise ValueError("impossible plant")
        p = <plant *>calloc(1, sizeof(plant))
        self._core, self._plant = core, p
        if p != NULL:
            p.joints = <plant_joint *>calloc(joints, sizeof(plant_joint))
        if p == NULL or p.joints == NULL:
            raise MemoryError("no memory for the plant")
        p.step = <void (*)(const void *, void *) noexcept nogil>step
        p.set_handler = <void (*)(void (*)(const mujoco_message *) noexcept nogil) noexcept nogil>set_handler
        p.model, p.data = <const void *>model, <void *>data
        p.count, p.period = joints, period_ns
        core._plant = keep

    def __dealloc__(self):
        if self._core is not None and self._core._segment.plant != self._plant:
            plant_free(self._plant)          # the plant was never started

    cdef plant_joint *_joint(self, int n) except NULL:
        if not 0 <= n < self._plant.count:
            raise IndexError(f"the plant has no joint {n}")
        return &self._plant.joints[n]

    def make_joint(self, int n, *, uintptr_t q, uintptr_t v, uintptr_t force, uintptr_t friction,
                   double ratio, double zero, double dry, double brake, int64_t brake_delay_ns):
        """`q` to `friction`: addresses of its values in qpos, qvel, qfrc_applied,
        dof_frictionloss."""
        cdef plant_joint *j = self._joint(n)
        if not (q and v and force and friction and ratio):
            raise ValueError(f"impossible joint {n}")
        j.q, j.v, j.force, j.friction = <double *>q, <double *>v, <double *>force, <double *>friction
        j.ratio, j.zero, j.dry, j.brake = ratio, zero, dry, brake
        j.brake_delay = brake_delay_ns

    def hang(self, int n, int position, int axis):
        """Connect the motor of this axis to joint n."""
        cdef plant_joint *j = self._joint(n)
        lock(self._core._segment)
        try:
            plant_hang(j, self._core._axis(position, axis))
        finally:
            unlock(self._core._segment)

    def begin(self):
        """Start stepping; all joints are made."""
        lock(self._core._segment)
        self._plant.due = self._core._segment.now + self._plant.period
        self._core._segment.plant = self._plant
        if self._plant.due < self._core._segment.next_due:
            self._core._segment.next_due = self._plant.due
        unlock(self._core._segment)

    def run(self):
        """Step the plant and do due work in real time, until `end` or a failed step."""
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
        """Joint that exceeded all bounds, -1: none. If any, the plant has stopped."""
        return self._plant.wild - 1

    @property
    def complaint(self) -> str:
        """Error message of MuJoCo. If any, the plant has stopped."""
        return (<bytes>self._plant.words).decode("utf-8", "replace")
