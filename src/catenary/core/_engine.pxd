from libc.stdint cimport int64_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport Axes
from catenary.core._clocks cimport Clock
from catenary.core._copies cimport Copies
from catenary.core._cycle cimport cycle_t
from catenary.core._figures cimport Figures
from catenary.core._frames cimport Frames
from catenary.core._handover cimport Handover, actual_header_t, handover_t
from catenary.core._acyclic_queue cimport AcyclicQueue
from catenary.core._law cimport Law
from catenary.core._native cimport cat_image, cat_link, cat_sink
from catenary.core._stream cimport Stream
from catenary.core._thread cimport cat_scheduling, thread_t
from catenary.core._trigger cimport TriggerBlock

cdef struct engine_t:
    cycle_t cycle
    thread_t thread
    int error                  # -errno that ended the native thread; 0: none
    uint32_t done              # the native thread has ended

cdef class Engine:
    cdef engine_t e
    cdef handover_t *h
    cdef Frames frames         # None: an external image table is used
    cdef cat_image *image
    cdef const cat_link *link
    cdef tuple owners          # owners of the two tables
    cdef AcyclicQueue acyclic
    cdef Axes axes
    cdef Copies copies         # between devices; None: none
    cdef readonly Clock clock  # None: no distributed clocks
    cdef Handover handover
    cdef dict _buffers
    cdef bint virtual          # the link's time is virtual: everything runs in the caller's thread
    cdef uint16_t device_count
    cdef bint alone            # no other program shares the virtual time: waits keep the GIL
    cdef Figures figures
    cdef Law law               # running, or Python has not processed its end yet; None: no law
    cdef list laws             # laws that the cycle may still use
    cdef Stream stream         # sets the set-points; None: Python or the law does
    cdef list streams          # streams that the cycle may still use
    cdef cat_scheduling scheduling_before
    cdef bint saved_scheduling
    cdef bint native           # the cycle runs in its own thread
    cdef bint running
    cdef bint forgotten        # this is a forked child: the cycle is the parent's
    cdef bint committed        # the targets of the next step are committed already
    cdef bint writing          # another thread writes the targets: do not change them
    cdef uint64_t writing_since  # number of the cycle that this thread sees
    cdef bint emitted          # inline: the frames of this cycle were sent
    cdef object sink           # keeps the sink's capsule alive
    cdef TriggerBlock trigger  # memory shared with a loop in another process; None: none
    cdef int64_t left          # time at which `next` returned [ns]; -1: no application since then
    cdef int64_t input_age     # age of the inputs at that time [ns]
    cdef int64_t zero          # cycle start of the first iteration, on the link's clock; 0: none yet

    cdef not_running(self)
    cdef uint32_t step(self, int64_t timeout_ns=*) except? 0xFFFFFFFF
    cdef bint is_native_cycle(self, bint application) noexcept nogil
    cdef void follow(self) noexcept
    cdef bint is_led(self) noexcept
    cdef uint32_t flags_since(self) noexcept
    cdef void enter_body(self) noexcept
    cdef void inline_outputs(self, bint application) noexcept nogil
    cdef int inline_inputs(self) except -1
    cdef int lockstep(self) except -1
    cdef int native_cycle_here(self) noexcept nogil
    cdef int inline_cycle_here(self) noexcept nogil
    cdef uint32_t step_native(self, int64_t timeout_ns) except? 0xFFFFFFFF
    cdef void commit(self, bint hold) noexcept
    cdef int await_cycle(self, int64_t timeout_ns) except -1
    cdef uint32_t hold(self, int64_t cycles, bint until_stopped,
                       int64_t deadline) except? 0xFFFFFFFF
    cdef uint32_t hold_native(self, int64_t cycles) except? 0xFFFFFFFF
    cdef uint32_t hold_here(self, int64_t cycles) except? 0xFFFFFFFF
    cdef void take_commanded(self) noexcept
    cdef int interrupted(self, int rc) except -1
    cdef int spend_cycle(self) except -1
    cdef void compute(self, int64_t duration_ns) noexcept
    cdef int pass_time(self, int64_t duration) except -1
    cdef void settle_memory(self) noexcept
    cdef memory_text(self)
    cdef int check_reserve(self, int64_t budget) except -1
    cdef bint is_law_used(self, Law law) noexcept
    cdef int attach_motion(self, const cat_sink *sink) except -1
    cdef bint is_stream_used(self, Stream stream) noexcept
    cdef connect(self, plan)
    cdef void begin_iteration(self) noexcept
    cdef int64_t now_ns(self) noexcept
    cdef actual_header_t *actual_header(self) noexcept
