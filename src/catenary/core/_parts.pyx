# cython: boundscheck=False, wraparound=False, cdivision=True
"""Parts: owns all parts of one cyclic exchange, lets them know each other, and tells their figures.
"""

from cpython.pycapsule cimport PyCapsule_GetPointer
from libc.stdint cimport int64_t, uint32_t, uint64_t
from libc.stdlib cimport calloc, free

from catenary.core._axes cimport Axes
from catenary.core._clocks cimport Clock
from catenary.core._cycle cimport (
    LOG_MARGIN,
    PHASES,
    cycle_await_lane,
    cycle_t,
    record_t,
)
from catenary.core._cycle import ORDERS, PHASE_NAMES
from catenary.core._frames cimport Frames
from catenary.core._handover cimport PRIVATE, TARGETS, Handover, actual_header_t
from catenary.core._histogram cimport (
    histogram_counts,
    histogram_reset,
    histogram_summary,
    histogram_t,
)
from catenary.core._lane cimport Lane
from catenary.core._native cimport (
    CAT_AL_OP,
    CAT_IMAGE_CAPSULE,
    CAT_IMAGE_VERSION,
    CAT_LINK_CAPSULE,
    CAT_LINK_SHARED_TIME,
    CAT_LINK_VERSION,
    CAT_LINK_VIRTUAL_TIME,
    cat_fence,
    cat_image,
    cat_link,
)


def columns_by_bank(columns):
    """How many columns each bank has."""
    return [sum(column.bank == bank for column in columns) for bank in range(3)]


cdef const cat_link *link_in(object capsule) except NULL:
    """The checked link table of a capsule."""
    cdef const cat_link *link = <const cat_link *>PyCapsule_GetPointer(capsule, CAT_LINK_CAPSULE)
    if link.version != CAT_LINK_VERSION:
        raise ValueError(f"link: table version {link.version}, expected {CAT_LINK_VERSION}")
    return link


cdef cat_image *image_in(object capsule, plan) except NULL:
    """The checked image table of a capsule, made for this plan."""
    cdef cat_image *image = <cat_image *>PyCapsule_GetPointer(capsule, CAT_IMAGE_CAPSULE)
    if image.version != CAT_IMAGE_VERSION:
        raise ValueError(f"image: table version {image.version}, expected {CAT_IMAGE_VERSION}")
    mine = (image.output_size, image.input_size, image.unit_count)
    wanted = (plan.output_size, plan.input_size, len(plan.sync_units))
    if mine != wanted:
        raise ValueError(f"image: (output, input bytes, sync units) {mine}, the plan has {wanted}")
    if plan.clock is not None:
        raise ValueError("clock: whoever exchanges the images keeps the clocks")
    return image


cdef class Parts:
    def __cinit__(self, plan, link, image=None):
        if plan.order not in ORDERS:
            raise ValueError(f"order: {plan.order!r}, must be one of {', '.join(ORDERS)}")
        if not 1000 <= plan.period_ns <= 1 << 40:
            raise ValueError(f"period_ns: {plan.period_ns}")
        if not 0 <= plan.collect_deadline_ns <= plan.period_ns:
            raise ValueError(
                f"collect_deadline_ns: {plan.collect_deadline_ns}, must lie in the period"
                f" of {plan.period_ns}"
            )
        if plan.priority is not None and not 1 <= plan.priority <= 99:
            raise ValueError(f"priority: {plan.priority}, must be 1 to 99 or None")
        if plan.cpu is not None and not 0 <= plan.cpu < 1024:
            raise ValueError(f"cpu: {plan.cpu}")
        if not 0 <= plan.busy_wait_ns < plan.period_ns:
            raise ValueError(f"busy_wait_ns: {plan.busy_wait_ns}, must be less than the period")
        if not 1 <= plan.log_cycles <= 1 << 24:
            raise ValueError(f"log_cycles: {plan.log_cycles}, must be 1 to {1 << 24}")
        self.e.thread.priority = plan.priority or 0
        self.e.thread.cpu = -1 if plan.cpu is None else plan.cpu
        self.device_count = plan.device_count
        self.owners = (link, image)
        if image is None:
            self.frames = Frames(plan, link)
            self.image = &self.frames.c.image
            self.link = self.frames.c.link
        else:
            self.image = image_in(image, plan)
            self.link = link_in(link)
        self.lane = Lane(plan.period_ns)
        self.axes = Axes(plan)
        if plan.clock is not None:
            self.clock = Clock(plan.clock, plan.period_ns)
        self.handover = Handover(
            len(plan.axes),
            len(plan.sync_units),
            columns_by_bank(plan.input_columns),
            columns_by_bank(plan.output_columns),
        )
        self.connect(plan)
        self._buffers = self.handover.fields()

    cdef connect(self, plan):
        """Lets the parts know each other."""
        cdef cycle_t *c = &self.e.cycle
        cdef uint32_t i
        cdef int slot
        self.log_cycles = plan.log_cycles
        c.records_mask = (1 << (plan.log_cycles + LOG_MARGIN - 1).bit_length()) - 1
        c.records = <record_t *>calloc(c.records_mask + 1, sizeof(record_t))
        c.histograms = <histogram_t *>calloc(PHASES, sizeof(histogram_t))
        self.spare_histograms = <histogram_t *>calloc(PHASES, sizeof(histogram_t))
        if not (c.records and c.histograms and self.spare_histograms):
            raise MemoryError
        if self.frames is not None:
            self.frames.c.lane = &self.lane.c
        self.axes.c.image = self.image
        if self.clock is not None:
            self.frames.carry_time(&self.clock.c)
            c.clock = &self.clock.c
            c.sync_margin = plan.clock.allowance_ns
        c.link = self.link
        c.image = self.image
        c.axes = &self.axes.c
        c.lane = &self.lane.c
        c.handover = &self.handover.c
        self.virtual = c.link.flags & CAT_LINK_VIRTUAL_TIME != 0
        self.alone = self.virtual and not c.link.flags & CAT_LINK_SHARED_TIME
        c.order = ORDERS[plan.order]
        c.period = plan.period_ns
        c.busy_wait = 0 if self.virtual else plan.busy_wait_ns
        c.collect_deadline = plan.collect_deadline_ns
        c.lost_limit = plan.lost_limit
        self.h = &self.handover.c
        for slot in range(4):
            self.h.actual[slot].header.period = c.period * 1e-9
        for slot in range(TARGETS):
            for i in range(c.axes.axis_count):
                self.h.target[slot].mode[i] = c.axes.axes[i].mode
        for i in range(c.axes.axis_count):
            self.h.actual[PRIVATE].position[i] = c.axes.axes[i].position
            self.h.actual[PRIVATE].velocity[i] = c.axes.axes[i].velocity
            self.h.actual[PRIVATE].torque[i] = c.axes.axes[i].torque

    # ---- the cycle that `actual` belongs to

    cdef actual_header_t *actual_header(self) noexcept:
        """Of the cycle that Python's actual values belong to; lives as long as the engine."""
        return self.h.actual[PRIVATE].header

    cdef int64_t now_ns(self) noexcept:
        return self.e.cycle.link.now(self.e.cycle.link.self)

    def now(self):
        return self.now_ns()

    @property
    def buffers(self):
        return dict(self._buffers)

    def blocks(self):
        return self.handover.blocks()

    def law_fields(self):
        return self.handover.law_fields()

    def sink_fields(self):
        return self.handover.sink_fields()

    @property
    def sink_sizes(self):
        return sizeof(record_t), self.h.actual_size, self.h.target_size

    @property
    def number(self):
        return self.h.actual[PRIVATE].header.number

    @property
    def time_ns(self):
        return self.h.actual[PRIVATE].header.time_ns

    @property
    def flags(self):
        return self.h.actual[PRIVATE].header.flags

    @property
    def lost_in_row(self):
        return self.h.actual[PRIVATE].header.lost_in_row

    @property
    def skipped(self):
        return self.h.actual[PRIVATE].header.skipped

    @property
    def missing_frames(self):
        return self.h.actual[PRIVATE].header.missing_frames

    @property
    def al_status(self):
        return self.h.actual[PRIVATE].header.al_status

    @property
    def al_counter(self):
        return self.h.actual[PRIVATE].header.al_counter

    @property
    def disturbed(self):
        cdef uint32_t unit
        image = self.image
        for unit in range(image.unit_count):
            if not image.unit_valid[unit]:
                return True
        return image.al_counter[0] != self.device_count or image.al_status[0] != CAT_AL_OP

    # ---- figures

    @property
    def counters(self):
        frames = {} if self.frames is None else self.frames.c.counters
        return {
            "cycles": self.e.cycle.number,
            "lost": self.e.cycle.lost,
            "late": self.e.cycle.late,
            "uncommitted": self.e.cycle.uncommitted,
            "missed_sync": self.e.cycle.missed_sync,
            "stale": 0,
            "alien": 0,
            "corrupt": 0,
            "duplicate": 0,
            "unprocessed": 0,
            "repeated": 0,
            "lane_sent": self.lane.c.sent,
            "lane_received": self.lane.c.received,
            "lane_dropped": self.lane.c.dropped,
            "send_errors": 0,
            "receive_errors": 0,
            **frames,
        }

    def histograms(self):
        return {
            name: histogram_summary(&self.e.cycle.histograms[phase])
            for name, phase in PHASE_NAMES.items()
        }

    def histogram_counts(self, str phase not None):
        if phase not in PHASE_NAMES:
            raise ValueError(f"phase {phase!r}: must be one of {', '.join(PHASE_NAMES)}")
        return histogram_counts(&self.e.cycle.histograms[<int>PHASE_NAMES[phase]])

    def reset_histograms(self):
        """By exchanging them: the native thread may be adding to the old ones this very moment."""
        cdef histogram_t *old = self.e.cycle.histograms
        cdef int phase
        for phase in range(PHASES):
            histogram_reset(&self.spare_histograms[phase])
        cat_fence()
        self.e.cycle.histograms = self.spare_histograms
        self.spare_histograms = old

    def log(self):
        """A record that the native thread has written over meanwhile is left out."""
        cdef uint64_t last = self.e.cycle.number
        cdef uint64_t count = min(last, self.log_cycles)
        cdef uint64_t number
        cdef record_t record
        parts = []
        for number in range(last - count + 1, last + 1):
            record = self.e.cycle.records[number & self.e.cycle.records_mask]
            cat_fence()
            if record.number == number and self.e.cycle.records[number & self.e.cycle.records_mask].number == number:
                parts.append((<char *>&record)[: sizeof(record_t)])
        return b"".join(parts)

    # ---- the acyclic lane

    def lane_push(self, bytes frame not None):
        return self.lane.push(frame)

    def lane_pop(self):
        return self.lane.pop()

    def lane_wait(self, int64_t timeout_ns):
        cdef int64_t until
        if not self.virtual:
            return self.lane.wait(timeout_ns)
        until = min(self.e.cycle.next, self.e.cycle.link.now(self.e.cycle.link.self) + timeout_ns)
        with nogil:
            cycle_await_lane(&self.e.cycle, until)
        return self.lane.wait(0)

    def __dealloc__(self):
        free(self.e.cycle.records)
        free(self.e.cycle.histograms)
        free(self.spare_histograms)
