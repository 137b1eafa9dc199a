# cython: boundscheck=False, wraparound=False, cdivision=True
"""Hand-over between the cycle and Python: private buffers for Python, and triple buffers
(native/triple_buffer.h) in both directions, so that values of different cycles are never mixed.

Theory of operation. There is one block of memory per direction and slot: a header, then the arrays
of one table, with items of 8 bytes first. Slots 0 to 2 are exchanged. PRIVATE is Python's own,
OF_LAW holds the targets of a law, BEFORE_LAW those before its step. `published` counts publications
and is the futex word on which Python sleeps while `waiting`. `sticky` holds the flags of cycles
that Python has not read yet.

Budget: 0.1 us per direction for three drives, to copy about 200 bytes.
"""

from cpython.buffer cimport PyBUF_FORMAT, PyBUF_WRITABLE
from libc.stdint cimport int8_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy

from catenary.core._memory cimport cat_memory_free, memory_take
from catenary.core._native cimport (
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


# Arrays of the two blocks, in the order of actual_t and target_t (_handover.pxd): name, NumPy
# format, kind of the item count, and its names for Python's views (plan.request.Views), laws and
# sinks; None: not visible there. Items of 8 bytes come first, so that each array is aligned.
ACTUAL = (
    ("position", "<f8", "axes", "actual_position", "position", "position"),
    ("velocity", "<f8", "axes", "actual_velocity", "velocity", "velocity"),
    ("torque", "<f8", "axes", "actual_torque", "torque", "torque"),
    ("commanded_position", "<f8", "axes", None, None, "commanded_position"),
    ("commanded_velocity", "<f8", "axes", None, None, "commanded_velocity"),
    ("commanded_torque", "<f8", "axes", None, None, "commanded_torque"),
    ("input_reals", "<f8", "input_reals", "input_reals", "reals", "reals"),
    ("input_integers", "<i8", "input_integers", "input_integers", "integers", "integers"),
    ("followed_since", "<u8", "axes", None, None, None),
    ("stop_cycle", "<u8", "axes", "stop_cycle", None, None),
    ("statusword", "<u2", "axes", "statusword", None, "statusword"),
    ("controlword", "<u2", "axes", None, None, "controlword"),
    ("unit_counter", "<u2", "units", "unit_counter", None, None),
    ("mode", "i1", "axes", "mode_actual", None, "mode"),
    ("state", "u1", "axes", "axis_state", None, "state"),
    ("flags", "u1", "axes", "axis_flags", None, "axis_flags"),
    ("stop_reason", "u1", "axes", "stop_reason", None, None),
    ("enabled", "u1", "axes", None, "enabled", "enabled"),
    ("jogged", "u1", "axes", "jogged", None, "jogged"),
    ("input_bits", "u1", "input_bits", "input_bits", "bits", "bits"),
    ("input_bytes", "u1", "input_bytes", "input_bytes", None, "bytes"),
    ("unit_valid", "u1", "units", "unit_valid", None, "unit_valid"),
)
TARGET = (
    ("position", "<f8", "axes", "target_position", "position", "target_position"),
    ("velocity", "<f8", "axes", "target_velocity", "velocity", "target_velocity"),
    ("torque", "<f8", "axes", "target_torque", "torque", "target_torque"),
    ("output_reals", "<f8", "output_reals", "output_reals", "reals", "reals"),
    ("output_integers", "<i8", "output_integers", "output_integers", "integers", "integers"),
    ("request", "<u4", "axes", "request", None, None),
    ("controlword_bits", "<u2", "axes", "controlword_bits", None, None),
    ("mode", "i1", "axes", "mode_target", None, "target_mode"),
    ("requested_state", "u1", "axes", "requested_state", None, "requested_state"),
    ("output_bits", "u1", "output_bits", "output_bits", "bits", "bits"),
    ("output_bytes", "u1", "output_bytes", "output_bytes", None, "bytes"),
)
CODES = {"<f8": b"d", "<i8": b"q", "<u8": b"Q", "<u4": b"I", "<u2": b"H", "i1": b"b", "u1": b"B"}
SIZES = {"<f8": 8, "<i8": 8, "<u8": 8, "<u4": 4, "<u2": 2, "i1": 1, "u1": 1}
VIEW, OF_A_LAW, OF_A_SINK = 3, 4, 5  # columns of the tables above

if sizeof(actual_t) != (len(ACTUAL) + 1) * sizeof(void *) or sizeof(target_t) != (
    len(TARGET) + 1
) * sizeof(void *):
    raise ImportError("the tables of _handover.pyx do not describe the blocks of _handover.pxd")


cdef size_t lay(void **block, uint8_t *memory, size_t header_size, tuple table, dict counts) except 0:
    """Point a block's header and arrays into its memory; return its size."""
    cdef size_t used = header_size
    cdef size_t k
    block[0] = memory
    for k in range(len(table)):
        block[k + 1] = memory + used
        used += counts[table[k][2]] * SIZES[table[k][1]]
    return used


cdef void handover_commit(handover_t *h) noexcept nogil:
    """Commit Python's targets for the next cycle start."""
    memcpy(h.target[h.target_triple.back].header, h.target[PRIVATE].header, h.target_size)
    cat_triple_publish(&h.target_triple)


cdef target_t *handover_latch(handover_t *h, bint *fresh) noexcept nogil:
    """Return the newest committed targets to the cycle; set `fresh` if they are new."""
    fresh[0] = cat_triple_take(&h.target_triple) != 0
    return &h.target[h.target_triple.front]


cdef void handover_publish(handover_t *h) noexcept nogil:
    """Publish the cycle's actual values, which are in the back slot."""
    cat_triple_publish(&h.actual_triple)
    cat_add32(&h.published, 1)


cdef void handover_wake(handover_t *h) noexcept nogil:
    """Wake Python. This is a system call only if Python sleeps."""
    cat_fence()  # publish before reading `waiting`; otherwise a sleeper may be missed
    if cat_load_acquire32(&h.waiting):
        cat_futex_wake(&h.published)


cdef bint handover_swap(handover_t *h) noexcept nogil:
    """Copy the newest actual values to Python's own; return True if they are new."""
    if not cat_triple_take(&h.actual_triple):
        return False
    memcpy(h.actual[PRIVATE].header, h.actual[h.actual_triple.front].header, h.actual_size)
    return True


cdef class Field:
    """One array of a private buffer. It keeps its owner alive."""
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
        """Counts: axes, sync units, columns by bank (real, integer, bit), and bytes of areas."""
        counts = [axes, units, *input_counts[:3], *output_counts[:3]]
        if not all(0 <= count <= COUNT_MAX for count in counts):
            raise ValueError(f"more than {COUNT_MAX} axes, sync units or columns: {counts}")
        self.c.counts = counts_t(
            axes=axes,
            units=units,
            input_reals=input_counts[0],
            input_integers=input_counts[1],
            input_bits=input_counts[2],
            input_bytes=input_counts[3],
            output_reals=output_counts[0],
            output_integers=output_counts[1],
            output_bits=output_counts[2],
            output_bytes=output_counts[3],
        )
        self.counts = self.c.counts
        self.c.actual_size = lay(
            <void **>&self.c.actual[0], NULL, sizeof(actual_header_t), ACTUAL, self.counts
        )
        self.c.target_size = lay(
            <void **>&self.c.target[0], NULL, sizeof(target_header_t), TARGET, self.counts
        )
        self.allocate()
        cat_triple_init(&self.c.actual_triple)
        cat_triple_init(&self.c.target_triple)

    cdef allocate(self):
        cdef size_t actual = (self.c.actual_size // CACHE_LINE + 1) * CACHE_LINE
        cdef size_t target = (self.c.target_size // CACHE_LINE + 1) * CACHE_LINE
        cdef size_t size = 4 * actual + TARGETS * target
        cdef uint8_t *block = <uint8_t *>memory_take(&self.memory, size, 1)
        cdef int k
        for k in range(4):
            lay(<void **>&self.c.actual[k], block + k * actual, sizeof(actual_header_t),
                ACTUAL, self.counts)
            self.c.actual[k].header.axis_count = self.c.counts.axes
        for k in range(TARGETS):
            lay(<void **>&self.c.target[k], block + 4 * actual + k * target,
                sizeof(target_header_t), TARGET, self.counts)
            self.c.target[k].header.hold = 1  # nothing has been committed yet

    def fields(self):
        """Return Python's own arrays by the names of plan.request.Views, as memoryviews."""
        fields = self.views(<void **>&self.c.actual[PRIVATE], ACTUAL, False)
        return fields | self.views(<void **>&self.c.target[PRIVATE], TARGET, True)

    cdef dict views(self, void **block, tuple table, bint writable):
        fields = {}
        for k, row in enumerate(table):
            if row[VIEW] is not None:
                count, size = self.counts[row[2]], SIZES[row[1]]
                fields[row[VIEW]] = self.field(
                    block[<size_t>k + 1], count, size, CODES[row[1]], writable
                )
        return fields

    def law_fields(self):
        """Return the layout of the blocks of a law, (actual, target): name → (offset, NumPy format,
        count; None for a single number).
        """
        cdef actual_t *a = &self.c.actual[PRIVATE]
        cdef char *start = <char *>a.header
        actual = {
            "n": (<char *>&a.header.axis_count - start, "<u4", None),
            "ok": (<char *>&a.header.ok - start, "?", None),
            "dt": (<char *>&a.header.period - start, "<f8", None),
        }
        actual |= self.places(<void **>a, ACTUAL, OF_A_LAW)
        return actual, self.places(<void **>&self.c.target[PRIVATE], TARGET, OF_A_LAW)

    def sink_fields(self):
        """Return the layout of the blocks of a sink, (actual, target), as `law_fields` does."""
        cdef actual_t *a = &self.c.actual[PRIVATE]
        cdef char *start = <char *>a.header
        actual = {
            "time_ns": (<char *>&a.header.time_ns - start, "<i8", None),
            "moving": (<char *>&a.header.moving - start, "<u4", None),
        }
        actual |= self.places(<void **>a, ACTUAL, OF_A_SINK)
        return actual, self.places(<void **>&self.c.target[PRIVATE], TARGET, OF_A_SINK)

    cdef dict places(self, void **block, tuple table, int column):
        return {
            row[column]: (
                <char *>block[<size_t>k + 1] - <char *>block[0], row[1], self.counts[row[2]]
            )
            for k, row in enumerate(table)
            if row[column] is not None
        }

    def blocks(self):
        """Return Python's own blocks, (actual, target), as bytes."""
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
        cat_memory_free(&self.memory)
