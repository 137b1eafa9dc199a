# cython: boundscheck=False, wraparound=False, cdivision=True
"""Timers of tasks on the machine's clock and on a virtual clock. Waits release the GIL."""

from cpython.buffer cimport PyBUF_CONTIG, PyBuffer_Release, PyObject_GetBuffer
from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport PyCapsule_New
from libc.errno cimport EINTR
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t

cdef extern from "machine_time.h":
    ctypedef struct machine_time:
        pass
    int64_t machine_now(void *) noexcept nogil
    int machine_wait_until(void *, int64_t) noexcept nogil
    int machine_spend(void *, int64_t) noexcept nogil
    void machine_wake(void *) noexcept nogil

cdef extern from "virtual_time.h":
    enum:
        VT_PARTICIPANTS, VT_OWN_PROCESSOR
        VT_FREE, VT_RUNNING, VT_ASIDE
    ctypedef struct virtual_time:
        int64_t now
    int vt_init(virtual_time *) nogil
    int vt_join(virtual_time *, int32_t priority, int32_t cpu) nogil
    void vt_expect(virtual_time *, int slot) nogil
    void vt_change(virtual_time *, int slot, uint32_t state) nogil
    int vt_wait_until(virtual_time *, int slot, int64_t deadline) nogil
    int vt_spend(virtual_time *, int slot, int64_t duration) nogil
    void vt_wake(virtual_time *, int slot) nogil

FOREVER = CAT_CLOCK_FOREVER
OWN_PROCESSOR = VT_OWN_PROCESSOR
PARTICIPANTS = VT_PARTICIPANTS
MACHINE_TIMER_SIZE = sizeof(machine_time)
VIRTUAL_TIME_SIZE = sizeof(virtual_time)

cdef enum:
    SPENT_AT_ONCE_NS = 10_000_000        # interval of the checks for Python signals


cdef class Memory:
    def __cinit__(self, buffer):
        PyObject_GetBuffer(buffer, &self.view, PyBUF_CONTIG)

    def __dealloc__(self):
        PyBuffer_Release(&self.view)

    cdef uint8_t *at(self, size_t offset, size_t size) except NULL:
        if offset + size > <size_t>self.view.len:
            raise ValueError(
                f"{size} bytes at offset {offset} exceed the buffer of {self.view.len} bytes"
            )
        return <uint8_t *>self.view.buf + offset


cdef class Timer:
    @property
    def now_ns(self):
        return self.table.now(self.table.self)

    @property
    def is_virtual(self):
        return bool(self.table.flags & CAT_CLOCK_VIRTUAL)

    def wait_until(self, int64_t deadline_ns):
        cdef int result
        while True:
            with nogil:
                result = self.table.wait_until(self.table.self, deadline_ns)
            if result >= 0:
                return result == 0
            PyErr_CheckSignals()

    def spend(self, int64_t duration_ns):
        if duration_ns < 0:
            raise ValueError(f"a duration of {duration_ns} ns is negative")
        self.spend_some(duration_ns)

    cdef int spend_some(self, int64_t duration) except -1:
        cdef int64_t at_once = duration
        cdef int error
        if not self.table.flags & CAT_CLOCK_VIRTUAL:
            at_once = SPENT_AT_ONCE_NS
        while duration > 0:
            with nogil:
                error = self.table.spend(self.table.self, min(duration, at_once))
            PyErr_CheckSignals()
            if error != -EINTR:
                duration -= at_once
        return 0

    def wake(self):
        with nogil:
            self.table.wake(self.table.self)

    cdef fill(self, void *owner, uint32_t flags):
        self.table.version = CAT_CLOCK_VERSION
        self.table.flags = flags
        self.table.self = owner
        self.capsule = PyCapsule_New(&self.table, CAT_CLOCK_CAPSULE, NULL)


cdef class MachineTimer(Timer):
    """Timer on CLOCK_MONOTONIC. All threads that wake it share its memory, which starts as zeros."""

    def __init__(self, memory, size_t offset=0):
        self.memory = Memory(memory)
        self.fill(self.memory.at(offset, sizeof(machine_time)), 0)
        self.table.now = machine_now
        self.table.wait_until = machine_wait_until
        self.table.spend = machine_spend
        self.table.wake = machine_wake


cdef class VirtualTime:
    """Table of the participants of a virtual clock, in shared memory."""
    cdef Memory memory
    cdef virtual_time *time

    def __init__(self, memory):
        self.memory = Memory(memory)
        self.time = <virtual_time *>self.memory.at(0, sizeof(virtual_time))

    def reset(self):
        cdef int error = vt_init(self.time)
        if error:
            raise OSError(error, "cannot initialise the process-shared mutex of the virtual clock")

    @property
    def now_ns(self):
        return self.time.now

    def join(self, int priority, int cpu):
        cdef int slot = vt_join(self.time, priority, cpu)
        if slot < 0:
            raise ValueError(f"all {VT_PARTICIPANTS} slots of the virtual clock are in use")
        return slot

    def expect(self, int slot):
        vt_expect(self.time, self.checked(slot))

    def run(self, int slot):
        vt_change(self.time, self.checked(slot), VT_RUNNING)

    def step_aside(self, int slot):
        vt_change(self.time, self.checked(slot), VT_ASIDE)

    def remove(self, int slot):
        vt_change(self.time, self.checked(slot), VT_FREE)

    cdef int checked(self, int slot) except -1:
        if not 0 <= slot < VT_PARTICIPANTS:
            raise ValueError(f"slot {slot} is not within 0..{VT_PARTICIPANTS - 1}")
        return slot


cdef struct participant_t:
    virtual_time *time
    int slot


cdef int64_t virtual_now(void *owner) noexcept nogil:
    return (<participant_t *>owner).time.now


cdef int virtual_wait_until(void *owner, int64_t deadline) noexcept nogil:
    cdef participant_t *p = <participant_t *>owner
    return vt_wait_until(p.time, p.slot, deadline)


cdef int virtual_spend(void *owner, int64_t duration) noexcept nogil:
    cdef participant_t *p = <participant_t *>owner
    return vt_spend(p.time, p.slot, duration)


cdef void virtual_wake(void *owner) noexcept nogil:
    cdef participant_t *p = <participant_t *>owner
    vt_wake(p.time, p.slot)


cdef class VirtualTimer(Timer):
    cdef participant_t participant
    cdef readonly int slot

    def __init__(self, VirtualTime time not None, int slot):
        self.memory = time.memory
        self.slot = slot
        self.participant.time = time.time
        self.participant.slot = time.checked(slot)
        self.fill(&self.participant, CAT_CLOCK_VIRTUAL)
        self.table.now = virtual_now
        self.table.wait_until = virtual_wait_until
        self.table.spend = virtual_spend
        self.table.wake = virtual_wake
