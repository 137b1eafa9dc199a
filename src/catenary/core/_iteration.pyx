# cython: boundscheck=False, wraparound=False, cdivision=True
"""Iteration of a loop. It is compiled to avoid cache misses, which dominate the first microseconds
after a wait. A Python generator with properties would cause many of them.
"""

from libc.stdint cimport int64_t, uint32_t, uint64_t

from catenary.core._handover cimport DRY, LATE, LIMITED_SOME, OK, REFUSED_SOME, UNCOMMITTED
from catenary.core._engine cimport Engine


cdef class Cycle:
    """The cycle of the current actual values.

    It is the same object in every iteration: copy what you want to keep.
    """

    def __init__(self, Engine engine not None):
        self.engine = engine
        self.header = engine.actual_header()
        self.first_number = self.header.number
        self.first_ns = self.header.time_ns
        engine.begin_iteration()

    @property
    def number(self):
        """Number of the cycle; 0 for the first cycle of the iteration.

        Skipped cycle starts leave gaps in `time` only.
        """
        return self.header.number - self.first_number

    @property
    def time(self):
        """Cycle start relative to the first cycle of the iteration, on the link's clock [s].

        It is a multiple of the period, unless the cycle starts follow the reference clock. Then it
        is the elapsed time.
        """
        return <double>(self.header.time_ns - self.first_ns) * 1e-9

    @property
    def ok(self):
        """True if every required sync unit answered, so that the inputs are of this cycle."""
        return (self.header.flags & OK) != 0

    @property
    def lost(self):
        """Number of cycles in a row, up to this one, that were not ok."""
        return self.header.lost_in_row

    @property
    def late(self):
        """True if cycles were skipped, or ran without new targets, since the previous iteration."""
        return (self.header.flags & (LATE | UNCOMMITTED)) != 0

    @property
    def limited(self):
        """True if a set-point (see `Drives.limited`) or an output column was limited."""
        return (self.header.flags & LIMITED_SOME) != 0

    @property
    def refused(self):
        """True if a target or column was refused: NaN, infinite, or beyond the step limit."""
        return (self.header.flags & REFUSED_SOME) != 0

    @property
    def dry(self):
        """True if the stream of set-points was empty (an underrun)."""
        return (self.header.flags & DRY) != 0

    @property
    def networks(self):
        """Cycle of each network of the loop; with one network, only this cycle."""
        return (self,)

    def spend(self, double seconds):
        """Let virtual time pass as if the body took this long [s]. In real time, busy-wait."""
        self.engine.spend(round(seconds * 1e9))

    def __repr__(self):
        return f"{type(self).__name__}(number={self.number}, time={self.time:.6f}, ok={self.ok})"


cdef class Iteration:
    def __init__(self, Engine engine not None, judge, *, uint32_t trouble, int al_status,
                 beside=None, movers=None):
        self.engine = engine
        self.judge = judge
        self.trouble = trouble
        self.al_status = al_status
        self.beside = beside
        self.movers = [] if movers is None else movers

    def __iter__(self):
        return self

    def __next__(self):
        cdef uint32_t flags
        if self.beside is not None:
            self.beside()
        if self.cycle is None:
            # The first cycle commits no set-points: the body has not run yet.
            flags = self.engine.run(1)
            self.cycle = Cycle(self.engine)
        else:
            if self.commit_lock is None:
                self.step_movers()
            else:
                self.commit_if_free()
            flags = self.engine.step()
        if flags & self.trouble or self.cycle.header.al_status != self.al_status:
            self.judge(flags)
        return self.cycle

    cdef int commit_if_free(self) except -1:
        """Step the movers and commit, unless another thread is writing the targets; never wait."""
        if not self.commit_lock.acquire(False):
            self.engine.keep_targets()
            return 0
        try:
            self.step_movers()
            self.engine.commit_targets()
        finally:
            self.commit_lock.release()
        return 0

    cpdef int step_movers(self) except -1:
        cdef double now
        if not self.movers:
            return 0
        now = self.cycle.time
        for mover in list(self.movers):  # a mover that has finished leaves the list
            mover.step(now)
        return 0
