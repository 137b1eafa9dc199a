# cython: boundscheck=False, wraparound=False, cdivision=True
"""The hand-over between the cycle and Python: private buffers that Python sees, and triple buffers
(native/triple_buffer.h) both ways, so that a vector is never half old and half new.

One block of memory per direction and slot, 8-byte values first. Budget: 0.1 us a direction for
three drives, which is the copying of some 200 bytes.
"""

from cpython.buffer cimport PyBUF_FORMAT, PyBUF_WRITABLE
from libc.stdint cimport int8_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free
from libc.string cimport memcpy, memset

from catenary.core._native cimport (
    aligned_alloc,
    cat_add32,
    cat_fence,
    cat_futex_wake,
    cat_load_acquire32,
    cat_triple_init,
    cat_triple_publish,
    cat_triple_take,
)

cdef enum:
    CACHE_LINE = 64
    COUNT_MAX = 1 << 16


cdef uint8_t *carve(uint8_t **place, size_t count, size_t size) noexcept:
    """The next array of the block."""
    cdef uint8_t *start = place[0]
    place[0] = start + count * size
    return start


cdef size_t lay_actual(actual_t *a, uint8_t *block, const counts_t *n) noexcept:
    """Points the arrays of `a` into the block; its size."""
    cdef uint8_t *place = block
    a.header = <actual_header_t *>carve(&place, 1, sizeof(actual_header_t))
    a.position = <double *>carve(&place, n.axes, 8)
    a.velocity = <double *>carve(&place, n.axes, 8)
    a.torque = <double *>carve(&place, n.axes, 8)
    a.commanded_position = <double *>carve(&place, n.axes, 8)
    a.commanded_velocity = <double *>carve(&place, n.axes, 8)
    a.commanded_torque = <double *>carve(&place, n.axes, 8)
    a.input_reals = <double *>carve(&place, n.input_reals, 8)
    a.input_integers = <int64_t *>carve(&place, n.input_integers, 8)
    a.followed_since = <uint64_t *>carve(&place, n.axes, 8)
    a.stop_cycle = <uint64_t *>carve(&place, n.axes, 8)
    a.statusword = <uint16_t *>carve(&place, n.axes, 2)
    a.controlword = <uint16_t *>carve(&place, n.axes, 2)
    a.unit_counter = <uint16_t *>carve(&place, n.units, 2)
    a.mode = <int8_t *>carve(&place, n.axes, 1)
    a.state = carve(&place, n.axes, 1)
    a.flags = carve(&place, n.axes, 1)
    a.stop_reason = carve(&place, n.axes, 1)
    a.enabled = carve(&place, n.axes, 1)
    a.input_bits = carve(&place, n.input_bits, 1)
    a.unit_valid = carve(&place, n.units, 1)
    return place - block


cdef size_t lay_target(target_t *t, uint8_t *block, const counts_t *n) noexcept:
    """Points the arrays of `t` into the block; its size."""
    cdef uint8_t *place = block
    t.header = <target_header_t *>carve(&place, 1, sizeof(target_header_t))
    t.position = <double *>carve(&place, n.axes, 8)
    t.velocity = <double *>carve(&place, n.axes, 8)
    t.torque = <double *>carve(&place, n.axes, 8)
    t.output_reals = <double *>carve(&place, n.output_reals, 8)
    t.output_integers = <int64_t *>carve(&place, n.output_integers, 8)
    t.request = <uint32_t *>carve(&place, n.axes, 4)
    t.controlword_bits = <uint16_t *>carve(&place, n.axes, 2)
    t.mode = <int8_t *>carve(&place, n.axes, 1)
    t.goal = carve(&place, n.axes, 1)
    t.output_bits = carve(&place, n.output_bits, 1)
    return place - block


cdef void handover_commit(handover_t *h) noexcept nogil:
    """Python's side: what it wrote is what counts from the next instant on."""
    memcpy(h.target[h.target_triple.back].header, h.target[PRIVATE].header, h.target_size)
    cat_triple_publish(&h.target_triple)


cdef target_t *handover_latch(handover_t *h, bint *fresh) noexcept nogil:
    """The cycle's side: the newest committed targets, `fresh` when not seen before."""
    fresh[0] = cat_triple_take(&h.target_triple) != 0
    return &h.target[h.target_triple.front]


cdef void handover_publish(handover_t *h) noexcept nogil:
    """The cycle's side: offers the actual values in the back slot."""
    cat_triple_publish(&h.actual_triple)
    cat_add32(&h.published, 1)


cdef void handover_wake(handover_t *h) noexcept nogil:
    """Wakes Python where it sleeps; a system call, only then."""
    cat_fence()  # published before waiting is read: else a sleeper may be missed
    if cat_load_acquire32(&h.waiting):
        cat_futex_wake(&h.published)


cdef bint handover_swap(handover_t *h) noexcept nogil:
    """Python's side: copies the newest actual values to its own; whether there were any."""
    if not cat_triple_take(&h.actual_triple):
        return False
    memcpy(h.actual[PRIVATE].header, h.actual[h.actual_triple.front].header, h.actual_size)
    return True


cdef class Field:
    """One array of a private buffer; keeps its owner alive."""
    cdef object owner
    cdef void *start
    cdef Py_ssize_t count
    cdef Py_ssize_t itemsize
    cdef bytes format
    cdef bint writable

    def __getbuffer__(self, Py_buffer *buffer, int flags):
        if flags & PyBUF_WRITABLE and not self.writable:
            raise BufferError("actual values are read-only")
        buffer.buf = self.start
        buffer.obj = self
        buffer.len = self.count * self.itemsize
        buffer.itemsize = self.itemsize
        buffer.format = <char *>self.format if flags & PyBUF_FORMAT else NULL
        buffer.ndim = 1
        buffer.shape = &self.count
        buffer.strides = &self.itemsize
        buffer.suboffsets = NULL
        buffer.readonly = not self.writable
        buffer.internal = NULL


cdef class Handover:
    def __cinit__(self, axes, units, input_counts, output_counts):
        """Counts: of axes, sync units, and columns by bank (real, integer, bit)."""
        counts = [axes, units, *input_counts, *output_counts]
        if not all(0 <= count <= COUNT_MAX for count in counts):
            raise ValueError(f"more than {COUNT_MAX} axes, sync units or columns: {counts}")
        self.c.counts = counts_t(
            axes=axes,
            units=units,
            input_reals=input_counts[0],
            input_integers=input_counts[1],
            input_bits=input_counts[2],
            output_reals=output_counts[0],
            output_integers=output_counts[1],
            output_bits=output_counts[2],
        )
        self.c.actual_size = lay_actual(&self.c.actual[0], NULL, &self.c.counts)
        self.c.target_size = lay_target(&self.c.target[0], NULL, &self.c.counts)
        self.allocate()
        cat_triple_init(&self.c.actual_triple)
        cat_triple_init(&self.c.target_triple)

    cdef allocate(self):
        cdef size_t actual = (self.c.actual_size // CACHE_LINE + 1) * CACHE_LINE
        cdef size_t target = (self.c.target_size // CACHE_LINE + 1) * CACHE_LINE
        cdef size_t size = 4 * actual + TARGETS * target
        cdef int k
        self.memory = <uint8_t *>aligned_alloc(CACHE_LINE, size)
        if self.memory == NULL:
            raise MemoryError
        memset(self.memory, 0, size)
        for k in range(4):
            lay_actual(&self.c.actual[k], self.memory + k * actual, &self.c.counts)
            self.c.actual[k].header.axis_count = self.c.counts.axes
        for k in range(TARGETS):
            lay_target(&self.c.target[k], self.memory + 4 * actual + k * target, &self.c.counts)
            self.c.target[k].header.hold = 1  # nothing was committed yet

    def fields(self):
        """Python's own arrays by the names of plan.wish.Views, as memoryviews."""
        cdef actual_t *a = &self.c.actual[PRIVATE]
        cdef target_t *t = &self.c.target[PRIVATE]
        cdef counts_t *n = &self.c.counts
        return {
            "actual_position": self.field(a.position, n.axes, 8, b"d", False),
            "actual_velocity": self.field(a.velocity, n.axes, 8, b"d", False),
            "actual_torque": self.field(a.torque, n.axes, 8, b"d", False),
            "statusword": self.field(a.statusword, n.axes, 2, b"H", False),
            "mode_actual": self.field(a.mode, n.axes, 1, b"b", False),
            "axis_state": self.field(a.state, n.axes, 1, b"B", False),
            "axis_flags": self.field(a.flags, n.axes, 1, b"B", False),
            "stop_reason": self.field(a.stop_reason, n.axes, 1, b"B", False),
            "stop_cycle": self.field(a.stop_cycle, n.axes, 8, b"Q", False),
            "input_reals": self.field(a.input_reals, n.input_reals, 8, b"d", False),
            "input_integers": self.field(a.input_integers, n.input_integers, 8, b"q", False),
            "input_bits": self.field(a.input_bits, n.input_bits, 1, b"B", False),
            "unit_valid": self.field(a.unit_valid, n.units, 1, b"B", False),
            "unit_counter": self.field(a.unit_counter, n.units, 2, b"H", False),
            "target_position": self.field(t.position, n.axes, 8, b"d", True),
            "target_velocity": self.field(t.velocity, n.axes, 8, b"d", True),
            "target_torque": self.field(t.torque, n.axes, 8, b"d", True),
            "mode_target": self.field(t.mode, n.axes, 1, b"b", True),
            "goal": self.field(t.goal, n.axes, 1, b"B", True),
            "request": self.field(t.request, n.axes, 4, b"I", True),
            "controlword_bits": self.field(t.controlword_bits, n.axes, 2, b"H", True),
            "output_reals": self.field(t.output_reals, n.output_reals, 8, b"d", True),
            "output_integers": self.field(t.output_integers, n.output_integers, 8, b"q", True),
            "output_bits": self.field(t.output_bits, n.output_bits, 1, b"B", True),
        }

    def law_fields(self):
        """The blocks a law works on, (actual, target): name → (offset, NumPy format, count; None for
        a single number)."""
        cdef actual_t *a = &self.c.actual[PRIVATE]
        cdef target_t *t = &self.c.target[PRIVATE]
        cdef counts_t *n = &self.c.counts
        cdef char *of_actual = <char *>a.header
        cdef char *of_target = <char *>t.header
        actual = {
            "n": (<char *>&a.header.axis_count - of_actual, "<u4", None),
            "ok": (<char *>&a.header.ok - of_actual, "?", None),
            "dt": (<char *>&a.header.period - of_actual, "<f8", None),
            "position": (<char *>a.position - of_actual, "<f8", n.axes),
            "velocity": (<char *>a.velocity - of_actual, "<f8", n.axes),
            "torque": (<char *>a.torque - of_actual, "<f8", n.axes),
            "enabled": (<char *>a.enabled - of_actual, "u1", n.axes),
            "reals": (<char *>a.input_reals - of_actual, "<f8", n.input_reals),
            "integers": (<char *>a.input_integers - of_actual, "<i8", n.input_integers),
            "bits": (<char *>a.input_bits - of_actual, "u1", n.input_bits),
        }
        target = {
            "position": (<char *>t.position - of_target, "<f8", n.axes),
            "velocity": (<char *>t.velocity - of_target, "<f8", n.axes),
            "torque": (<char *>t.torque - of_target, "<f8", n.axes),
            "reals": (<char *>t.output_reals - of_target, "<f8", n.output_reals),
            "integers": (<char *>t.output_integers - of_target, "<i8", n.output_integers),
            "bits": (<char *>t.output_bits - of_target, "u1", n.output_bits),
        }
        return actual, target

    def sink_fields(self):
        """The blocks a sink is given, (actual, target): name → (offset, NumPy format, count; None
        for a single number)."""
        cdef actual_t *a = &self.c.actual[PRIVATE]
        cdef target_t *t = &self.c.target[PRIVATE]
        cdef counts_t *n = &self.c.counts
        cdef char *of_actual = <char *>a.header
        cdef char *of_target = <char *>t.header
        actual = {
            "time_ns": (<char *>&a.header.time_ns - of_actual, "<i8", None),
            "moving": (<char *>&a.header.moving - of_actual, "<u4", None),
            "position": (<char *>a.position - of_actual, "<f8", n.axes),
            "velocity": (<char *>a.velocity - of_actual, "<f8", n.axes),
            "torque": (<char *>a.torque - of_actual, "<f8", n.axes),
            "commanded_position": (<char *>a.commanded_position - of_actual, "<f8", n.axes),
            "commanded_velocity": (<char *>a.commanded_velocity - of_actual, "<f8", n.axes),
            "commanded_torque": (<char *>a.commanded_torque - of_actual, "<f8", n.axes),
            "statusword": (<char *>a.statusword - of_actual, "<u2", n.axes),
            "controlword": (<char *>a.controlword - of_actual, "<u2", n.axes),
            "mode": (<char *>a.mode - of_actual, "i1", n.axes),
            "state": (<char *>a.state - of_actual, "u1", n.axes),
            "axis_flags": (<char *>a.flags - of_actual, "u1", n.axes),
            "enabled": (<char *>a.enabled - of_actual, "u1", n.axes),
            "unit_valid": (<char *>a.unit_valid - of_actual, "u1", n.units),
            "reals": (<char *>a.input_reals - of_actual, "<f8", n.input_reals),
            "integers": (<char *>a.input_integers - of_actual, "<i8", n.input_integers),
            "bits": (<char *>a.input_bits - of_actual, "u1", n.input_bits),
        }
        target = {
            "target_position": (<char *>t.position - of_target, "<f8", n.axes),
            "target_velocity": (<char *>t.velocity - of_target, "<f8", n.axes),
            "target_torque": (<char *>t.torque - of_target, "<f8", n.axes),
            "target_mode": (<char *>t.mode - of_target, "i1", n.axes),
            "goal": (<char *>t.goal - of_target, "u1", n.axes),
            "reals": (<char *>t.output_reals - of_target, "<f8", n.output_reals),
            "integers": (<char *>t.output_integers - of_target, "<i8", n.output_integers),
            "bits": (<char *>t.output_bits - of_target, "u1", n.output_bits),
        }
        return actual, target

    def blocks(self):
        """Python's own blocks whole, (actual, target), as bytes."""
        cdef actual_t *a = &self.c.actual[PRIVATE]
        cdef target_t *t = &self.c.target[PRIVATE]
        return (
            self.field(a.header, self.c.actual_size, 1, b"B", False),
            self.field(t.header, self.c.target_size, 1, b"B", True),
        )

    cdef field(self, void *start, uint32_t count, size_t itemsize, bytes format, bint writable):
        cdef Field field = Field()
        field.owner = self
        field.start = start
        field.count = count
        field.itemsize = itemsize
        field.format = format
        field.writable = writable
        return memoryview(field)

    def __dealloc__(self):
        free(self.memory)
