# cython: boundscheck=False, wraparound=False, cdivision=True
"""The image table over libethercat (exchange.h), and a link that provides only a clock."""

from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport (
    PyCapsule_GetContext, PyCapsule_New, PyCapsule_SetContext,
)
from cpython.ref cimport Py_DECREF, Py_INCREF
from libc.errno cimport EINTR
from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t, uint64_t, uintptr_t

import os

from catenary.errors import LinkError

cdef extern from "image.h" nogil:
    const char *CAT_IMAGE_CAPSULE
    ctypedef struct cat_image:
        uint32_t unit_count

cdef extern from "link.h" nogil:
    const char *CAT_LINK_CAPSULE

cdef extern from "exchange.h" nogil:
    int IGH_NO_CLOCK, IGH_FOLLOW_REFERENCE, IGH_FOLLOW_MAIN

    ctypedef struct cat_link:
        pass

    ctypedef struct igh_time:
        cat_link link
        int64_t offset

    ctypedef struct igh_copy:
        uint32_t domain_offset
        uint32_t image_offset
        uint32_t size

    ctypedef struct igh_unit:
        void *domain
        uint8_t *data
        uint32_t first_output
        uint32_t output_count
        uint32_t first_input
        uint32_t input_count
        uint32_t divider
        uint32_t phase
        uint8_t optional

    ctypedef struct igh_exchange:
        cat_image image
        igh_time *time
        void *master
        igh_unit *units
        igh_copy *copies
        uint8_t link_up
        uint8_t redundancy
        int clock
        int64_t period
        int64_t epoch
        double rate
        double rate_limit
        double bandwidth
        int64_t phase_error
        uint64_t clock_reads
        uint64_t clock_misses
        uint64_t send_errors
        uint64_t receive_errors
        int64_t sent
        int64_t ahead
        int64_t bound
        double mean_error
        double mean_spread
        int64_t worst_error
        int64_t spread
        int64_t worst_spread
        uint64_t silent
        uint64_t unheard
        uint64_t jumps
        uint64_t changes
        uint8_t locked

    int64_t igh_now(void *self)
    int igh_wait_until(void *self, int64_t deadline, int wake_on_frame)
    void igh_time_open(igh_time *t, int is_virtual)
    void igh_exchange_end(igh_exchange *x)
    void igh_exchange_close(igh_exchange *x)
    int igh_exchange_open(igh_exchange *x, uint32_t units, uint32_t copies, uint32_t output_size,
                          uint32_t input_size, uint32_t padding)
    int igh_emit(void *self)
    int igh_collect(void *self, int64_t deadline)

cdef extern from *:
    """
    static void igh_calls_set(igh_calls *c, int returns, void *const *at)
    {
        c->returns = returns;
        c->receive.says = (int (*)(void *))at[0];
        c->send.says = (int (*)(void *))at[1];
        c->process.says = (int (*)(void *))at[2];
        c->queue.says = (int (*)(void *))at[3];
        c->sync_reference_clock.says = (int (*)(void *))at[4];
        c->sync_slave_clocks.says = (int (*)(void *))at[5];
        c->application_time.says = (int (*)(void *, uint64_t))at[6];
        c->sync_reference_clock_to.says = (int (*)(void *, uint64_t))at[7];
        c->domain_state.says = (int (*)(void *, void *))at[8];
        c->master_state.says = (int (*)(void *, void *))at[9];
        c->reference_clock_time = (int (*)(void *, uint32_t *))at[10];
        c->monitor_queue.says = (int (*)(void *))at[11];
        c->monitor_process = (uint32_t (*)(void *))at[12];
    }
    static void igh_exchange_calls(igh_exchange *x, int returns, void *const *at)
    {
        igh_calls_set(&x->calls, returns, at);
    }
    """
    void igh_exchange_calls(igh_exchange *x, int returns, void *const *at) nogil

CALLS = (
    "ecrt_master_receive", "ecrt_master_send", "ecrt_domain_process", "ecrt_domain_queue",
    "ecrt_master_sync_reference_clock", "ecrt_master_sync_slave_clocks",
    "ecrt_master_application_time", "ecrt_master_sync_reference_clock_to", "ecrt_domain_state",
    "ecrt_master_state", "ecrt_master_reference_clock_time",
    "ecrt_master_sync_monitor_queue", "ecrt_master_sync_monitor_process",
)
CLOCKS = {None: IGH_NO_CLOCK, "reference": IGH_FOLLOW_REFERENCE, "main": IGH_FOLLOW_MAIN}
cdef enum:
    CALL_COUNT = 13
    PADDING = 16               # bytes after an image, as in core


cdef void release_owner(object capsule) noexcept:
    cdef void *owner = PyCapsule_GetContext(capsule)
    if owner != NULL:
        Py_DECREF(<object>owner)


cdef object capsule_of(object owner, void *table, const char *name):
    capsule = PyCapsule_New(table, name, release_owner)
    Py_INCREF(owner)
    PyCapsule_SetContext(capsule, <void *>owner)
    return capsule


cdef class KernelTime:
    cdef igh_time c
    cdef readonly bint is_virtual

    def __cinit__(self, bint virtual_time=False):
        self.is_virtual = virtual_time
        igh_time_open(&self.c, virtual_time)

    @property
    def capsule(self):
        return capsule_of(self, &self.c.link, CAT_LINK_CAPSULE)

    def send(self, bytes frame not None):
        raise LinkError(
            "the IgH master sends only its own frames",
            hint="to send frames yourself, use the network interface: MainDevice('eth0')",
        )

    def receive(self):
        return None

    def now(self):
        return igh_now(&self.c)

    def wait_until(self, int64_t deadline_ns, bint wake_on_frame):
        cdef int rc
        with nogil:
            rc = igh_wait_until(&self.c, deadline_ns, wake_on_frame)
        if rc == -EINTR:
            PyErr_CheckSignals()
        elif rc < 0:
            raise OSError(-rc, os.strerror(-rc))
        return False


cdef class Exchange:
    cdef igh_exchange c
    cdef KernelTime time
    cdef object library        # keeps the loaded library alive

    def __cinit__(self, KernelTime time not None, library, uintptr_t master, units,
                  uint32_t output_size, uint32_t input_size):
        cdef void *at[CALL_COUNT]
        cdef uintptr_t address
        cdef uint32_t copies = 0
        count = sum(len(unit.outputs) + len(unit.inputs) for unit in units)
        if igh_exchange_open(&self.c, len(units), count, output_size, input_size, PADDING) < 0:
            raise MemoryError
        self.time = time
        self.library = library
        self.c.time = &time.c
        self.c.master = <void *>master
        for k, name in enumerate(CALLS):
            address = library.addresses.get(name, 0)
            at[k] = <void *>address
        igh_exchange_calls(&self.c, library.returns, at)
        for k, unit in enumerate(units):
            copies = self.make_unit(k, unit, copies, output_size, input_size)

    def make_unit(self, uint32_t k, plan, uint32_t copies, output_size, input_size):
        cdef igh_unit *unit = &self.c.units[k]
        cdef uintptr_t address = plan.domain
        unit.domain = <void *>address
        address = plan.data
        unit.data = <uint8_t *>address
        unit.divider = plan.divider
        unit.phase = plan.phase
        unit.optional = plan.optional
        unit.first_output = copies
        unit.output_count = len(plan.outputs)
        for copy in plan.outputs:
            copies = self.make_copy(plan, copy, output_size, copies)
        unit.first_input = copies
        unit.input_count = len(plan.inputs)
        for copy in plan.inputs:
            copies = self.make_copy(plan, copy, input_size, copies)
        return copies

    def make_copy(self, plan, copy, image_size, uint32_t place):
        domain_offset, image_offset, size = copy
        if domain_offset < 0 or size <= 0 or domain_offset + size > plan.size:
            raise ValueError(
                f"{size} bytes at {domain_offset} exceed a domain of {plan.size} bytes"
            )
        if image_offset < 0 or image_offset + size > image_size:
            raise ValueError(
                f"{size} bytes at {image_offset} exceed an image of {image_size} bytes"
            )
        self.c.copies[place].domain_offset = domain_offset
        self.c.copies[place].image_offset = image_offset
        self.c.copies[place].size = size
        return place + 1

    def keep_clocks(self, follow, int64_t period_ns, int64_t epoch_ns, double bandwidth,
                    double rate_limit_ns, int64_t bound_ns):
        self.c.bound = bound_ns
        self.c.clock = CLOCKS[follow]
        self.c.period = period_ns
        self.c.epoch = epoch_ns
        self.c.bandwidth = bandwidth
        self.c.rate_limit = rate_limit_ns

    @property
    def capsule(self):
        return capsule_of(self, &self.c.image, CAT_IMAGE_CAPSULE)

    @property
    def figures(self):
        return {
            "link_up": bool(self.c.link_up),
            "redundancy": bool(self.c.redundancy),
            "send_errors": self.c.send_errors,
            "receive_errors": self.c.receive_errors,
            "phase_error_ns": self.c.phase_error,
            "clock_reads": self.c.clock_reads,
            "clock_misses": self.c.clock_misses,
            "rate_ns": self.c.rate,
            "offset_ns": self.c.time.offset,
        }

    def clock_figures(self):
        return {
            "locked": bool(self.c.locked),
            "bound": self.c.bound,
            "time": self.c.sent + self.c.epoch + self.c.ahead,
            "time_sent": self.c.sent,
            "error": self.c.phase_error,
            "mean_error": self.c.mean_error,
            "worst_error": self.c.worst_error,
            "rate": self.c.rate / max(1, self.c.period),
            "samples": self.c.clock_reads,
            "missed": self.c.clock_misses,
            "silent": self.c.silent + self.c.unheard,
            "jumps": self.c.jumps,
            "spread": self.c.mean_spread,
            "worst_spread": self.c.worst_spread,
        }

    def keep_within(self, int64_t bound_ns):
        self.c.bound = bound_ns

    def reset_clock_figures(self):
        self.c.worst_error = self.c.worst_spread = 0

    @property
    def clock_changes(self):
        return self.c.changes

    def step(self):
        """Run one collect and one emit in the calling thread, without the GIL (for benchmarks)."""
        with nogil:
            igh_collect(&self.c, 0)
            igh_emit(&self.c)

    def steps(self, uint64_t count):
        cdef uint64_t k
        with nogil:
            for k in range(count):
                igh_collect(&self.c, 0)
                igh_emit(&self.c)

    def end(self):
        igh_exchange_end(&self.c)

    def __dealloc__(self):
        igh_exchange_close(&self.c)
